"""Bad input over HTTP: status, problem type, and nothing left behind."""

import json
import runpy
from pathlib import Path

import pytest

STEP = runpy.run_path(str(Path(__file__).parent / "fakes" / "step_text.py"))["STEP"]
TOOL = {"id": "T1", "kind": "ball", "diameter_mm": 3}


def _is_problem(answer, status, code):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert (body["status"], body["code"]) == (status, code), body
    assert body["type"].startswith("urn:zonemill:problem:") and body["type"].endswith(f":{code}")
    assert body["title"] and body["detail"] and body["remedy"] and body["request_id"] == answer.headers["x-request-id"]
    return body


@pytest.mark.parametrize(("setup", "at"), [
    ({}, "tools"), ({"tools": []}, "tools"),
    ({"tools": [{**TOOL, "diameter_mm": -3}]}, "tools[0].diameter_mm"),
    ({"tools": [{**TOOL, "flute_length_mm": 30, "neck_length_mm": 10}]}, "tools[0]"),
    ({"tools": [TOOL], "unit": "inch"}, "unit"),
    ({"tools": [{**TOOL, "diameter_in": 0.1}]}, "tools[0].diameter_in"),
    ({"tools": [{**TOOL, "diameter_mm": "3 mm"}]}, "tools[0].diameter_mm"),
    ({"tools": [TOOL], "quality": {"scallop_height_mm": 2}}, "setup"),
    ({"tools": ["lib:none"]}, "tools[0]"),
    ([], "setup")])
def test_a_wrong_setup_is_refused_at_once_with_the_place(client, post, setup, at):
    before = client.get("/v1/jobs?limit=200").json()["items"]
    body = _is_problem(post(client, setup=setup), 422, "bad_setup")
    assert at in body["subjects"] and body["measured"][0]["problem"]
    assert client.get("/v1/jobs?limit=200").json()["items"] == before


def test_every_problem_of_a_setup_is_told_at_once(client, post):
    body = _is_problem(post(client, setup={"tools": [{**TOOL, "diameter_mm": -1}], "unit": 1}), 422, "bad_setup")
    assert body["subjects"] == ["tools[0].diameter_mm", "unit"]


def test_of_very_many_problems_the_first_are_told(client, post):
    setup = {"tools": [TOOL], **{f"x{k}": 0 for k in range(3000)}}
    answer = post(client, setup=setup)
    body = _is_problem(answer, 422, "bad_setup")
    assert len(body["subjects"]) == len(body["measured"]) == 200 and "2999 more" in body["detail"]
    answer = client.put("/v1/tools/x", json={**TOOL, **{f"x{k}": 0 for k in range(3000)}})
    assert len(_is_problem(answer, 422, "malformed_request")["measured"]) == 200


@pytest.mark.parametrize(("setup", "code"), [("{", "setup_not_json"), ('{"tools": NaN}', "bad_setup"),
                                             ("[" * 100_000, "setup_not_json")])
def test_setup_text_that_is_no_setup(client, post, setup, code):
    _is_problem(post(client, setup=setup), 422, code)


@pytest.mark.parametrize(("part", "code"), [
    (b"", "empty_file"), (b"solid cube\nendsolid\n", "not_step"), (STEP[:150], "truncated_step"),
    (STEP.replace(b"(0.,0.,0.)", b"(#7)"), "dangling_reference")])
def test_a_part_that_is_no_step_file(client, post, part, code):
    body = _is_problem(post(client, part=part), 422, code)
    assert ":bad-step:" in body["type"]
    assert not list(client.app.state.engine.artifacts.tmp.iterdir())


def test_a_refused_part_takes_no_file_from_who_has_a_use_for_the_same_bytes(client, post, finish):
    busy, program = post(client, "sleep").json(), b"%\nG21\nM2\n%\n(as a part it is refused)\n"
    waiting = post(client, path="/v1/verifications", program=program).json()
    body = _is_problem(post(client, part=program), 422, "not_step")
    assert "blob" not in str(body)
    client.delete(busy["links"]["self"])
    assert finish(client, waiting)["state"] == "proved"


def test_a_body_over_the_limit_is_refused(client, post):
    body = _is_problem(post(client, part=STEP + b" " * 2_100_000), 413, "body_too_large")
    assert body["limit"] == 2_000_000

    def endless():
        for _ in range(64):
            yield b"x" * 65536

    answer = client.post("/v1/jobs", content=endless(), headers={"content-type": "multipart/form-data; boundary=b"})
    assert answer.status_code == 413 and answer.headers["content-type"] == "application/problem+json"


def test_a_body_that_is_no_form_has_a_limit_of_its_own_also_for_who_has_no_key(make_client):
    client = make_client(auth="keys")
    text = b'{"id": "' + b"x" * 1_000_000 + b'"}'
    for method, path in (("PUT", "/v1/tools/x"), ("POST", "/v1/keys")):
        json_body = {"content-type": "application/json"}
        body = _is_problem(client.request(method, path, content=text, headers=json_body), 413, "body_too_large")
        assert body["limit"] == 1_000_000
        drip = client.request(method, path, content=iter([text[:600_000], text[600_000:]]), headers=json_body)
        _is_problem(drip, 413, "body_too_large")


@pytest.mark.parametrize("charset", ["punycode", "idna", "undefined", "utf-16", "utf-8; charset=punycode", "rot13"])
def test_no_codec_of_the_clients_choice_reads_a_form(client, charset):
    body = b'--b\r\nContent-Disposition: form-data; name="setup"\r\n\r\n{}\r\n--b--\r\n'
    form = f"multipart/form-data; boundary=b; charset={charset}"
    found = _is_problem(client.post("/v1/jobs", content=body, headers={"content-type": form}), 422, "bad_multipart")
    assert found["subjects"] == ["content-type"]
    form = "multipart/form-data; boundary=b; charset=UTF-8"
    _is_problem(client.post("/v1/jobs", content=body, headers={"content-type": form}), 422, "missing_part")


def test_malformed_forms(client, post):
    _is_problem(client.post("/v1/jobs", json={}), 422, "not_multipart")
    _is_problem(client.post("/v1/jobs", files={"part": ("a", STEP)}), 422, "missing_part")
    _is_problem(client.post("/v1/jobs", files={"part": ("a", STEP), "setup": "{}", "x": "1"}), 422, "unknown_part")
    _is_problem(client.post("/v1/jobs", content=b"junk", headers={"content-type": "multipart/form-data"}), 422,
                "bad_multipart")
    _is_problem(post(client, path="/v1/verifications"), 422, "missing_part")
    _is_problem(post(client, path="/v1/verifications", program=b""), 422, "empty_program")
    for number, code in (("9", "no_such_tool"), ("-1", "bad_spindle_tool"), ("", "bad_spindle_tool"),
                         ("1" * 7, "bad_spindle_tool")):
        body = _is_problem(post(client, path="/v1/verifications", program=b"M2\n", spindle_tool=number), 422, code)
        assert body["subjects"] == ["spindle_tool"]
    _is_problem(post(client, spindle_tool="1"), 422, "unknown_part")
    five = {"tools": [TOOL], "machine": {"kind": "5-axis", "kinematics": "head-head-BC"}}
    held = {**five, "machine": {**five["machine"], "rotary_deg": [[-30, 30], [-360, 360]]},
            "access": [{"direction": [1, 0, 0]}]}
    for path in ("/v1/jobs", "/v1/zones"):
        _is_problem(post(client, path=path, setup=json.dumps(held)), 422, "access_out_of_reach")
        assert post(client, path=path, setup=json.dumps(five)).status_code == 202
    assert post(client, path="/v1/verifications", setup=json.dumps(five), program=b"M2\n").status_code == 202
    answer = client.post("/v1/jobs", files={"part": ("a.step", STEP)},
                         data={"setup": json.dumps({"tools": [TOOL]})})
    assert answer.status_code == 202  # a plain form field will do as well


def test_a_part_sent_twice_is_refused_by_name(client):
    good = json.dumps({"tools": [TOOL]})
    for name in ("part", "setup"):
        parts = [("part", ("a.step", STEP)), ("setup", ("s.json", good))]
        parts.append((name, dict(parts)[name]))
        body = _is_problem(client.post("/v1/jobs", files=parts), 422, "repeated_part")
        assert body["subjects"] == [name] and (body["measured"], body["limit"]) == (2, 1)


def test_names_that_stand_twice_in_the_setup_are_refused(client, post):
    text = '{"tools": [], "tools": ' + json.dumps([TOOL]) + "}"
    assert _is_problem(post(client, setup=text), 422, "repeated_key")["subjects"] == ["tools"]


@pytest.mark.parametrize("body", [b"{", b"", b"\xff\xfe", b"[" * 100_000, b"[]"])
def test_a_library_body_that_is_no_entry_is_422(client, body):
    answer = client.put("/v1/tools/x", content=body, headers={"content-type": "application/json"})
    assert "dictionary" not in _is_problem(answer, 422, "malformed_request")["detail"]


def test_half_a_character_is_refused_wherever_it_stands(client, post):
    for setup in ('{"tools": [], "\\ud800": 1}', '{"tools": [{"id": "T1\\udfff"}]}', '{"labels": {"a": "\\ud800"}}'):
        _is_problem(post(client, setup=setup), 422, "bad_text")
    body = b'{"id": "\\ud800", "kind": "ball", "diameter_mm": 3}'
    answer = client.put("/v1/tools/x", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 422 and answer.headers["content-type"] == "application/problem+json"


def test_broken_setups_over_http_are_no_bugs(client, post):
    from tests.hostile_inputs import FULL_SETUP, mutated_setup

    statuses = {}
    for seed in range(60):
        answer = post(client, setup=mutated_setup(seed, FULL_SETUP).encode("utf-8", "surrogatepass"))
        assert answer.status_code in (202, 422), (seed, answer.text)
        if answer.status_code == 422:
            assert answer.json()["remedy"] and answer.headers["content-type"] == "application/problem+json"
        else:
            client.delete(answer.json()["links"]["self"])
        statuses[answer.status_code] = statuses.get(answer.status_code, 0) + 1
    assert statuses[422] > 30


def test_the_key_has_a_length(client, post):
    _is_problem(post(client, key="k" * 256), 422, "malformed_request")
    _is_problem(post(client, key=""), 422, "malformed_request")


def test_what_is_not_there_is_404_and_what_is_not_offered_405(client, post):
    _is_problem(client.get("/nowhere"), 404, "no_such_path")
    _is_problem(client.get("/v1/jobs/"), 404, "no_such_path")
    _is_problem(client.get("/v1/jobs/jx"), 404, "no_such_job")
    answer = client.patch("/v1/jobs")
    _is_problem(answer, 405, "method_not_allowed")
    assert "GET" in answer.headers["allow"] and "HEAD" in answer.headers["allow"]
    _is_problem(client.get("/v1/jobs?limit=0"), 422, "malformed_request")


def test_files_cannot_be_fetched_from_elsewhere(client, post, finish):
    job = finish(client, post(client, "").json())
    for name in ("state", "..%2Fstate", "%2Fetc%2Fpasswd", "nothing.txt", "%2e%2e"):
        answer = client.get(f"{job['links']['files']}/{name}")
        assert answer.status_code == 404, name


@pytest.mark.parametrize("document", ["files", "report", "zones"])
def test_a_job_without_result_says_what_to_do_in_the_state_it_is_in(client, post, finish, document):
    job = post(client, "sleep").json()
    links = job["links"]
    waiting = client.get(links[document])
    _is_problem(waiting, 409, "not_ready")
    assert "wait" in waiting.json()["remedy"] and links["events"] in waiting.json()["remedy"]
    assert client.delete(links["self"]).json()["error"] is None
    cancelled = client.get(links[document])
    _is_problem(cancelled, 409, "no_result")
    assert "post it again" in cancelled.json()["remedy"] and "error" not in cancelled.json()["remedy"]
    failed = finish(client, post(client, "open").json())
    answer = client.get(failed["links"][document])
    _is_problem(answer, 409, "no_result")
    assert failed["error"] and f"GET {failed['links']['self']} has the reason under error" in answer.json()["remedy"]


def test_a_bug_in_a_route_is_a_problem_document_too(make_client, monkeypatch):
    client = make_client()
    monkeypatch.setattr(client.app.state.engine.library, "all", lambda: 1 / 0)
    answer = client.get("/v1/tools")
    assert answer.status_code == 500 and answer.json()["code"] == "bug" and "division" not in answer.text
