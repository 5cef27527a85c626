"""``zonemill keys``: create, list and revoke API keys in the database of the service. Heavy imports are inside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.commands.arguments import error_reporting

if TYPE_CHECKING:
    from service.jobs.api_keys import KeyStore

app = typer.Typer(no_args_is_help=True, help="API keys of the service: create, list, revoke.")

Data = Annotated[Path | None, typer.Option("--data", help="Data folder; default: ./data. ZONEMILL_DATABASE_URL is used "
                                                          "as for serve.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print errors as JSON (problem document) on stdout.")]


@app.command()
def create(principal: Annotated[str, typer.Option(help="Name of the owner; jobs belong to this name.")],
           scopes: Annotated[str, typer.Option(
               help="Scopes out of submit, read, admin, metrics, separated by commas.")] = "submit,read",
           days: Annotated[float, typer.Option(min=0, help="Days until the key expires; 0: never.")] = 365.0,
           note: Annotated[str, typer.Option(help="Purpose of the key.")] = "", data: Data = None,
           as_json: AsJson = False) -> None:
    """Create a key and print it. It cannot be shown again."""
    with error_reporting(as_json):
        from service.console import print_json, say
        from service.jobs.resources import key_resource

        store = _store(data)
        text, row = store.make(principal, [s.strip() for s in scopes.split(",")], days or None, note)
        say(f"made in {store.engine.url.render_as_string(hide_password=True)}; the service must use this database")
        print_json({"key": text, **key_resource(row).model_dump()})


@app.command("list")
def list_keys(data: Data = None, as_json: AsJson = False) -> None:
    """Print every key without its secret."""
    with error_reporting(as_json):
        from service.console import print_json
        from service.jobs.resources import key_resource

        print_json([key_resource(row).model_dump() for row in _store(data).all()])


@app.command()
def revoke(key_id: Annotated[str, typer.Argument(metavar="ID", help="Id from zonemill keys list.")],
           data: Data = None, as_json: AsJson = False) -> None:
    """End a key now; open event streams of its holder end within seconds."""
    with error_reporting(as_json):
        _store(data).revoke(key_id)


@app.command("webhook-secret")
def webhook_secret(principal: Annotated[str, typer.Option(help="Owner of the webhooks.")],
                   as_json: AsJson = False) -> None:
    """Print the secret that signs the webhooks of a principal, for the receiver; needs ZONEMILL_WEBHOOK_SECRET.

    Raises
    ------
    SetupError
        no_webhook_secret: ZONEMILL_WEBHOOK_SECRET is not set.
    """
    with error_reporting(as_json):
        from geometry.errors import SetupError
        from service.api.server import settings_with
        from service.jobs.webhooks import secret_of

        master = settings_with({}).webhook_secret
        if master is None:
            raise SetupError("ZONEMILL_WEBHOOK_SECRET is not set", code="bad_setting",
                             remedy="set it to the value of the service, at least 32 characters")
        typer.echo(secret_of(master.get_secret_value(), principal))


def _store(data: Path | None) -> KeyStore:
    """The keys in the database of the settings; the database is made where there is none."""
    from service.api.server import settings_with
    from service.jobs.api_keys import KeyStore
    from service.jobs.database import connect, migrate

    given: dict[str, Any] = {"data_dir": data}
    url = settings_with(given).url
    migrate(url)
    return KeyStore(connect(url))
