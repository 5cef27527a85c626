"""A chain for tests of the service alone: what it does is said by the setup's label "do"."""

import ctypes
import errno
import hashlib
import os
import time

import geometry.errors as errors
from service.estimate.estimate import Estimate, Share

NAPS = {"sleep": 400, "nap": 40, "short nap": 15}  # twentieths of a second


def _report(setup, state, findings):
    files = [{"name": "program.linuxcnc.ngc", "kind": "nc", "access": "A1", "dialect": "linuxcnc", "sha256": "0" * 64}]
    return {
        "state": state, "complete": True, "labels": setup.labels, "inputs": {"part_sha256": "0", "setup_sha256": "0"},
        "part": {"faces": 6, "volume_mm3": 1.0, "bbox_mm": [[0, 0, 0], [1, 1, 1]]}, "walls": [], "connections": [],
        "channels": [], "zones": [], "steps": [], "remainder": [], "findings": findings, "coverage": 1.0,
        "reach_coverage": 1.0, "machining_time_s": 1.0, "tools": [{"id": t.id} for t in setup.tools],
        "files": files if state == "proved" else [], "version": "fake",
    }


def _raise_in_the_kernel():
    """An exception of Open CASCADE's own, on the way that those of its readings take."""
    from geometry.step_import import reader_process
    from geometry.step_import.occ import loading

    def load_part(**_):
        from OCP.gp import gp_Dir

        return gp_Dir(0.0, 0.0, 0.0)

    loading.load_part = load_part
    reader_process._load({"placement": None})


def _misbehave(what, progress):
    if what in NAPS:
        steps = NAPS[what]
        for i in range(steps):
            progress("asleep", i / steps)
            time.sleep(0.05)
    elif what == "segfault":
        ctypes.string_at(0)
    elif what == "memory":
        kept = []
        while True:
            kept.append(bytearray(os.urandom(1000) * 20000))
            time.sleep(0.005)
    elif what == "loop":
        while True:
            pass
    elif what == "kernel":
        _raise_in_the_kernel()
    elif what == "killed":
        os.kill(os.getpid(), 9)
    elif what == "look about":
        raise errors.PartError(" ".join(sorted(os.environ)), code="environment", subjects=("x",))
    elif what == "full":
        raise OSError(errno.ENOSPC, "No space left on device")
    elif what == "bug":
        raise KeyError("a bug")
    elif what == "open":
        raise errors.PartError("the part has open shells", code="open_shell", subjects=("F3",))


def _admitted(setup, admit):
    """Wait for the memory that the label "memory_mb" says the job takes."""
    if "memory_mb" in setup.labels:
        share = Share("samples of the fake", 7, int(setup.labels["memory_mb"]), 1.5)
        admit(Estimate(share.memory_mb, share.seconds, (share,)))


def plan(part_path, setup, out, progress, blank_path=None, kept=None, admit=None):
    _admitted(setup, admit)
    what = setup.labels.get("do", "")
    _misbehave(what, progress)
    for k in range(3):
        progress(f"stage {k}", k / 3)
    state = "unproved" if what == "gouge" else "proved"
    findings = [{"kind": "gouge", "zone": "Z1", "depth_mm": 0.2}] if what == "gouge" else []
    # also where it should not be: the service itself must withhold it
    (out / "program.linuxcnc.ngc").write_text("%\nG21\nM2\n%\n")
    (out / "job.stpnc").write_text("ISO-10303-21;\n")
    (out / "deviation.png").write_bytes(b"\x89PNG of the fake")
    (out / "sheet.html").write_text("<!DOCTYPE html>\n<title>Sheet of the fake</title>\n")
    (out / "sheet.pdf").write_bytes(b"%PDF-1.3 of the fake")
    report = _report(setup, state, findings)
    if blank_path is not None:
        report["inputs"]["stock_sha256"] = hashlib.sha256(blank_path.read_bytes()).hexdigest()
    (out / "zones.json").write_text(__import__("json").dumps(
        {k: report[k] for k in ("part", "walls", "connections", "channels", "zones", "remainder")}))
    return report


def zones_only(part_path, setup, progress, admit=None):
    progress("zones", 0.5)
    report = _report(setup, "proved", [])
    return {k: report[k] for k in ("part", "walls", "connections", "channels", "zones", "remainder")}


def verify_program(part_path, setup, program_text, progress, access=None, out=None, mesh=None, spindle_tool=0,
                   admit=None):
    progress("verify", 0.5)
    (out / "deviation.png").write_bytes(b"\x89PNG of the fake")
    findings = [{"kind": "gouge"}] if "GOUGE" in program_text else []
    if "SPINDLE" in program_text:
        findings.append({"spindle_tool": spindle_tool})
    if "HIGH" in program_text:
        return {"state": "clean", "findings": [{"kind": "stock_left", "face": "F3", "depth": 1.0}]}
    return {"state": "unproved" if findings else "proved", "findings": findings}
