"""The table of errors covers the whole tree."""

import pytest

import geometry.errors as cam
import service.errors as own
from service.errors import ERROR_TABLE, error_mapping, problem_document


def _tree(cls):
    yield cls
    for child in cls.__subclasses__():
        yield from _tree(child)


def test_every_error_class_of_the_project_has_a_row():
    tree = {c for c in _tree(cam.CamError) if c.__module__.split(".")[0] in
            ("geometry", "zones", "toolpath", "output", "verify", "service")}
    assert tree == set(ERROR_TABLE)
    assert set(cam.ERROR_CLASSES.values()) <= set(ERROR_TABLE)


def test_exit_codes_follow_whose_fault_it_is():
    for cls, row in ERROR_TABLE.items():
        if issubclass(cls, cam.InputError):
            assert (int(row.status), row.exit_code) == (422, 2)
        assert row.exit_code in (1, 2, 3) and 400 <= row.status < 600
        assert row.slug == row.slug.lower() and row.title[0].isupper()
    assert error_mapping(cam.InternalError("x")).exit_code == 1


@pytest.mark.parametrize("cls", list(ERROR_TABLE))
def test_a_problem_document_says_everything_the_error_knows(cls):
    error = cls("what happened", subjects=("F1",), measured=2, limit=1, remedy="do this")
    found = problem_document(error, "/here", "id")
    assert found["type"] == f"urn:zonemill:problem:{ERROR_TABLE[cls].slug}:{error.code}"
    assert (found["detail"], found["subjects"], found["measured"], found["limit"], found["remedy"]) == (
        "what happened", ["F1"], 2, 1, "do this")


def test_the_docstring_tree_names_every_class():
    for cls in _tree(own.ServiceError):
        assert cls.__name__ in (own.__doc__ or "")
