"""docker-compose.yml and Dockerfile, checked without a Docker engine."""

import re
import subprocess
import sys

import pytest
import yaml

from tests.source_tree import PACKAGES, ROOT


@pytest.fixture(scope="module")
def compose():
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text())


def test_it_is_a_compose_file():
    got = subprocess.run([sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec",
                          str(ROOT / "docker-compose.yml")], capture_output=True, text=True)
    assert got.returncode == 0, got.stdout + got.stderr


def test_only_the_api_is_published_and_only_on_loopback(compose):
    ports = {name: s.get("ports", []) for name, s in compose["services"].items()}
    assert {n for n, p in ports.items() if p} == {"api"}
    assert all(p.startswith("127.0.0.1:") for p in ports["api"])
    assert compose["networks"]["inside"]["internal"] is True
    assert compose["services"]["scheduler"]["networks"] == ["inside"]


def test_everything_comes_back_and_says_how_it_is(compose):
    for name, service in compose["services"].items():
        assert service["restart"] == "unless-stopped", name
        assert service["healthcheck"]["test"][0] in ("CMD", "CMD-SHELL"), name
    assert {"api", "worker", "scheduler", "postgres"} == set(compose["services"])


def test_containers_write_to_their_volumes_alone_and_gain_no_rights(compose):
    for name in ("api", "worker", "scheduler"):
        service = compose["services"][name]
        assert service["read_only"] is True and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"] and service["init"] is True
        assert [m.split(":")[0] for m in service["tmpfs"]] == ["/tmp"]
        assert {v.split(":")[0] for v in service["volumes"]} <= set(compose["volumes"])
    assert compose["services"]["postgres"]["security_opt"] == ["no-new-privileges:true"]
    assert compose["services"]["api"]["environment"]["ZONEMILL_AUTH"] == "keys"
    assert {"ZONEMILL_WEBHOOK_SECRET", "ZONEMILL_WEBHOOK_SECRET_BEFORE"} <= set(
        compose["services"]["api"]["environment"])


def test_every_setting_it_names_is_one():
    from service.settings import Settings

    text = (ROOT / "docker-compose.yml").read_text()
    named = set(re.findall(r"ZONEMILL_[A-Z_]+(?=:)", text))
    assert len(named) > 6 and named <= {f"ZONEMILL_{n.upper()}" for n in Settings.model_fields}


def test_no_password_or_token_is_written_down(compose):
    for service in compose["services"].values():
        for key, value in service["environment"].items():
            if "PASSWORD" in key or "TOKEN" in key:
                assert value.startswith("${") and ":?" in value


def dockerfile() -> list[list[str]]:
    """Lines of the Dockerfile, continued ones joined, one list a stage."""
    stages: list[list[str]] = []
    for line in (ROOT / "Dockerfile").read_text().replace("\\\n", " ").splitlines():
        if line.startswith("FROM "):
            stages.append([])
        if line and not line.startswith("#"):
            stages[-1].append(" ".join(line.split()))
    return stages


def copied(stage: list[str]) -> list[str]:
    """What a stage copies out of the checkout."""
    return [source for line in stage if line.startswith("COPY ") and "--from" not in line
            for source in line.split()[1:-1]]


def test_the_image_runs_as_a_user_without_rights():
    last = dockerfile()[-1]
    assert last[0].startswith("FROM python:3.11-slim")
    assert [line for line in last if line.startswith("USER ")] == ["USER zonemill"]


def test_the_image_copies_files_that_exist_and_that_docker_is_given():
    left_out = [line.rstrip("/") for line in (ROOT / ".dockerignore").read_text().splitlines()]
    sources = [source for stage in dockerfile() for source in copied(stage)]
    assert len(sources) > 12
    for source in sources:
        assert (ROOT / source).exists(), f"the Dockerfile copies {source}, which does not exist"
        assert source not in left_out and source.split("/")[0] not in left_out, source


def test_the_image_holds_every_package_of_the_product():
    assert set(PACKAGES) <= set(copied(dockerfile()[-1]))


def test_the_image_installs_the_runtime_lock_and_nothing_beside_it():
    last = dockerfile()[-1]
    installs = [line for line in last if line.startswith("RUN pip install")]
    assert installs == ["RUN pip install --no-deps --requirement requirements-runtime.lock",
                        "RUN pip install --no-deps --editable ."]
    assert {s for s in copied(last) if s.endswith(".lock")} == {"requirements-runtime.lock"}
