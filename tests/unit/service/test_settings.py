"""Every setting is documented, and the dangerous combination is refused."""

from pathlib import Path

import pytest

from geometry.errors import SetupError
from service.api.server import settings_with
from service.jobs.api_keys import KeyStore
from service.jobs.database import connect, migrate
from service.jobs.engine import Engine
from service.settings import Settings, is_loopback

PAGE = Path(__file__).resolve().parents[3] / "docs" / "settings.md"


def test_every_setting_stands_in_the_page_with_its_meaning():
    text = PAGE.read_text()
    lines = [line for line in text.splitlines() if line.startswith("| `ZONEMILL_")]
    rows = {line.split("|")[1].strip().strip("`"): line for line in lines}
    assert set(rows) == {f"ZONEMILL_{name.upper()}" for name in Settings.model_fields}
    for name, field in Settings.model_fields.items():
        row = rows[f"ZONEMILL_{name.upper()}"]
        assert field.description and field.description.split(";")[0].rstrip(".") in row, name


def test_the_environment_is_read(monkeypatch, tmp_path):
    monkeypatch.setenv("ZONEMILL_PORT", "9001")
    monkeypatch.setenv("ZONEMILL_WEBHOOK_SECRET", "")  # set to nothing is not set: a compose file passes all on
    found = Settings(data_dir=tmp_path)
    assert found.webhook_secret is None
    assert found.port == 9001
    assert found.url == f"sqlite:///{tmp_path}/zonemill.db"


@pytest.mark.parametrize(("host", "refused"), [("127.0.0.1", False), ("::1", False), ("localhost", False),
                                               ("0.0.0.0", True), ("10.0.0.7", True), ("example.org", True)])
def test_beyond_loopback_a_key_is_needed(host, refused, tmp_path):
    assert is_loopback(host) is not refused
    engine = Engine(Settings(host=host, data_dir=tmp_path), "none")
    migrate(engine.settings.url)
    engine.keys = KeyStore(connect(engine.settings.url))
    if not refused:
        engine._check_exposure()
        return
    with pytest.raises(SetupError, match="no valid key") as caught:
        engine._check_exposure()
    assert caught.value.code == "exposed_without_key"
    told = Engine(Settings(host=host, data_dir=tmp_path, auth="keys"), "none")
    told.keys = engine.keys
    told._check_exposure()  # it starts, and lets nobody in
    _, row = engine.keys.make("ada", ["read"], days=1)
    engine._check_exposure()
    engine.keys.revoke(row["id"])
    with pytest.raises(SetupError):
        engine._check_exposure()


@pytest.mark.parametrize(("name", "value"), [("ZONEMILL_AUTH", "off"), ("ZONEMILL_POST_RATE", "often"),
                                             ("ZONEMILL_POST_RATE", "0/minute"), ("ZONEMILL_PORT", "http"),
                                             ("ZONEMILL_DATABASE_URL", "nowhere"),
                                             ("ZONEMILL_DATABASE_URL", "nosuch://u:hidden@host/db")])
def test_a_setting_that_makes_no_sense_is_named(name, value, monkeypatch):
    monkeypatch.setenv(name, value)
    with pytest.raises(SetupError) as caught:
        settings_with({})
    assert caught.value.code == "bad_setting" and caught.value.remedy
    assert name.removeprefix("ZONEMILL_").lower() in str(caught.value) and "hidden" not in str(caught.value)


def test_the_threads_of_a_job_follow_the_workers():
    cores = Settings(workers=1).threads
    assert Settings(workers=1000).threads == 1 and cores >= 1
    assert Settings(workers=1000, child_threads=3).threads == 3
