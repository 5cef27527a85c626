"""Import and export of tool libraries over HTTP."""

from __future__ import annotations

import json
import time

import pytest

from service.api.routes.tool_libraries import Encoding, ReadFormat, WrittenFormat
from service.libraries.containers import ENCODINGS
from service.libraries.registry import READ, WRITTEN
from tests.unit.service.test_cli import STEP

TABLE = """id,kind,diameter_mm,corner_radius_mm,flutes,flute_length_mm,shank_diameter_mm,stickout_mm,number,cutting_data
EM-1,flat,6,0,3,18,6,40,1,Ti-6Al-4V|3000|240|80
EM-2,ball,3,,2,9,6,36,2,
EM-3,lollipop mill,3,,2,9,6,36,3,
"""


@pytest.fixture
def client(make_client):
    """A service without any tools."""
    return make_client()


def post(client, text, headers=None, **query):
    data = text if isinstance(text, bytes) else text.encode()
    return client.post("/v1/tools:import", params=query, files={"library": ("lib.csv", data)}, headers=headers)


def test_a_dry_run_stores_nothing_and_an_import_stores_what_it_showed(client):
    dry = post(client, TABLE, dry_run=True).json()
    assert (dry["format"], dry["dry_run"], dry["taken"], dry["noted"], dry["left_out"]) == ("csv", True, 2, 0, 1)
    assert client.get("/v1/tools").json()["items"] == []
    assert [(e["place"], e["verdict"], e["name"], e["version"]) for e in dry["entries"]] == [
        ("row 2", "taken", "EM-1", None), ("row 3", "taken", "EM-2", None), ("row 4", "left_out", None, None)]
    assert dry["entries"][2]["reason"] == "kind 'lollipop mill' is not available"
    real = post(client, TABLE).json()
    assert [e["version"] for e in real["entries"]] == [1, 1, None]
    assert [e["tool"] for e in real["entries"]] == [e["tool"] for e in dry["entries"]]
    assert client.get("/v1/tools/EM-1").json()["entry"] == real["entries"][0]["tool"]


def test_a_second_import_writes_versions_of_what_changed_alone(client):
    post(client, TABLE)
    again = post(client, TABLE.replace("EM-2,ball,3,", "EM-2,ball,4,")).json()
    assert [e["version"] for e in again["entries"]] == [1, 2, None]
    client.delete("/v1/tools/EM-1")
    assert [e["version"] for e in post(client, TABLE).json()["entries"]] == [2, 3, None]


def test_a_setup_uses_an_imported_tool(client):
    post(client, TABLE)
    job = client.post("/v1/jobs", files={"part": ("p.step", STEP.encode()),
                                         "setup": ("s.json", json.dumps({"tools": ["lib:EM-1"]}))}).json()
    assert job["library"] == [{"shelf": "tools", "name": "EM-1", "version": 1, "shared": False}]


def test_principals_keep_their_tools_apart(make_client, bearer):
    client = make_client()
    ada, bob = bearer(client, "ada"), bearer(client, "bob")
    assert post(client, TABLE).status_code == 401
    assert post(client, TABLE, headers=ada).status_code == 200
    assert client.get("/v1/tools", headers=bob).json()["items"] == []
    assert client.get("/v1/tools:export?format=csv", headers=bob).json()["code"] == "no_tools"
    assert post(client, TABLE, headers=ada, shared=True).json()["code"] == "scope_missing"
    root = bearer(client, "root", "admin")
    assert post(client, TABLE, headers=root, shared=True).status_code == 200
    assert len(client.get("/v1/tools", headers=bob).json()["items"]) == 2


def test_errors_are_problems_that_name_the_entry(client):
    answer = post(client, "id,kind,diameter\nA,flat,6\n")
    assert answer.status_code == 422 and answer.headers["content-type"] == "application/problem+json"
    assert (answer.json()["code"], answer.json()["subjects"]) == ("unit_missing", ["row 2 'A'"])
    assert post(client, "id,kind,diameter\nA,flat,6\n", unit="in").json()["noted"] == 1
    assert post(client, b"").json()["code"] == "empty_library"
    assert post(client, "x", format="klingon").json()["code"] == "malformed_request"
    assert client.post("/v1/tools:import", json={}).json()["code"] == "not_multipart"
    assert client.post("/v1/tools:import", files={"tools": ("a", b"x")}).json()["code"] == "missing_part"
    assert client.get("/v1/tools:import").status_code == 405


def test_an_export_refuses_to_lose_what_a_format_has_no_place_for(client):
    post(client, TABLE)
    answer = client.get("/v1/tools:export?format=linuxcnc").json()
    assert answer["code"] == "export_loses" and answer["measured"] == {"EM-1": ["cutting_data"]}
    table = client.get("/v1/tools:export?format=linuxcnc&allow_loss=true")
    assert table.text.startswith(";unit=mm\nT1 P1 D6.0 ;") and "tools.tbl" in table.headers["content-disposition"]
    whole = client.get("/v1/tools:export?format=fusion")
    assert whole.status_code == 200 and whole.headers["content-type"] == "application/json"
    again = client.post("/v1/tools:import?dry_run=true", files={"library": ("t.json", whole.content)}).json()
    assert [e["tool"] for e in again["entries"]] == [e["entry"] for e in client.get("/v1/tools").json()["items"]]
    one = client.get("/v1/tools:export?format=csv&name=EM-2").text
    assert "EM-2" in one and "EM-1" not in one
    assert client.get("/v1/tools:export?format=csv&name=none").json()["code"] == "no_such_entry"


@pytest.mark.slow
def test_ten_thousand_tools_are_stored_in_one_go(client):
    rows = "".join(f"T{k},flat,{6 + k / 1e4:.4f}\n" for k in range(1, 10_001))
    started = time.monotonic()
    answer = post(client, "id,kind,diameter_mm\n" + rows).json()
    assert (answer["noted"], answer["entries"][-1]["version"]) == (10_000, 1)
    assert time.monotonic() - started < 120.0


def test_the_words_of_the_routes_are_the_formats_that_there_are():
    assert set(ReadFormat.__args__) == set(READ) and set(WrittenFormat.__args__) == set(WRITTEN)
    assert set(Encoding.__args__) == set(ENCODINGS)
