"""What the development environment writes for the tests of the runtime environment: parts, and what it made of them.

``python -m tests.runtime.write_parts FOLDER`` draws parts with cadquery and keeps digests of them as read and planned
with the OCP wheel that cadquery wants. The runtime environment has the other wheel and must come to the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from pathlib import Path

from geometry.step_import.face_surfaces import patches_to_bytes, read_patches
from geometry.step_import.reader import read_part

FAMILY = [("demo", 0), ("narrow", 1), ("impeller", 1), ("mixed", 7)]
SHAPES = ("pair", "wheel", "ring", "far_leaning")
DIGESTS = "digests.json"
CHORD_MM = 0.02


def as_read(step: Path) -> dict[str, str]:
    """Digests of a part as read: mesh, faces and edges, and the surfaces of all faces."""
    part = read_part(step, chord=CHORD_MM)
    surfaces = patches_to_bytes(read_patches(step).values())
    return {"part": _sha256(part.to_bytes()), "surfaces": _sha256(surfaces), "faces": str(len(part.faces))}


def as_planned(folder: Path) -> dict[str, str]:
    """Digests of every file of the small part, planned and proved into a folder."""
    from examples.demo import write_small
    from service.from_wire import read_setup
    from service.pipeline import plan

    step, setup = write_small(folder)
    shutil.rmtree(folder / "out", ignore_errors=True)
    plan(step, read_setup(setup), folder / "out", lambda _stage, _share: None)
    return {p.name: _sha256(p.read_bytes()) for p in sorted((folder / "out").iterdir())}


def write(folder: Path) -> None:
    """Draw every part into a folder and keep the digests beside them."""
    from examples.family.recipes import make_part
    from tests import decomposition_shapes
    from tests.step_files import write_step

    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for recipe, seed in FAMILY:
        print(f"drawing {recipe}-{seed}", file=sys.stderr, flush=True)
        make_part(seed, recipe).write(folder)
    for name in SHAPES:
        write_step(getattr(decomposition_shapes, name)(), folder / f"{name}.step")
    found: dict[str, dict[str, str]] = {}
    for step in sorted(folder.glob("*.step")):
        print(f"reading {step.name}", file=sys.stderr, flush=True)
        found[step.stem] = as_read(step)
    print("planning the small part", file=sys.stderr, flush=True)
    text = {"read": found, "planned": as_planned(folder / "small")}
    (folder / DIGESTS).write_text(json.dumps(text, indent=1) + "\n")


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


if __name__ == "__main__":
    write(Path(sys.argv[1]))
