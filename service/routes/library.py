"""/v1/tools, /v1/machines, /v1/materials: entries that a setup refers to as "lib:NAME".

The libraries belong to the whole service, not to one principal. A job keeps the entry as it was when the job was
posted: later changes of the library change no job.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response, status

from schemas.base import NAME_PATTERN
from schemas.jobs import MachineEntry, MachineList, MaterialEntry, MaterialList, ToolEntry, ToolList
from schemas.machine import Machine
from schemas.materials import MATERIALS, Material
from schemas.tools import Tool
from service.errors import NotFoundError, RequestError, TooLargeError, UnauthorizedError
from service.principals import Principal, Submitter
from service.problems import responses

router = APIRouter(prefix="/v1", tags=["libraries"])

Name = Annotated[str, Path(pattern=NAME_PATTERN, description="Name of the entry; a setup says lib:NAME.")]
MaterialName = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}$",
                                   description="Name as GET /v1/materials lists it; built-in ones may have blanks.")]
READ = responses(UnauthorizedError)
ONE = responses(UnauthorizedError, NotFoundError, RequestError)
WRITE = responses(UnauthorizedError, RequestError, TooLargeError) | {201: {"description": "The entry is new."}}


def _put(request: Request, response: Response, shelf: str, name: str, entry: Tool | Machine | Material) -> None:
    new = request.app.state.engine.library.put(shelf, name, entry.model_dump(mode="json"))
    response.status_code = status.HTTP_201_CREATED if new else status.HTTP_200_OK


@router.get("/tools", operation_id="listTools", responses=READ)
def list_tools(request: Request, _: Principal) -> ToolList:
    """All tools."""
    entries = request.app.state.engine.library.all()["tools"]
    return ToolList(items=[ToolEntry(name=n, entry=Tool.model_validate(e)) for n, e in entries.items()])


@router.get("/tools/{name}", operation_id="getTool", responses=ONE)
def get_tool(request: Request, _: Principal, name: Name) -> ToolEntry:
    """One tool."""
    return ToolEntry(name=name, entry=Tool.model_validate(request.app.state.engine.library.get("tools", name)))


@router.put("/tools/{name}", operation_id="putTool", responses=WRITE)
def put_tool(request: Request, response: Response, _: Submitter, name: Name, tool: Tool) -> ToolEntry:
    """Write a tool, new or over the old one."""
    _put(request, response, "tools", name, tool)
    return ToolEntry(name=name, entry=tool)


@router.delete("/tools/{name}", operation_id="deleteTool", status_code=204, responses=ONE)
def delete_tool(request: Request, _: Submitter, name: Name) -> None:
    """Remove a tool."""
    request.app.state.engine.library.delete("tools", name)


@router.get("/machines", operation_id="listMachines", responses=READ)
def list_machines(request: Request, _: Principal) -> MachineList:
    """All machines."""
    entries = request.app.state.engine.library.all()["machines"]
    return MachineList(items=[MachineEntry(name=n, entry=Machine.model_validate(e)) for n, e in entries.items()])


@router.get("/machines/{name}", operation_id="getMachine", responses=ONE)
def get_machine(request: Request, _: Principal, name: Name) -> MachineEntry:
    """One machine."""
    entry = request.app.state.engine.library.get("machines", name)
    return MachineEntry(name=name, entry=Machine.model_validate(entry))


@router.put("/machines/{name}", operation_id="putMachine", responses=WRITE)
def put_machine(request: Request, response: Response, _: Submitter, name: Name, machine: Machine) -> MachineEntry:
    """Write a machine, new or over the old one."""
    _put(request, response, "machines", name, machine)
    return MachineEntry(name=name, entry=machine)


@router.delete("/machines/{name}", operation_id="deleteMachine", status_code=204, responses=ONE)
def delete_machine(request: Request, _: Submitter, name: Name) -> None:
    """Remove a machine."""
    request.app.state.engine.library.delete("machines", name)


@router.get("/materials", operation_id="listMaterials", responses=READ)
def list_materials(request: Request, _: Principal) -> MaterialList:
    """Built-in materials, then the library's."""
    entries = request.app.state.engine.library.all()["materials"]
    own = [MaterialEntry(name=n, entry=Material.model_validate(e)) for n, e in entries.items()]
    return MaterialList(items=[MaterialEntry(name=n, entry=m, built_in=True) for n, m in MATERIALS.items()] + own)


@router.get("/materials/{name}", operation_id="getMaterial", responses=ONE)
def get_material(request: Request, _: Principal, name: MaterialName) -> MaterialEntry:
    """One material: the library's entry of that name, else the built-in one."""
    library = request.app.state.engine.library
    if name in MATERIALS and name not in library.all()["materials"]:
        return MaterialEntry(name=name, entry=MATERIALS[name], built_in=True)
    entry = library.get("materials", name)
    return MaterialEntry(name=name, entry=Material.model_validate(entry))


@router.put("/materials/{name}", operation_id="putMaterial", responses=WRITE)
def put_material(request: Request, response: Response, _: Submitter, name: Name, material: Material) -> MaterialEntry:
    """Write a material, new or over the old one."""
    _put(request, response, "materials", name, material)
    return MaterialEntry(name=name, entry=material)


@router.delete("/materials/{name}", operation_id="deleteMaterial", status_code=204, responses=ONE)
def delete_material(request: Request, _: Submitter, name: Name) -> None:
    """Remove a material from the library."""
    request.app.state.engine.library.delete("materials", name)
