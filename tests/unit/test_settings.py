"""Every setting is documented, and the dangerous combination is refused."""

from pathlib import Path

import pytest

from geometry.errors import SetupError
from service.settings import Settings, is_loopback

PAGE = Path(__file__).resolve().parents[2] / "docs" / "settings.md"


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
    monkeypatch.setenv("ZONEMILL_TOKENS", '{"ada": "secret"}')
    found = Settings(data_dir=tmp_path)
    assert found.port == 9001 and found.tokens["ada"].get_secret_value() == "secret" and "secret" not in repr(found)
    assert found.url == f"sqlite:///{tmp_path}/zonemill.db"


@pytest.mark.parametrize(("host", "refused"), [("127.0.0.1", False), ("::1", False), ("localhost", False),
                                               ("0.0.0.0", True), ("10.0.0.7", True), ("example.org", True)])
def test_beyond_loopback_a_token_is_needed(host, refused, monkeypatch):
    monkeypatch.delenv("ZONEMILL_TOKENS", raising=False)
    assert is_loopback(host) is not refused
    if refused:
        with pytest.raises(SetupError, match="bearer token"):
            Settings(host=host).check_exposure()
        Settings(host=host, insecure=True).check_exposure()
        Settings(host=host, tokens={"a": "b"}).check_exposure()
    else:
        Settings(host=host).check_exposure()
