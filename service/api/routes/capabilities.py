"""GET /v1/capabilities: what this service can do, and its limits."""

from __future__ import annotations

from typing import Any, get_args

from fastapi import APIRouter, Request

from schemas.capabilities import Capabilities, Dialect, Limits
from schemas.jobs import JobKind
from schemas.machine import DIALECT_ENDINGS, Machine
from schemas.materials import MATERIALS
from schemas.setup import Stock
from schemas.tools import BUILT_KINDS
from service.api.principals import Caller
from service.api.problems import responses
from service.api.uploads import DEADLINE_S
from service.errors import UnauthorizedError
from service.jobs.api_keys import SCOPES
from service.settings import Settings
from service.version import VERSION, code_version

router = APIRouter(prefix="/v1/capabilities", tags=["operation"])

STEPNC = ("AP238", "ISO 14649")


@router.get("", operation_id="capabilities", summary="What the service can do",
            response_description="The capabilities.", responses=responses(UnauthorizedError))
def capabilities(request: Request, caller: Caller) -> Capabilities:
    """Dialects, tools, machines, materials, limits, version, and the principal of the key. Any key may read it."""
    settings: Settings = request.app.state.settings
    return Capabilities(
        version=VERSION, code=code_version(), kinds=list(get_args(JobKind)),
        dialects=[Dialect(name=n, extension=e) for n, e in DIALECT_ENDINGS.items()], stepnc=list(STEPNC),
        tools=list(BUILT_KINDS), machines=_choices(Machine, "kind"), kinematics=_choices(Machine, "kinematics"),
        stock=_choices(Stock, "kind"), materials=list(MATERIALS), webhooks=settings.webhooks_on,
        slots=request.app.state.engine.capacity(), principal=caller.principal,
        scopes=[s for s in SCOPES if s in caller.scopes],
        limits=Limits(body_bytes=settings.max_body_bytes, job_time_s=settings.job_time_limit_s,
                      job_memory_bytes=settings.job_memory_limit_mb * 1_000_000, attempts=settings.max_attempts,
                      submissions=settings.post_rate, queued=settings.max_queued,
                      queued_each=settings.max_queued_each, deadline_s=[float(s) for s in DEADLINE_S],
                      retention_days=settings.retention_days or None))


def _choices(model: Any, field: str) -> list[str]:
    """The allowed values of a field, from its annotation."""
    kinds = (model.model_fields[field].annotation, *get_args(model.model_fields[field].annotation))
    return [word for kind in kinds for word in get_args(kind) if isinstance(word, str)]
