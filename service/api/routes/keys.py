"""/v1/keys: API keys, for holders of the scope admin."""

from __future__ import annotations

from typing import Annotated

import structlog
from fastapi import APIRouter, Path, Request, status

from schemas.keys import KeyList, MadeKey, NewKey
from service.api.principals import Admin
from service.api.problems import responses
from service.errors import NotFoundError, RequestError, TooLargeError, UnauthorizedError
from service.jobs.resources import key_resource

log = structlog.get_logger(__name__)
router = APIRouter(prefix="/v1/keys", tags=["keys"])

KeyId = Annotated[str, Path(pattern="^[0-9a-f]{12}$", description="Id of the key.")]


@router.get("", operation_id="listKeys", summary="All keys", response_description="The keys.",
            responses=responses(UnauthorizedError))
def list_keys(request: Request, _: Admin) -> KeyList:
    """Every key without its secret, including revoked ones."""
    return KeyList(items=[key_resource(row) for row in request.app.state.engine.keys.all()])


@router.post("", operation_id="createKey", summary="Make a key", response_description="The new key.",
             status_code=status.HTTP_201_CREATED, responses=responses(UnauthorizedError, RequestError, TooLargeError))
def create_key(request: Request, admin: Admin, new: NewKey) -> MadeKey:
    """Create a key. Only this answer contains its text. Once a key exists, every request needs a key."""
    text, row = request.app.state.engine.keys.make(new.principal, new.scopes, new.days, new.note)
    log.info("key made", key=row["id"], principal=new.principal, scopes=row["scopes"], by=admin)
    return MadeKey(key=text, about=key_resource(row))


@router.delete("/{key_id}", operation_id="revokeKey", summary="Revoke a key",
               response_description="The key is revoked.", status_code=204,
               responses=responses(UnauthorizedError, NotFoundError, RequestError))
def revoke_key(request: Request, admin: Admin, key_id: KeyId) -> None:
    """Revoke a key now. It stays in the list; a second call changes nothing."""
    request.app.state.engine.keys.revoke(key_id)
    log.info("key revoked", key=key_id, by=admin)
