"""The OpenAPI document of the application, including models that no route names."""

from __future__ import annotations

import json
import re
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from schemas.jobs import JobEvent
from schemas.problem import Problem
from schemas.setup import Setup
from service.api.openapi_examples import add_samples

TEMPLATE = "#/components/schemas/{model}"
SECTION = re.compile(r"\n\s*\n[A-Z][A-Za-z ]*\n-{3,}\n.*", re.DOTALL)
"""The sections of a docstring, such as Raises, which are for readers of the code."""


def document(app: FastAPI) -> dict[str, Any]:
    """The document as plain data."""
    found = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes,
                        separate_input_output_schemas=False)
    _, extra = models_json_schema([(Setup, "validation"), (Problem, "validation"), (JobEvent, "validation")],
                                  ref_template=TEMPLATE)
    schemas = found["components"]["schemas"]
    for name, schema in extra["$defs"].items():
        schemas.setdefault(name, schema)
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    found["components"]["schemas"] = dict(sorted(schemas.items()))
    _plain(found)
    _words(found)
    add_samples(found)
    return found


def _plain(node: Any) -> None:
    """Rewrite schemas for generators of clients, with the same meaning.

    Numbers state their precision; otherwise Go takes 32 bits, too few for 0.002 mm. "X or null" is a list of two types;
    otherwise Java gets a class for each such field. A default that is a list of objects, or stands beside a reference,
    moves into the description; otherwise Java gets code that does not compile.
    """
    if isinstance(node, dict):
        kinds = node.get("anyOf", ())
        if len(kinds) == 2 and kinds[1] == {"type": "null"} and _is_plain(kinds[0]):
            rest = dict(node.pop("anyOf")[0])
            rest |= {"enum": [*rest["enum"], None]} if "enum" in rest else {}
            for key, value in {**rest, "type": [rest["type"], "null"]}.items():
                node.setdefault(key, value)
        if "number" in (node.get("type"), *_listed(node.get("type"))):
            node.setdefault("format", "double")
        if node.get("default") and ("$ref" in node.get("items", ()) or any("$ref" in k for k in node.get("anyOf", ()))):
            default = json.dumps(node.pop("default"))
            node["description"] = f"{node.get('description', '').rstrip('. ')}. Default: {default}".removeprefix(". ")
        for value in list(node.values()):
            _plain(value)
    elif isinstance(node, list):
        for value in node:
            _plain(value)


def _words(node: Any) -> None:
    """Make descriptions that come from docstrings plain Markdown: no sections, and one backtick around code."""
    if isinstance(node, dict):
        if isinstance(text := node.get("description"), str):
            node["description"] = SECTION.sub("", text).replace("``", "`")
        for value in node.values():
            _words(value)
    elif isinstance(node, list):
        for value in node:
            _words(value)


def _is_plain(kind: dict[str, Any]) -> bool:
    return isinstance(kind.get("type"), str) and "const" not in kind


def _listed(kind: Any) -> list[str]:
    return kind if isinstance(kind, list) else []


def as_yaml(data: dict[str, Any]) -> str:
    """The document as YAML, in stable order."""
    import yaml  # type: ignore[import-untyped]

    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=110)
