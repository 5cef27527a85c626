"""/v1/tools, /v1/machines, /v1/materials: entries to which a setup refers as "lib:NAME" or "lib:NAME@3".

The principal that writes an entry owns it. A job keeps the entry as it was when the job was posted, and lists the
versions it used. Later changes of the library change no job.
"""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response, status

from schemas.base import NAME_PATTERN
from schemas.jobs import MachineEntry, MachineList, MaterialEntry, MaterialList, ToolEntry, ToolList
from schemas.machine import Machine
from schemas.materials import MATERIALS, Material, known_material
from schemas.tools import Tool
from service.api.principals import Caller, Principal, require
from service.api.problems import responses
from service.errors import NotFoundError, RequestError, TooLargeError, UnauthorizedError
from service.jobs.api_keys import ADMIN, SUBMIT, Identity
from service.jobs.library import SHARED, Entry, LibraryStore
from service.jobs.resources import time_text

router = APIRouter(prefix="/v1", tags=["libraries"])

Name = Annotated[str, Path(pattern=NAME_PATTERN, description="Name of the entry; a setup refers to it as lib:NAME.")]
MaterialName = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}$",
                                   description="Name as in GET /v1/materials; built-in names may have spaces.")]
Version = Annotated[int | None, Query(ge=1, le=10**9, description="Version of the entry; default: the newest.")]
Shared = Annotated[bool, Query(description="true: the entry shared by all principals (needs scope admin). false: your "
                                           "own.")]
READ = responses(UnauthorizedError)
ONE = responses(UnauthorizedError, NotFoundError, RequestError)
WRITE = responses(UnauthorizedError, RequestError, TooLargeError) | {201: {"description": "The entry is new."}}


def _library(request: Request) -> LibraryStore:
    store: LibraryStore = request.app.state.engine.library
    return store


def _about(entry: Entry) -> dict[str, Any]:
    return {"name": entry.name, "version": entry.version, "shared": entry.shared,
            "created_at": time_text(entry.created)}


def _owner(caller: Identity, shared: bool) -> str:
    """Owner of the entries that a request writes; only admins write shared ones."""
    require(caller, ADMIN if shared else SUBMIT)
    return SHARED if shared else caller.principal


def _put(request: Request, response: Response, caller: Identity, shelf: str, name: str, shared: bool,
         value: Tool | Machine | Material) -> dict[str, Any]:
    entry, new = _library(request).put(_owner(caller, shared), shelf, name, value.model_dump(mode="json"))
    response.status_code = status.HTTP_201_CREATED if new else status.HTTP_200_OK
    return _about(entry)


def _tool(entry: Entry) -> ToolEntry:
    return ToolEntry(**_about(entry), entry=Tool.model_validate(entry.value))


def _machine(entry: Entry) -> MachineEntry:
    return MachineEntry(**_about(entry), entry=Machine.model_validate(entry.value))


def _material(entry: Entry) -> MaterialEntry:
    return MaterialEntry(**_about(entry), entry=Material.model_validate(entry.value))


@router.get("/tools", operation_id="listTools", summary="All tools",
            response_description="All tools that you can use.", responses=READ)
def list_tools(request: Request, principal: Principal) -> ToolList:
    """The newest version of every tool that you can use."""
    return ToolList(items=[_tool(e) for e in _library(request).all(principal, "tools")])


@router.get("/tools/{name}", operation_id="getTool", summary="One tool", response_description="The tool.",
            responses=ONE)
def get_tool(request: Request, principal: Principal, name: Name, version: Version = None) -> ToolEntry:
    """One tool: your own with that name, otherwise the shared one."""
    return _tool(_library(request).get(principal, "tools", name, version))


@router.put("/tools/{name}", operation_id="putTool", summary="Write a tool",
            response_description="The tool is written.", responses=WRITE)
def put_tool(request: Request, response: Response, caller: Caller, name: Name, tool: Tool,
             shared: Shared = False) -> ToolEntry:
    """Write a tool. A change creates the next version."""
    return ToolEntry(**_put(request, response, caller, "tools", name, shared, tool), entry=tool)


@router.delete("/tools/{name}", operation_id="deleteTool", summary="Delete a tool",
               response_description="The tool is deleted.", status_code=204, responses=ONE)
def delete_tool(request: Request, caller: Caller, name: Name, shared: Shared = False) -> None:
    """Delete a tool with all its versions. Jobs keep the versions that they used."""
    _library(request).delete(_owner(caller, shared), "tools", name)


@router.get("/machines", operation_id="listMachines", summary="All machines",
            response_description="All machines that you can use.", responses=READ)
def list_machines(request: Request, principal: Principal) -> MachineList:
    """The newest version of every machine that you can use."""
    return MachineList(items=[_machine(e) for e in _library(request).all(principal, "machines")])


@router.get("/machines/{name}", operation_id="getMachine", summary="One machine",
            response_description="The machine.", responses=ONE)
def get_machine(request: Request, principal: Principal, name: Name, version: Version = None) -> MachineEntry:
    """One machine: your own with that name, otherwise the shared one."""
    return _machine(_library(request).get(principal, "machines", name, version))


@router.put("/machines/{name}", operation_id="putMachine", summary="Write a machine",
            response_description="The machine is written.", responses=WRITE)
def put_machine(request: Request, response: Response, caller: Caller, name: Name, machine: Machine,
                shared: Shared = False) -> MachineEntry:
    """Write a machine. A change creates the next version."""
    return MachineEntry(**_put(request, response, caller, "machines", name, shared, machine), entry=machine)


@router.delete("/machines/{name}", operation_id="deleteMachine", summary="Delete a machine",
               response_description="The machine is deleted.", status_code=204, responses=ONE)
def delete_machine(request: Request, caller: Caller, name: Name, shared: Shared = False) -> None:
    """Delete a machine with all its versions. Jobs keep the versions that they used."""
    _library(request).delete(_owner(caller, shared), "machines", name)


@router.get("/materials", operation_id="listMaterials", summary="All materials",
            response_description="All materials that you can use.", responses=READ)
def list_materials(request: Request, principal: Principal) -> MaterialList:
    """Built-in materials, then the newest version of every material that you can use."""
    own = [_material(e) for e in _library(request).all(principal, "materials")]
    return MaterialList(items=[MaterialEntry(name=n, entry=m, built_in=True) for n, m in MATERIALS.items()] + own)


@router.get("/materials/{name}", operation_id="getMaterial", summary="One material",
            response_description="The material.", responses=ONE)
def get_material(request: Request, principal: Principal, name: MaterialName, version: Version = None) -> MaterialEntry:
    """One material: your own with that name, otherwise the shared one, otherwise the built-in one.

    A built-in material has any of its usual names: EN, DIN, material number, AISI, UNS or trade name. If it has no
    figures of its own, `group` names the group of materials whose figures it has.
    """
    try:
        return _material(_library(request).get(principal, "materials", name, version))
    except NotFoundError:
        if version is not None or (found := known_material(name)) is None:
            raise
    return MaterialEntry(name=found.name, entry=found, built_in=True)


@router.put("/materials/{name}", operation_id="putMaterial", summary="Write a material",
            response_description="The material is written.", responses=WRITE)
def put_material(request: Request, response: Response, caller: Caller, name: Name, material: Material,
                 shared: Shared = False) -> MaterialEntry:
    """Write a material. A change creates the next version."""
    return MaterialEntry(**_put(request, response, caller, "materials", name, shared, material), entry=material)


@router.delete("/materials/{name}", operation_id="deleteMaterial", summary="Delete a material",
               response_description="The material is deleted.", status_code=204, responses=ONE)
def delete_material(request: Request, caller: Caller, name: Name, shared: Shared = False) -> None:
    """Delete a material with all its versions. Jobs keep the versions that they used."""
    _library(request).delete(_owner(caller, shared), "materials", name)
