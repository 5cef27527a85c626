"""Every setting of the service, from the environment (``ZONEMILL_PORT=9000``) or from code.

docs/settings.md describes each of them; a test keeps the page complete.
"""

from __future__ import annotations

import ipaddress
import os
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, SecretStr, ValidationError, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict, SettingsError

from geometry.errors import SetupError


def _cores() -> int:
    return max(1, len(os.sched_getaffinity(0)))


class MemorySettings(BaseSettings):
    """The settings that the command line takes from the environment too."""

    model_config = SettingsConfigDict(env_prefix="ZONEMILL_", env_ignore_empty=True, extra="ignore")

    memory_mb: Annotated[int | None, Field(
        ge=64, description="Memory that the jobs of one machine may take together, MB; unset: all that the machine or "
                           "its container has.")] = None
    memory_wait_s: Annotated[float, Field(
        ge=0, description="How long a job waits for memory that other jobs of the machine take, s.")] = 3600.0


class Settings(MemorySettings):
    """Settings with their defaults."""

    host: Annotated[str, Field(description="Address to listen on.")] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535, description="Port to listen on; 0: any free port.")] = 8000
    data_dir: Annotated[Path, Field(description="Folder for uploads, results and the database.")] = Path("data")
    database_url: Annotated[str | None, Field(
        description="SQLAlchemy URL; unset: SQLite inside data_dir. PostgreSQL: postgresql+psycopg://...")] = None
    scheduler: Annotated[str | None, Field(
        description="Address of a Dask scheduler (tcp://host:8786); unset: embedded.")] = None
    workers: Annotated[int, Field(ge=1, le=1024, description="Number of jobs that run at once, embedded.")] = max(
        1, _cores() // 2)
    child_threads: Annotated[int, Field(ge=0, le=1024, description="Kernel threads of one job; 0: "
                                                                   "cores / workers.")] = 0
    preload: Annotated[bool, Field(
        description="Whether a process with the planner loaded stays ready, from which jobs start at once.")] = True
    job_time_limit_s: Annotated[float, Field(gt=0, description="Wall time of one attempt, s.")] = 1800.0
    job_memory_limit_mb: Annotated[int, Field(ge=64, description="Largest resident memory of a job, MB.")] = 8000
    max_attempts: Annotated[int, Field(
        ge=1, le=10, description="How often a job starts at most when its process is lost.")] = 3
    lease_s: Annotated[float, Field(gt=0, description="Time after which a silent worker loses its job, s.")] = 20.0
    poll_s: Annotated[float, Field(gt=0, le=5, description="Interval between checks of cancel and progress, s.")] = 0.2
    max_body_mb: Annotated[float, Field(gt=0, description="Largest request body, MB.")] = 256.0
    auth: Annotated[Literal["auto", "keys"], Field(
        description="keys: a key is always required; auto: not on loopback until the first key exists.")] = "auto"
    post_rate: Annotated[str, Field(description="Most job submissions of a principal, for example 120/minute.")
                         ] = "120/minute"
    max_queued: Annotated[int, Field(ge=1, description="Most waiting jobs; more are refused with 429.")] = 1000
    max_queued_each: Annotated[int, Field(ge=1, description="Most waiting jobs of one principal.")] = 200
    max_streams_each: Annotated[int, Field(ge=1, description="Most open event streams of a "
                                                             "principal, in one process.")] = 50
    min_free_mb: Annotated[int, Field(ge=0, description="Free disk space, MB, below which no job is accepted or "
                                                        "started.")] = 500
    retention_days: Annotated[float, Field(
        ge=0, description="Days until the files of an ended job are removed; 0 keeps them.")] = 0.0
    sweep_every_s: Annotated[float, Field(gt=0, description="Interval between searches for old and unused files, s.")
                             ] = 3600.0
    webhook_origins: Annotated[list[str], Field(
        description="Origins to which webhooks may go, as JSON: [\"https://mes.example.com\"]; empty: none.")] = []
    webhook_networks: Annotated[list[str], Field(
        description="Non-public networks to which webhooks may go, as JSON: [\"10.1.0.0/16\"].")] = []
    webhook_secret: Annotated[SecretStr | None, Field(
        min_length=32, description="Secret from which those of the principals are derived; unset: no webhooks.")] = None
    webhook_secret_before: Annotated[SecretStr | None, Field(
        min_length=32, description="Previous secret, while receivers change to the new one; both sign.")] = None
    webhook_attempts: Annotated[int, Field(ge=1, le=50, description="Number of attempts of a webhook.")] = 10
    webhook_retry_s: Annotated[float, Field(
        gt=0, description="Pause after the first attempt, s; each further pause is four times longer, at most six "
                          "hours.")] = 5.0
    webhook_timeout_s: Annotated[float, Field(
        gt=0, le=60, description="For connecting, and again for the rest of an attempt, s.")] = 10.0
    log_level: Annotated[Literal["debug", "info", "warning", "error"], Field(description="Lowest level that is logged.")
                         ] = "info"
    log_format: Annotated[Literal["console", "json"], Field(description="Form of the log on stderr.")] = "console"

    @field_validator("post_rate")
    @classmethod
    def _a_rate(cls, value: str) -> str:
        from limits import parse

        if parse(value).amount < 1:
            raise ValueError("lets nothing through")
        return value

    @field_validator("webhook_origins")
    @classmethod
    def _origins(cls, value: list[str]) -> list[str]:
        from service.outbound_requests import parse_origin

        return [parse_origin(text) for text in value]

    @field_validator("webhook_networks")
    @classmethod
    def _networks(cls, value: list[str]) -> list[str]:
        return [str(ipaddress.ip_network(text)) for text in value]

    @field_validator("database_url")
    @classmethod
    def _a_url(cls, value: str | None) -> str | None:
        from sqlalchemy import make_url
        from sqlalchemy.exc import ArgumentError

        try:
            if value is not None:
                make_url(value).get_dialect()
        except ArgumentError:  # its message may contain the password
            raise ValueError("is not an SQLAlchemy URL of a supported database") from None
        return value

    @property
    def url(self) -> str:
        """Database URL in use."""
        return self.database_url or f"sqlite:///{self.data_dir.resolve() / 'zonemill.db'}"

    @property
    def webhooks_on(self) -> bool:
        """Whether the service sends webhooks."""
        return bool(self.webhook_origins) and self.webhook_secret is not None

    @property
    def threads(self) -> int:
        """Kernel threads of one job."""
        return self.child_threads or max(1, _cores() // self.workers)

    @property
    def max_body_bytes(self) -> int:
        """Largest request body, bytes."""
        return int(self.max_body_mb * 1_000_000)


AnySettings = TypeVar("AnySettings", bound=MemorySettings)


def settings_of(kind: type[AnySettings], given: dict[str, Any]) -> AnySettings:
    """Settings from the environment, overridden by those given in code; None is not given.

    Raises
    ------
    SetupError
        bad_setting: a setting has an invalid value.
    """
    from service.from_wire import problems_of

    try:
        return kind(**{k: v for k, v in given.items() if v is not None})
    except SettingsError as error:
        raise SetupError(f"the environment: {error}; the value must be JSON", code="bad_setting",
                         remedy="docs/settings.md lists every setting") from None
    except ValidationError as error:
        problems = problems_of(error, "settings")
        raise SetupError(f"setting {problems[0]['at']}: {problems[0]['problem']}", code="bad_setting",
                         subjects=tuple(p["at"] for p in problems), measured=problems,
                         remedy="docs/settings.md lists every setting") from None


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address.

    >>> is_loopback("127.0.0.1"), is_loopback("::1"), is_loopback("0.0.0.0")
    (True, True, False)
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
