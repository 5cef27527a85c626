"""What libraries log by themselves comes in the form of the service, one line an event."""

import json
import subprocess
import sys

import pytest

CODE = """
import logging
from service.logs import configure
configure("info", {form!r})
try:
    raise ValueError("no\\nadmin logged in")
except ValueError:
    logging.getLogger("uvicorn.error").exception("Exception in %s", "a\\nb")
"""


@pytest.mark.parametrize("form", ["json", "console"])
def test_a_library_makes_no_line_of_its_own(form):
    said = subprocess.run([sys.executable, "-c", CODE.format(form=form)], capture_output=True, text=True, check=True)
    lines = said.stderr.splitlines()
    assert not said.stdout and lines
    if form == "json":
        (line,) = (json.loads(text) for text in lines)
        assert (line["event"], line["level"], line["logger"]) == ("Exception in a\nb", "error", "uvicorn.error")
        assert "ValueError" in line["exception"]
    else:
        assert "Exception in a\\nb" in lines[0] and all(text.startswith("    | ") for text in lines[2:])
        assert not [text for text in lines if text.startswith(("admin", "b"))]
