"""Jobs in the database. Every change is one guarded statement, so of two writers only one succeeds.

States: queued -> running -> proved | unproved | done | failed, and cancelled from queued or running. A running job
belongs to the holder of its lease. A job whose lease has expired may be claimed again while attempts are left. A claim
hands it to the workers. An attempt counts from its start on a worker, so waiting for one costs none.
"""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine, RowMapping
from sqlalchemy.exc import IntegrityError
from sqlalchemy.sql.dml import ReturningInsert

from geometry.errors import CamError, ResourceError
from schemas.jobs import FINAL_STATES
from service.errors import KeyConflictError, NotFoundError, RateError
from service.jobs.database import jobs, labels

MAX_LEASES_AHEAD = 10  # a lease that ends later means that the clock was set back
WORKER = "worker-"  # prefix of the holders that have started an attempt
CLAIM_LOCK = 0x7A6F6E66  # our number of a PostgreSQL advisory lock


@dataclass(frozen=True)
class NewJob:
    """The data of a submission."""

    kind: str
    principal: str
    content_sha256: str
    part_sha256: str
    setup_sha256: str
    setup_json: str
    labels: dict[str, str]
    program_sha256: str | None = None
    spindle_tool: int = 0
    idempotency_key: str | None = None
    stock_sha256: str | None = None
    deadline_s: float | None = None
    webhook_url: str | None = None
    library_json: str | None = None


@dataclass(frozen=True)
class Room:
    """Largest number of waiting jobs: in total, and of one principal."""

    total: int
    each: int


def new_id() -> str:
    """A job id that sorts by time of creation (microseconds) and cannot be guessed."""
    return f"j{time.time_ns() // 1000:014x}{secrets.token_hex(9)}"


class JobStore:
    """The job table."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine

    def create(self, new: NewJob, room: Room | None = None) -> tuple[RowMapping, bool]:
        """Queue a job, or find the one that this Idempotency-Key already made.

        Returns the row and whether it is new.

        Raises
        ------
        KeyConflictError
            The principal used the key before for other content or another kind of job.
        RateError
            The queue is full (codes 'queue_full', 'your_queue_full').

        Notes
        -----
        The inserting statement itself checks for room. SQLite runs one such statement at a time, so the limit is exact.
        PostgreSQL may accept one more job for every other that is posted at the same instant.
        """
        now = time.time()
        values = {
            "id": new_id(), "kind": new.kind, "principal": new.principal, "idempotency_key": new.idempotency_key,
            "content_sha256": new.content_sha256, "part_sha256": new.part_sha256, "setup_sha256": new.setup_sha256,
            "program_sha256": new.program_sha256, "stock_sha256": new.stock_sha256,
            "spindle_tool": new.spindle_tool, "setup_json": new.setup_json, "labels_json": json.dumps(new.labels),
            "state": "queued", "stage": "queued", "progress": 0.0,
            "event_seq": 1, "attempt": 0, "created": now,
            "deadline": None if new.deadline_s is None else now + new.deadline_s,
            "webhook_url": new.webhook_url, "webhook_state": "pending" if new.webhook_url else None,
            "webhook_due": 0.0 if new.webhook_url else None, "webhook_attempts": 0,
            "library_json": new.library_json,
        }
        found = None
        while found is None:
            try:
                with self.engine.begin() as c:
                    made = c.execute(_insert_where(values, _has_room(new.principal, room))).mappings().one_or_none()
                    if made is not None and new.labels:
                        c.execute(labels.insert(), [{"job_id": made["id"], "key": k, "value": v}
                                                    for k, v in new.labels.items()])
                if made is not None:
                    return made, True
                found = self._by_key(new.principal, new.idempotency_key)
                if found is None:
                    raise self.no_room(new.principal, room)
            except IntegrityError:
                found = self._by_key(new.principal, new.idempotency_key)
                if found is None and new.idempotency_key is None:
                    raise
                # None: the job with this key has just expired, so the key is free again
        if found["kind"] != new.kind:
            raise KeyConflictError(
                f"the Idempotency-Key belongs to job {found['id']} of kind {found['kind']}, not {new.kind}",
                subjects=(found["id"],), measured=new.kind, limit=found["kind"],
                remedy="use a new key for each kind of job")
        if found["content_sha256"] != new.content_sha256:
            raise KeyConflictError(
                f"the Idempotency-Key belongs to job {found['id']}, which has other content",
                subjects=(found["id"],), measured=new.content_sha256, limit=found["content_sha256"],
                remedy="use a new key for new content")
        return found, False

    def check_room(self, principal: str, key: str | None, room: Room) -> None:
        """Refuse early what ``create`` would refuse, so that no file is read in vain.

        A known key passes, since its repeat is answered whether there is room or not.

        Raises
        ------
        RateError
            As ``create``.
        """
        with self.engine.connect() as c:
            free = c.execute(sa.select(_has_room(principal, room))).scalar_one()
        if not free and (key is None or self._by_key(principal, key) is None):
            raise self.no_room(principal, room)

    def no_room(self, principal: str, room: Room | None) -> RateError:
        """The error for a full queue; it names the limit that is reached."""
        assert room is not None
        with self.engine.connect() as c:
            own = c.execute(sa.select(_waiting(principal))).scalar_one()
        if own >= room.each:
            return RateError(f"{own} of your jobs are already waiting", code="your_queue_full", measured=own,
                             limit=room.each, remedy="wait until some have ended, or cancel some")
        return RateError(f"{room.total} jobs are already waiting", code="queue_full", limit=room.total,
                         remedy="wait until some have ended")

    def mean_run_s(self, of: int = 20) -> float | None:
        """Mean run time of the jobs that ended last, s; None before any has ended."""
        took = (sa.select((jobs.c.finished - jobs.c.started).label("s"))
                .where(jobs.c.finished.is_not(None), jobs.c.started.is_not(None), jobs.c.artifact.is_not(None))
                .order_by(jobs.c.id.desc()).limit(of).subquery())
        with self.engine.connect() as c:
            found = c.execute(sa.select(sa.func.avg(took.c.s))).scalar_one()
        return None if found is None else max(0.0, float(found))

    def _by_key(self, principal: str, key: str | None) -> RowMapping | None:
        if key is None:
            return None
        query = sa.select(jobs).where(jobs.c.principal == principal, jobs.c.idempotency_key == key)
        with self.engine.connect() as c:
            return c.execute(query).mappings().one_or_none()

    def get(self, job_id: str, principal: str | None = None) -> RowMapping:
        """One job; only of that principal where one is given.

        Raises
        ------
        NotFoundError
            There is no such job.
        """
        query = sa.select(jobs).where(jobs.c.id == job_id)
        if principal is not None:
            query = query.where(jobs.c.principal == principal)
        row = None
        if len(job_id) <= 40 and job_id.isascii() and job_id.isalnum():  # PostgreSQL refuses NUL in text
            with self.engine.connect() as c:
                row = c.execute(query).mappings().one_or_none()
        if row is None:
            raise NotFoundError(f"unknown job {job_id[:80]}", code="no_such_job", subjects=(job_id,),
                                remedy="GET /v1/jobs lists your jobs")
        return row

    def page(self, principal: str, *, limit: int, before: str | None = None, state: str | None = None,
             kind: str | None = None, labelled: Iterable[tuple[str, str]] = (), since: float | None = None,
             until: float | None = None) -> list[RowMapping]:
        """Up to ``limit`` jobs of a principal, newest first, older than the job ``before``.

        labelled     : labels that must all match;  since, until : time of posting, s; ``until`` is excluded
        """
        query = sa.select(jobs).where(jobs.c.principal == principal).order_by(jobs.c.id.desc()).limit(limit)
        for column, value in ((jobs.c.state, state), (jobs.c.kind, kind)):
            if value is not None:
                query = query.where(column == value)
        for key, value in labelled:
            query = query.where(jobs.c.id.in_(sa.select(labels.c.job_id).where(labels.c.key == key,
                                                                                labels.c.value == value)))
        if before is not None:
            query = query.where(jobs.c.id < before)
        if since is not None:
            query = query.where(jobs.c.created >= since)
        if until is not None:
            query = query.where(jobs.c.created < until)
        with self.engine.connect() as c:
            return list(c.execute(query).mappings())

    def claim(self, owner: str, lease_s: float, max_attempts: int, lease_grace_s: float = 0.0,
              slots: int | None = None) -> RowMapping | None:
        """Take the oldest job that waits, or whose holder is silent; None when there is none.

        lease_grace_s : s that a lease must have been expired; holders could not renew while the database did not answer
        slots : no job is taken when so many run already; services that claim at the same time wait for each other
        """
        now = time.time()
        expired = sa.and_(jobs.c.state == "running", _silent(now, lease_s, lease_grace_s))
        oldest = (sa.select(jobs.c.id).where(sa.or_(jobs.c.state == "queued", expired), jobs.c.attempt < max_attempts)
                  .order_by(jobs.c.id).limit(1).with_for_update(skip_locked=True).scalar_subquery())
        room = sa.true() if slots is None else _count_running(now, lease_s, lease_grace_s).scalar_subquery() < slots
        change = (jobs.update().where(jobs.c.id == oldest, sa.or_(jobs.c.state == "queued", expired), room)
                  .values(state="running", stage="starting", progress=0.0, claims=jobs.c.claims + 1,
                          event_seq=jobs.c.event_seq + 1, lease_owner=owner, lease_until=now + lease_s)
                  .returning(jobs))
        with self.engine.begin() as c:
            if slots is not None and c.dialect.name == "postgresql":
                c.execute(sa.select(sa.func.pg_advisory_xact_lock(CLAIM_LOCK)))
            return c.execute(change).mappings().one_or_none()

    def start(self, job_id: str, claim: int, owner: str, lease_s: float, max_attempts: int) -> bool:
        """Begin an attempt of a claimed job. False when it was claimed again, has ended, or has no attempt left.

        claim : number of the claim, ``row["claims"]``. The same claim may start again after its worker died.
        """
        now = time.time()
        return self._change(
            sa.and_(jobs.c.id == job_id, jobs.c.claims == claim, jobs.c.state == "running",
                    jobs.c.attempt < max_attempts),
            attempt=jobs.c.attempt + 1, lease_owner=owner, lease_until=now + lease_s, started=now, resumed_json=None)

    def take_over(self, job_id: str, claim: int, owner: str, lease_s: float) -> bool:
        """Make ``owner`` the holder of that claim; False when the job was claimed again or has ended."""
        return self._change(
            sa.and_(jobs.c.id == job_id, jobs.c.claims == claim, jobs.c.state == "running"),
            lease_owner=owner, lease_until=time.time() + lease_s)

    def renew(self, job_id: str, owner: str, lease_s: float) -> bool:
        """Heartbeat: keep the lease; False when the job was cancelled or belongs to another holder."""
        return self._change(self._held(job_id, owner), lease_until=time.time() + lease_s)

    def is_held(self, job_id: str, owner: str) -> bool:
        """Whether the job still runs and belongs to ``owner``."""
        with self.engine.connect() as c:
            return c.execute(sa.select(jobs.c.id).where(self._held(job_id, owner))).first() is not None

    def progress(self, job_id: str, owner: str, stage: str, fraction: float) -> bool:
        """Record stage and progress of the holder; this also counts as a heartbeat."""
        return self._change(self._held(job_id, owner), stage=stage[:200], progress=min(max(fraction, 0.0), 1.0),
                            event_seq=jobs.c.event_seq + 1)

    def resumed(self, job_id: str, owner: str, taken: Mapping[str, int]) -> bool:
        """Record the checkpoints that the newest attempt used, by kind; the next event contains them."""
        return self._change(self._held(job_id, owner), resumed_json=json.dumps(dict(taken)),
                            event_seq=jobs.c.event_seq + 1)

    def estimated(self, job_id: str, owner: str, estimate: Mapping[str, Any]) -> bool:
        """Record what the job is expected to take; the next event contains it."""
        return self._change(self._held(job_id, owner), estimate_json=json.dumps(dict(estimate)),
                            event_seq=jobs.c.event_seq + 1)

    def finish(self, job_id: str, owner: str, state: str, *, artifact: str | None = None,
               error: CamError | None = None, summary: dict[str, Any] | None = None) -> bool:
        """End a job that ``owner`` holds; False when it was cancelled or taken over meanwhile."""
        values: dict[str, Any] = {"progress": 1.0} if state != "failed" else {}
        values["summary_json"] = json.dumps(summary) if summary else None
        return self._change(self._held(job_id, owner), state=state, stage=state, artifact=artifact,
                            error_json=json.dumps(error.as_dict()) if error else None, finished=time.time(),
                            event_seq=jobs.c.event_seq + 1, lease_owner=None, lease_until=None, **values)

    def cancel(self, job_id: str) -> bool:
        """Cancel a job that has not ended; its holder notices at the next check."""
        return self._change(sa.and_(jobs.c.id == job_id, jobs.c.state.in_(("queued", "running"))),
                            state="cancelled", stage="cancelled", finished=time.time(), lease_owner=None,
                            lease_until=None, event_seq=jobs.c.event_seq + 1)

    def release(self) -> int:
        """Let every lease expire now; only for the sole owner of the database, after a restart."""
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(jobs.c.state == "running").values(lease_until=0.0)).rowcount

    def disown(self) -> int:
        """Put every running job back into the queue without counting the attempt, for an orderly stop.

        Only for the sole owner of the database. Holders notice the loss of the job and stop their child processes.
        """
        begun = sa.case((jobs.c.lease_owner.startswith(WORKER), 1), else_=0)
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(jobs.c.state == "running").values(
                state="queued", stage="queued", progress=0.0, attempt=jobs.c.attempt - begun, lease_owner=None,
                lease_until=None, event_seq=jobs.c.event_seq + 1)).rowcount

    def hand_back(self, owner: str) -> int:
        """Put the jobs back into the queue that ``owner`` claimed and no worker has started; returns their number."""
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(jobs.c.state == "running", jobs.c.lease_owner == owner).values(
                state="queued", stage="queued", progress=0.0, lease_owner=None, lease_until=None,
                event_seq=jobs.c.event_seq + 1)).rowcount

    def put_back(self, job_id: str, owner: str, counts: bool = True) -> bool:
        """Put a job that ``owner`` holds back into the queue; counts : whether that was an attempt."""
        return self._change(self._held(job_id, owner), state="queued", stage="queued", progress=0.0, lease_owner=None,
                            lease_until=None, attempt=jobs.c.attempt - (0 if counts else 1),
                            event_seq=jobs.c.event_seq + 1)

    def miss_deadlines(self) -> int:
        """Fail the jobs whose deadline has passed; holders notice the loss and stop their child processes."""
        now = time.time()
        error = ResourceError("the job did not end before its deadline and was stopped", code="deadline_exceeded",
                              remedy="set a longer deadline_s, or post the job when fewer jobs wait")
        late = sa.and_(jobs.c.state.in_(("queued", "running")), jobs.c.deadline < now)
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(late).values(
                state="failed", stage="failed", finished=now, error_json=json.dumps(error.as_dict()),
                lease_owner=None, lease_until=None, event_seq=jobs.c.event_seq + 1)).rowcount

    def give_up(self, max_attempts: int, lease_s: float, lease_grace_s: float = 0.0) -> int:
        """Fail the jobs whose holder is silent in their last attempt; lease_s and lease_grace_s as for ``claim``.

        It also fails waiting jobs without an attempt left, as after ``max_attempts`` was lowered: nobody would claim
        them.
        """
        error = ResourceError(f"the job was started {max_attempts} times and its process was lost each time",
                              code="attempts_exhausted", measured=max_attempts, limit=max_attempts,
                              remedy="see the log of the service; the job may need more memory than the machine has")
        silent = sa.and_(jobs.c.state == "running", _silent(time.time(), lease_s, lease_grace_s))
        gone = sa.and_(sa.or_(jobs.c.state == "queued", silent), jobs.c.attempt >= max_attempts)
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(gone).values(
                state="failed", stage="failed", finished=time.time(), error_json=json.dumps(error.as_dict()),
                lease_owner=None, lease_until=None, event_seq=jobs.c.event_seq + 1)).rowcount

    def claim_webhook(self, lease_s: float) -> RowMapping | None:
        """Take a due webhook of an ended job for one attempt; if it is not settled, it is due again after the lease."""
        now = time.time()
        due = sa.and_(jobs.c.webhook_state == "pending", jobs.c.webhook_due <= now, jobs.c.state.in_(FINAL_STATES))
        first = (sa.select(jobs.c.id).where(due).order_by(jobs.c.webhook_due, jobs.c.id).limit(1)
                 .with_for_update(skip_locked=True).scalar_subquery())
        change = (jobs.update().where(jobs.c.id == first, due)
                  .values(webhook_due=now + lease_s, webhook_attempts=jobs.c.webhook_attempts + 1).returning(jobs))
        with self.engine.begin() as c:
            return c.execute(change).mappings().one_or_none()

    def settle_webhook(self, job_id: str, attempt: int, state: str, problem: str | None = None,
                       due: float | None = None) -> bool:
        """Record the outcome of an attempt; False when a later attempt has begun."""
        return self._change(sa.and_(jobs.c.id == job_id, jobs.c.webhook_attempts == attempt), webhook_state=state,
                            webhook_due=due, webhook_problem=problem and problem[:200])

    def expire(self, job_id: str) -> bool:
        """Give up the files of an ended job; its Idempotency-Key is free again."""
        return self._change(sa.and_(jobs.c.id == job_id, _ended()), **_expired_values())

    def expire_before(self, ended: float) -> int:
        """The same for every job that ended before a time, s; returns their number."""
        with self.engine.begin() as c:
            old = jobs.update().where(_ended(), jobs.c.finished < ended)
            return c.execute(old.values(**_expired_values())).rowcount

    def files_named(self) -> set[str]:
        """Hashes of every upload and result that a job needs."""
        columns = (jobs.c.part_sha256, jobs.c.stock_sha256, jobs.c.program_sha256, jobs.c.artifact)
        named: set[str] = set()
        with self.engine.connect() as c:
            for row in c.execute(sa.select(*columns).where(jobs.c.expired.is_(None))):
                named.update(filter(None, row))
        return named

    def unfinished(self) -> list[RowMapping]:
        """Every job that waits or runs, with the columns that name its result (``service.jobs.artifacts.key_of``)."""
        columns = (jobs.c.kind, jobs.c.part_sha256, jobs.c.setup_sha256, jobs.c.program_sha256, jobs.c.spindle_tool,
                   jobs.c.stock_sha256)
        with self.engine.connect() as c:
            return list(c.execute(sa.select(*columns).where(jobs.c.state.in_(("queued", "running")))).mappings())

    def webhook_counts(self) -> dict[str, int]:
        """Number of webhooks by state."""
        query = sa.select(jobs.c.webhook_state, sa.func.count()).where(jobs.c.webhook_state.is_not(None))
        with self.engine.connect() as c:
            return {state: count for state, count in c.execute(query.group_by(jobs.c.webhook_state))}

    def running(self, lease_s: float = 1e9, lease_grace_s: float = 0.0) -> int:
        """Number of jobs that run under a valid lease; lease_s and lease_grace_s as for ``claim``."""
        with self.engine.connect() as c:
            return int(c.execute(_count_running(time.time(), lease_s, lease_grace_s)).scalar_one())

    def counts(self) -> dict[str, int]:
        """Number of jobs by state."""
        with self.engine.connect() as c:
            rows = c.execute(sa.select(jobs.c.state, sa.func.count()).group_by(jobs.c.state))
            return {state: count for state, count in rows}

    @staticmethod
    def _held(job_id: str, owner: str) -> sa.ColumnElement[bool]:
        return sa.and_(jobs.c.id == job_id, jobs.c.lease_owner == owner, jobs.c.state == "running")

    def _change(self, where: sa.ColumnElement[bool], **values: Any) -> bool:
        with self.engine.begin() as c:
            return c.execute(jobs.update().where(where).values(**values)).rowcount == 1


def _silent(now: float, lease_s: float, lease_grace_s: float) -> sa.ColumnElement[bool]:
    """Whether the holder is silent: the lease has expired, or ends so late that the clock was set back."""
    latest = now + MAX_LEASES_AHEAD * lease_s + lease_grace_s
    return sa.or_(jobs.c.lease_until < now - lease_grace_s, jobs.c.lease_until > latest)


def _count_running(now: float, lease_s: float, lease_grace_s: float) -> sa.Select[Any]:
    return sa.select(sa.func.count()).select_from(jobs).where(jobs.c.state == "running",
                                                              sa.not_(_silent(now, lease_s, lease_grace_s)))


def _ended() -> sa.ColumnElement[bool]:
    return sa.and_(jobs.c.state.in_(FINAL_STATES), jobs.c.expired.is_(None))


def _expired_values() -> dict[str, Any]:
    """Values of an expired job: owner, times, labels, state, hashes and figures stay; the setup goes with the files."""
    return {"expired": time.time(), "artifact": None, "idempotency_key": None, "setup_json": "{}"}


def _waiting(principal: str | None = None) -> sa.ScalarSelect[int]:
    """Number of waiting jobs, of a principal or in total."""
    query = sa.select(sa.func.count()).select_from(jobs).where(jobs.c.state == "queued")
    return (query if principal is None else query.where(jobs.c.principal == principal)).scalar_subquery()


def _has_room(principal: str, room: Room | None) -> sa.ColumnElement[bool]:
    return sa.true() if room is None else sa.and_(_waiting() < room.total, _waiting(principal) < room.each)


def _insert_where(values: dict[str, Any], condition: sa.ColumnElement[bool]) -> ReturningInsert[Any]:
    """Insert a job if a condition holds; returns the row or nothing. The casts give PostgreSQL the types of parameters.
    """
    columns = [jobs.c[name] for name in values]
    row = sa.select(*(sa.cast(sa.literal(values[c.name], c.type), c.type) for c in columns)).where(condition)
    return jobs.insert().from_select(columns, row).returning(jobs)
