"""The page over HTTP: its headers, its files, and what stands there where it was not built."""

import pytest

from service.viewer import static_files


@pytest.fixture
def built(tmp_path, monkeypatch):
    """A page that was built."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html><title>built</title>")
    (tmp_path / "assets" / "index-abc123.js").write_text("void 0;\n" * 200)
    for function in (static_files.page, static_files.asset):
        monkeypatch.setattr(function, "__defaults__", (tmp_path,))
    return tmp_path


def test_the_page_runs_nothing_but_its_own_files(client, built):
    for path in ("/", "/v1/jobs/j0/view"):
        answer = client.get(path)
        assert answer.status_code == 200 and "built" in answer.text
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy and "script-src 'self';" in policy and "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy and "http" not in policy and "*" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"


def test_no_page_runs_scripts_of_another_host(client):
    """Those of the framework about the contract would, beside the key that a tab keeps."""
    for path in ("/docs", "/redoc", "/docs/oauth2-redirect"):
        assert client.get(path).status_code == 404
    assert client.get("/openapi.json").status_code == 200


def test_files_of_the_page_are_kept_for_good_and_packed(client, built):
    plain = client.get("/assets/index-abc123.js", headers={"Accept-Encoding": "identity"})
    packed = client.get("/assets/index-abc123.js")
    assert plain.text == packed.text and packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"])
    assert "immutable" in plain.headers["cache-control"] and plain.headers["content-type"].startswith("text/javascript")


@pytest.mark.parametrize("name", ["none.js", "..%2Findex.html", "%2e%2e%2findex.html", ".js", "index-abc123.js%00",
                                  "..%2F..%2Fapp.py"])
def test_no_name_leads_out_of_the_folder(client, built, name):
    answer = client.get(f"/assets/{name}")
    assert answer.status_code == 404 and "built" not in answer.text


def test_where_it_was_not_built_the_remedy_stands_there(client, tmp_path, monkeypatch):
    monkeypatch.setattr(static_files.page, "__defaults__", (tmp_path,))
    answer = client.get("/")
    assert answer.status_code == 503 and "make web" in answer.text and "not built" in answer.text
    assert answer.headers["content-type"].startswith("text/html")


def test_every_job_has_a_link_to_its_page(client, post, finish):
    for path, more in (("/v1/jobs", {}), ("/v1/zones", {}), ("/v1/verifications", {"program": b"M2\n"})):
        job = finish(client, post(client, path=path, **more).json())
        assert job["links"]["view"] == f"/v1/jobs/{job['id']}/view"
