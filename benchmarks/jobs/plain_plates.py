"""Large plain plates, and files of many bodies and faces: seconds and memory of whole jobs.

    python benchmarks/jobs/plain_plates.py plan [100 300 600] [--keep FOLDER]    # plates, planned and proved
    python benchmarks/jobs/plain_plates.py read          # files of many bodies and of many faces

A plate is L x 2L/3 x 20 mm, with rounded corners, one pocket and four bores. Its area grows with L², its shape does not
change: the seconds show what the product spends on area. A flat end of 6 mm and a ball of 3 mm cut it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HEIGHT, POCKET_DEPTH, CORNER, BORE = 20.0, 8.0, 6.0, 5.0
HOLDER = [{"diameter_mm": 24.0, "length_mm": 40.0}]
TOOLS = [
    {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 6.0, "flutes": 3, "flute_length_mm": 24.0,
     "neck_length_mm": 24.0, "neck_diameter_mm": 6.0, "shank_diameter_mm": 6.0, "stickout_mm": 30.0, "holder": HOLDER},
    {"id": "T2", "number": 2, "kind": "ball", "diameter_mm": 3.0, "flutes": 2, "flute_length_mm": 9.0,
     "neck_length_mm": 24.0, "neck_diameter_mm": 2.8, "shank_diameter_mm": 6.0, "stickout_mm": 30.0, "holder": HOLDER}]


def plate(length: float) -> Any:
    """A plate as a cadquery object, mm; its middle is at x = y = 0, its underside at z = 0."""
    import cadquery as cq

    wide = 2.0 * length / 3.0
    out = cq.Workplane().box(length, wide, HEIGHT, centered=(True, True, False)).edges("|Z").fillet(CORNER)
    pocket = (cq.Workplane(origin=(0, 0, HEIGHT - POCKET_DEPTH)).rect(length / 1.5, 0.4 * length).extrude(POCKET_DEPTH)
              .edges("|Z").fillet(CORNER))
    places = [(sx * (length / 2 - 15.0), sy * (wide / 2 - 15.0)) for sx in (-1, 1) for sy in (-1, 1)]
    return out.cut(pocket).faces("<Z").workplane(invert=True).pushPoints(places).circle(BORE).cutThruAll()


def rotor(blades: int) -> Any:
    """A hub and straight blades that overlap it, each a body of its own, as a compound."""
    import cadquery as cq

    hub = cq.Workplane().circle(40.0).extrude(30.0).val()
    blade = cq.Workplane(origin=(38.0, -1.0, 5.0)).box(40.0, 2.0, 20.0, centered=False).val()
    return cq.Compound.makeCompound([hub, *(blade.rotate((0, 0, 0), (0, 0, 1), 360.0 * k / blades)
                                            for k in range(blades))])


def lattice(rows: int) -> Any:
    """A block with rows x rows square windows right through: 4 rows² + 6 faces."""
    import cadquery as cq

    side = 10.0 * rows
    return cq.Workplane().rect(side, side).rarray(10.0, 10.0, rows, rows).rect(6.0, 6.0).extrude(10.0)


def timed(command: list[str]) -> tuple[float, float, int, str]:
    """Run the command line: seconds, MB of its largest process, exit code, and the end of what it says."""
    watch = ("import resource, subprocess, sys; "
             f"done = subprocess.run([sys.executable, '-m', 'service.cli', *{command!r}], capture_output=True, "
             "text=True); "
             "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, done.returncode, "
             "done.stderr[-600:].replace(chr(10), ' | '))")
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", watch], capture_output=True, text=True, check=True)
    size, code, said = (*done.stdout.strip().split(" ", 2), "")[:3]
    return time.perf_counter() - begun, int(size) / 1024.0, int(code), said


def plan(lengths: list[float], folder: Path) -> None:
    """Plan and prove plates, one line each."""
    import cadquery as cq

    (folder / "setup.json").write_text(json.dumps({"tools": TOOLS}))
    for length in lengths:
        part = folder / f"plate_{length:g}.step"
        cq.exporters.export(plate(length), str(part))
        out = folder / f"out_{length:g}"
        seconds, size, code, said = timed(["plan", str(part), "--setup", str(folder / "setup.json"), "--out", str(out)])
        report = json.loads((out / "report.json").read_text()) if (out / "report.json").exists() else {}
        print(f"{length:6g} mm {seconds:7.1f} s {size:7.0f} MB exit {code} {report.get('state', said)} coverage "
              f"{report.get('coverage')} {report.get('reach_coverage')}", flush=True)


def read(folder: Path) -> None:
    """Zones of files of many bodies or faces, one line each."""

    (folder / "setup.json").write_text(json.dumps({"tools": TOOLS}))
    for name, shape in (("rotor of 57 bodies", rotor(56)), ("rotor of 60 bodies", rotor(59)),
                        ("lattice of 1,030 faces", lattice(16))):
        part = folder / "part.step"
        _one_product(shape, part)
        seconds, size, code, said = timed(["zones", str(part), "--setup", str(folder / "setup.json")])
        print(f"{name}: {seconds:.1f} s {size:.0f} MB exit {code} {said if code else ''}", flush=True)


def _one_product(shape: Any, path: Path) -> None:
    """Write a compound as the bodies of one product."""
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    writer = STEPControl_Writer()
    Interface_Static.SetIVal_s("write.step.assembly", 0)
    writer.Transfer(shape.val().wrapped if hasattr(shape, "val") else shape.wrapped, STEPControl_AsIs)
    writer.Write(str(path))


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("plan", "read"))
    parser.add_argument("lengths", nargs="*", type=float, default=[100.0, 300.0, 600.0])
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if given.what == "plan":
            plan(given.lengths, folder)
        else:
            read(folder)


if __name__ == "__main__":
    main()
