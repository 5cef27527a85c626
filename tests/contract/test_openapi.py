"""openapi.yaml stands for the running application."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from schemas.setup import Setup
from service.api.app import create_app
from service.api.openapi import SECTION, as_yaml
from service.errors import ERROR_TABLE
from verify.model import FindingKind
from zones.remainder.reasons import ProposalVerdict, Reason

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def document():
    return create_app().openapi()


def test_openapi_yaml_is_what_the_application_says(document):
    assert (ROOT / "openapi.yaml").read_text() == as_yaml(document), "run: zonemill openapi > openapi.yaml"


def test_the_setup_of_a_submission_is_typed(document):
    for path in ("/v1/jobs", "/v1/zones", "/v1/verifications"):
        form = document["paths"][path]["post"]["requestBody"]["content"]["multipart/form-data"]
        assert form["schema"]["properties"]["setup"] == {"$ref": "#/components/schemas/Setup"}
        assert form["encoding"]["setup"]["contentType"] == "application/json"
        assert form["schema"]["properties"]["part"]["format"] == "binary"


def test_every_reference_leads_somewhere_and_every_schema_is_used(document):
    text = yaml.safe_dump(document)
    schemas = document["components"]["schemas"]
    lines = [line for line in text.splitlines() if "$ref" in line and "/schemas/" in line]
    used = {line.rsplit("/", 1)[1].strip("'\" ") for line in lines}
    assert used <= set(schemas)
    assert set(schemas) - used <= {"JobEvent"}


def test_errors_are_problems_and_operations_are_named(document):
    names = []
    for path, item in document["paths"].items():
        for method, operation in item.items():
            names.append(operation["operationId"])
            for status, answer in operation["responses"].items():
                if status >= "400" and path != "/readyz":
                    assert list(answer["content"]) == ["application/problem+json"], (path, method, status)
    assert len(set(names)) == len(names)


def test_every_operation_and_every_problem_has_an_example_that_fits_its_schema(document):
    import jsonschema

    def fits(value, schema):
        jsonschema.validate(value, {**schema, "components": document["components"]},
                            cls=jsonschema.Draft202012Validator)

    problems = document["components"]["examples"]
    for path, item in document["paths"].items():
        for method, operation in item.items():
            for status, answer in operation["responses"].items():
                for media, content in answer.get("content", {}).items():
                    where = (path, method, status, media)
                    if media == "application/problem+json":
                        named = [e["$ref"].rsplit("/", 1)[1] for e in content["examples"].values()]
                        assert named, where
                        for name in named:
                            assert problems[name]["value"]["status"] == int(status), where
                    elif status < "300":
                        assert content["example"], where
                        if media == "application/json":
                            fits(content["example"], content["schema"])
    assert {p["value"]["type"].split(":")[3] for p in problems.values()} == {row.slug for row in ERROR_TABLE.values()}
    for each in problems.values():
        fits(each["value"], {"$ref": "#/components/schemas/Problem"})
    Setup.model_validate(document["components"]["schemas"]["Setup"]["examples"][0])


def test_words_are_for_readers_of_the_interface(document):
    """No section of a docstring, no mark-up of Sphinx, no default of the framework."""
    texts = []

    def collect(node):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            if key in ("description", "summary") and isinstance(value, str):
                texts.append(value)
            elif isinstance(value, dict | list):
                collect(value)

    collect(document)
    assert len(texts) > 300
    assert not [t for t in texts if "------" in t or "``" in t or t == "Successful Response"]
    for item in document["paths"].values():
        for operation in item.values():
            assert not operation["summary"].istitle(), "the default of the framework: give the route a summary"


def test_a_section_of_a_docstring_is_left_out():
    text = "What it does.\n\nMore.\n\nRaises\n------\nRateError\n    Too many."
    assert SECTION.sub("", text) == "What it does.\n\nMore."


def test_the_description_of_findings_names_every_kind(document):
    text = document["components"]["schemas"]["Report"]["properties"]["findings"]["description"]
    kinds = text.split("kind: ")[1].split(". message")[0]
    assert set(re.findall("[a-z_]+", kinds)) >= {*FindingKind, "nothing_cut", "coverage"}


def test_the_descriptions_of_reasons_name_every_reason(document):
    schemas = document["components"]["schemas"]
    reason = schemas["Remainder"]["properties"]["reason"]["description"]
    assert not [r for r in Reason if not re.search(rf"(^|[ ,.]){r}[:,]", reason)]
    stays = schemas["Proposal"]["properties"]["stays_mm2"]["description"]
    assert not [r for r in (ProposalVerdict.SLENDER, ProposalVerdict.TOO_LITTLE) if f"{r}:" not in stays]


def test_every_field_says_its_unit_or_has_a_description(document):
    for name in ("Setup", "Tool", "Machine", "Quality", "Stock", "Access", "Placement", "Clearance", "Operations"):
        schema = document["components"]["schemas"][name]
        assert schema["description"]
        for field, spec in schema["properties"].items():
            assert "description" in spec or "$ref" in spec, f"{name}.{field}"


@pytest.mark.slow
def test_schemathesis_finds_no_answer_outside_the_document(make_client, bearer):
    """All its checks but one: what the schema allows may still contradict itself (a neck thicker than its cutter)."""
    import schemathesis
    from hypothesis import HealthCheck, Phase, given, settings
    from schemathesis.checks import CHECKS, load_all_checks

    load_all_checks()
    (accepts,) = CHECKS.get_by_names(["positive_data_acceptance"])
    client = make_client(auth="keys")
    headers = {**bearer(client, "ada", "submit", "read", "admin"), "host": "127.0.0.1:8000"}
    probed: set[str] = set()
    for result in schemathesis.openapi.from_asgi("/openapi.json", client.app).get_all_operations():
        operation = result.ok()

        @settings(max_examples=8, deadline=None, database=None, derandomize=True, phases=[Phase.generate],
                  suppress_health_check=list(HealthCheck))
        @given(case=operation.as_strategy())
        def probe(case):
            probed.add(case.operation.label)
            case.call_and_validate(headers=headers, excluded_checks=[accepts])

        probe()
    wanted = {f"{method.upper()} {path}" for path, item in client.app.openapi()["paths"].items() for method in item}
    assert probed == wanted


@pytest.mark.slow
def test_a_generated_client_posts_a_job(tmp_path):
    """openapi-python-client makes a package from openapi.yaml; that package posts a typed setup."""
    made = subprocess.run([sys.executable, "-m", "openapi_python_client", "generate", "--path",
                           str(ROOT / "openapi.yaml"), "--meta", "none", "--output-path", str(tmp_path / "zm")],
                          capture_output=True, text=True, timeout=120,
                          env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"})
    assert made.returncode == 0, made.stdout + made.stderr
    assert "arning" not in made.stdout + made.stderr, made.stdout + made.stderr
    script = Path(__file__).parent / "fakes" / "use_client.py"
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}:{script.parent}"}
    got = subprocess.run([sys.executable, str(script), str(tmp_path / "data")], capture_output=True, text=True,
                         timeout=120, env=environment, cwd=ROOT)
    assert got.returncode == 0, got.stdout + got.stderr
    assert got.stdout.strip().splitlines()[-1] == "proved 1"
