"""The OpenAPI document of the application, with the models that no route names by itself."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from schemas.jobs import JobEvent
from schemas.problem import Problem
from schemas.setup import Setup
from service.samples import add_samples

TEMPLATE = "#/components/schemas/{model}"


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
    add_samples(found)
    return found


def as_yaml(data: dict[str, Any]) -> str:
    """The document as YAML, in stable order."""
    import yaml  # type: ignore[import-untyped]

    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=110)
