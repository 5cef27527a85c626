"""Rates, libraries, health and metrics; keys are tested in test_service_keys.py."""

TOOL = {"id": "T7", "kind": "flat", "diameter_mm": 4}


def test_too_many_submissions(make_client, post):
    client = make_client(post_rate="2/minute")
    assert [post(client, "sleep").status_code for _ in range(3)] == [202, 202, 429]
    answer = post(client, "sleep")
    assert answer.json()["code"] == "too_many_requests" and 50 < int(answer.headers["retry-after"]) <= 61
    assert client.get("/v1/jobs").status_code == 200


def test_a_setup_refers_to_the_library_and_keeps_what_it_found(client, post, finish):
    assert client.put("/v1/tools/finisher", json=TOOL).status_code == 201
    assert client.put("/v1/tools/finisher", json=TOOL).status_code == 200
    assert client.get("/v1/tools/finisher").json()["entry"]["stickout_mm"] == 40
    assert client.put("/v1/machines/mill", json={"max_rpm": 12000}).status_code == 201
    steel = {"name": "1.2379", "cutting_speed_m_min": 70,
             "feed_per_tooth": [{"diameter_mm": 4, "feed_per_tooth_mm": 0.01}]}
    assert client.put("/v1/materials/house-steel", json=steel).status_code == 201
    setup = {"tools": ["lib:finisher"], "machine": "lib:mill", "material": "lib:house-steel"}
    job = finish(client, post(client, setup=setup).json())
    assert client.get(job["links"]["report"]).json()["tools"] == [{"id": "T7"}]
    client.put("/v1/tools/finisher", json={**TOOL, "diameter_mm": 5})
    assert post(client, setup=setup).json()["setup_sha256"] != job["setup_sha256"]
    for path in ("/v1/tools/finisher", "/v1/machines/mill", "/v1/materials/house-steel"):
        assert client.delete(path).status_code == 204
        assert client.delete(path).json()["code"] == client.get(path).json()["code"] == "no_such_entry"
    assert post(client, setup=setup).json()["code"] == "bad_setup"


def test_a_job_says_which_versions_it_used_and_a_setup_may_name_one(make_client, post, bearer):
    client = make_client()
    ada, bob = bearer(client, "ada"), bearer(client, "bob")
    root = bearer(client, "root", "admin")
    for diameter in (4, 5, 5, 6):
        written = client.put("/v1/tools/cutter", json={**TOOL, "diameter_mm": diameter}, headers=ada).json()
    assert written["version"] == 3 and written["shared"] is False and written["created_at"]
    assert client.put("/v1/tools/cutter?shared=true", json=TOOL, headers=ada).json()["code"] == "scope_missing"
    assert client.put("/v1/machines/mill?shared=true", json={"max_rpm": 9000}, headers=root).status_code == 201
    assert client.get("/v1/tools/cutter?version=1", headers=ada).json()["entry"]["diameter_mm"] == 4
    setup = {"tools": ["lib:cutter@2"], "machine": "lib:mill"}
    job = post(client, setup=setup, headers=ada).json()
    assert job["library"] == [{"shelf": "machines", "name": "mill", "version": 1, "shared": True},
                              {"shelf": "tools", "name": "cutter", "version": 2, "shared": False}]
    # the same tool and machine written out are the same content
    written_out = {"tools": [{**TOOL, "diameter_mm": 5}], "machine": {"max_rpm": 9000}}
    plain = post(client, setup=written_out, headers=ada).json()
    assert plain["content_sha256"] == job["content_sha256"] and plain["library"] == []
    for wrong in ("lib:cutter@9", "lib:cutter@0", "lib:cutter@", "lib:"):
        answer = post(client, setup={"tools": [wrong]}, headers=ada)
        assert answer.status_code == 422 and answer.json()["subjects"] == ["tools[0]"], wrong
    # bob sees the shared machine, and neither ada's tool nor its name
    answer = post(client, setup=setup, headers=bob)
    assert answer.status_code == 422 and "it has: none" in answer.json()["detail"]
    assert client.get("/v1/tools", headers=bob).json() == {"items": []}
    assert client.get("/v1/tools/cutter", headers=bob).status_code == 404
    assert client.delete("/v1/tools/cutter", headers=bob).status_code == 404
    assert client.get("/v1/machines/mill", headers=bob).json()["shared"] is True
    assert client.delete("/v1/machines/mill?shared=true", headers=bob).status_code == 403


def test_library_entries_are_checked(client):
    answer = client.put("/v1/tools/x", json={**TOOL, "diameter_mm": -1})
    assert answer.status_code == 422 and answer.headers["content-type"] == "application/problem+json"
    assert client.put("/v1/tools/..x", json=TOOL).status_code == 422
    names = [m["name"] for m in client.get("/v1/materials").json()["items"]]
    for name in names:
        found = client.get(f"/v1/materials/{name}")
        assert found.status_code == 200 and found.json()["built_in"] and found.json()["entry"]["name"] == name
    assert client.get("/v1/materials/cheese").status_code == 404
    assert "Ti-6Al-4V" in names and client.get("/v1/machines").json() == {"items": []}


def test_health_and_metrics(client, post, finish):
    finish(client, post(client, "").json())
    assert client.get("/healthz").json()["status"] == "ok"
    assert client.get("/readyz").json() == {"status": "ok", "checks": dict.fromkeys(
        ("database", "data_folder", "disk_space", "engine"), "ok")}
    assert client.request("BREW1", "/healthz").status_code == client.request("BREW2", "/healthz").status_code == 405
    text = client.get("/metrics").text
    assert 'method="other"' in text and "BREW" not in text  # a name of the client's own would be a series for ever
    assert 'zonemill_submissions_total{kind="plan"}' in text and 'zonemill_jobs{state="proved"}' in text
    assert 'route="/v1/jobs/{job_id}"' in text and "/v1/jobs/j" not in text


def test_a_request_id_is_kept_and_otherwise_made(client):
    given = "3f2b8c1e5d6a4f7e9b0c1d2e3f4a5b6c"
    assert client.get("/healthz", headers={"X-Request-ID": given}).headers["x-request-id"] == given
    assert client.get("/healthz").headers["x-request-id"]
