"""Connections: what is told of a database that fails, how long one is waited for, and who brings it up to date."""

import json
import socket
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
import sqlalchemy as sa
import structlog
from sqlalchemy.exc import IntegrityError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

import service.jobs.database
from service.jobs.attempt import WorkConfig, _Attempt, run_job
from service.jobs.database import AWAY, connect, migrate
from service.jobs.job_store import JobStore, NewJob
from service.jobs.supervisor import ProcessLimits
from service.logs import configure
from tests.time_limits import in_time


def test_what_the_database_raises_holds_no_values(tmp_path):
    url = f"sqlite:///{tmp_path / 'x.db'}"
    migrate(url)
    store = JobStore(connect(url))
    new = NewJob("plan", "p", "c", "a" * 64, "b" * 64, '{"secret": "of a customer"}', {},
                 webhook_url="https://mes.example.com/hook?token=hunter2")
    job = store.create(new)[0]
    with pytest.raises(IntegrityError) as caught, store.engine.begin() as c:
        c.execute(service.jobs.database.jobs.insert().values(dict(job)))
    assert "hunter2" not in str(caught.value) and "customer" not in str(caught.value)
    with store.engine.begin() as c:
        c.exec_driver_sql("DROP TABLE jobs")
    with pytest.raises(OperationalError) as away:
        store.create(new)
    assert "hunter2" not in str(away.value) and "customer" not in str(away.value)


def test_a_server_that_says_nothing_is_given_up_soon(monkeypatch):
    pytest.importorskip("psycopg")
    monkeypatch.setitem(service.jobs.database.POSTGRES, "connect_timeout", 2)
    assert service.jobs.database.POSTGRES["tcp_user_timeout"] <= 30_000
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"postgresql+psycopg://zonemill@127.0.0.1:{silent.getsockname()[1]}/zonemill"
        started = time.monotonic()
        with pytest.raises(OperationalError):
            connect(url).connect()
    assert in_time(time.monotonic() - started, 10)


def test_a_worker_logs_as_the_service_does_and_shows_no_variables(tmp_path, capfd):
    url = f"sqlite:///{tmp_path / 'x.db'}"
    migrate(url)
    job = JobStore(connect(url)).create(NewJob("plan", "p", "c", "a" * 64, "b" * 64, "{}", {}))[0]["id"]
    config = WorkConfig(url, str(tmp_path), ProcessLimits(1, 1), 20.0, log_format="json")
    structlog.reset_defaults()  # as in the process of a worker
    try:
        assert run_job(job, 1, config.as_dict()) == "unfit"  # the folder has no such part
        hidden = "of a customer"
        try:
            raise KeyError("a bug")
        except KeyError:
            structlog.get_logger("x").exception("bug in the worker")
        said, line = capfd.readouterr()
        told = [json.loads(each) for each in line.splitlines()]
        assert not said and told[-1]["event"] == "bug in the worker" and hidden not in line
    finally:
        configure("error", "console")


def test_no_free_connection_is_a_database_that_is_away_and_stops_no_job():
    def busy(*_, **__):
        raise PoolTimeoutError("QueuePool limit of size 5 overflow 10 reached")

    store = SimpleNamespace(is_held=busy, renew=busy, progress=busy, resumed=busy)
    config = WorkConfig("", "", ProcessLimits(1, 1), 20.0)
    attempt = _Attempt(store, None, config, {"id": "j", "attempt": 1}, "worker-1")
    assert attempt._keep() is True
    attempt._progress("asleep", 0.5)
    attempt._resumed({})
    assert isinstance(PoolTimeoutError("x"), AWAY)


def test_processes_that_start_at_the_same_time_wait_for_each_other(tmp_path):
    url = f"sqlite:///{tmp_path / 'data' / 'x.db'}"
    code = f"from service.jobs.database import migrate; import sys; sys.stdin.read(); migrate({url!r})"
    started = [subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stderr=subprocess.PIPE)
               for _ in range(3)]
    said = []
    for each in started:
        each.stdin.close()
        each.stdin = None
    for each in started:
        said.append(each.communicate(timeout=60)[1])
    assert [each.returncode for each in started] == [0, 0, 0], said
    assert "jobs" in sa.inspect(connect(url)).get_table_names()
