"""Pits finer than the lattice of samples, at random places of three parts: found, as deep as a twin has them."""

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.sampling import sample_surface
from geometry.tool_body import ToolBody
from tests.hand_parts import as_part, dome, slope_field
from tests.pocket_case import block, text
from verify.model import FindingKind, ProofSetup, ScoredSamples
from verify.prove import prove

SETUP = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, clearance_rapid=0.2)
HEAD = ["%", "G21 G90 G17 G94 G40 G49 G61 G54", "T1 M6", "S20000 M3", "G0 G43 H1 Z40"]
PARTS = {"block": lambda: block(), "dome": lambda: as_part(dome(15.0)),
         "waves": lambda: as_part(slope_field(lambda x, y: 0.8 * np.sin(x) + 0.3 * y))}
COUNT = 20


def fine(diameter, corner=0.0):
    """An end mill with flutes as long as 20 mm: neck and shank are no thicker."""
    return ToolBody("T1", 1, diameter, corner, 20.0, diameter, 25.0, diameter, 60.0)


def twin(tree, tips, body):
    """Depth of the deepest place of the end of a tool standing on each tip, below the surface."""
    turn = np.linspace(0.0, 2.0 * np.pi, 65)[:-1]
    lean = np.linspace(0.0, 0.5 * np.pi, 9) if body.corner_radius else np.array([0.0])
    rim = body.radius if not body.corner_radius else body.corner_radius * np.sin(lean)
    at = np.array([[r * np.cos(t), r * np.sin(t), body.corner_radius * (1.0 - np.cos(a))]
                   for r, a in zip(np.atleast_1d(rim), lean, strict=True) for t in turn] + [[0.0, 0.0, 0.0]])
    there = tips[:, None] + at
    away, row, foot = nearest(tree, there.reshape(-1, 3))
    inside = ((there.reshape(-1, 3) - foot) * tree.mesh.normals[row]).sum(axis=1) < 0.0
    return np.where(inside, away, 0.0).reshape(len(tips), -1).max(axis=1)


def pits(part, seed, depth):
    """Random places of the surface seen from above, that far from each other, and the tips that go so deep there."""
    s = sample_surface(part.mesh, 40.0, seed=seed)
    rows = np.random.default_rng(seed).permutation(np.flatnonzero(s.normals[:, 2] > 0.3))
    chosen = []
    for r in rows.tolist():
        low, high = part.mesh.bounds[0, :2] + 0.3, part.mesh.bounds[1, :2] - 0.3
        if not ((s.points[r, :2] > low) & (s.points[r, :2] < high)).all():
            continue
        if all(np.linalg.norm(s.points[r] - s.points[k]) > 1.0 for k in chosen):
            chosen.append(r)
        if len(chosen) == COUNT:
            break
    deep = np.random.default_rng(seed + 1).uniform(*depth, len(chosen))
    return np.round(s.points[chosen] - deep[:, None] * [0.0, 0.0, 1.0], 4)


CASES = [pytest.param(part, corner, marks=() if (part, corner) == ("dome", 0.0) else pytest.mark.slow)
         for part in PARTS for corner in (0.0, 0.06)]


@pytest.mark.parametrize("part, corner", CASES)
def test_pits_of_sixty_microns_are_found_wherever_they_are(part, corner):
    body, shape = fine(0.12, corner), PARTS[part]()
    tips = pits(shape, 7, (0.03, 0.3))
    assert len(tips) == COUNT
    want = twin(TriangleTree(shape.mesh), tips, body)
    lines, line_of = list(HEAD), []
    for x, y, z in tips:
        lines += [f"G0 X{x:.4f} Y{y:.4f}", f"G1 Z{z:.4f} F100", "G0 Z40", *["(apart)"] * 6]
        line_of.append(len(lines) - 7)
    s = sample_surface(shape.mesh, 25.0, seed=3)
    proof = prove([("p.ngc", text([*lines, "M5", "M30", "%"]))], shape, (body,), SETUP,
                  ScoredSamples(s, np.zeros(len(s), np.int32)), [])
    found = {f.line: f.depth for f in proof.findings if f.kind is FindingKind.GOUGE}
    for line, depth in zip(line_of, want.tolist(), strict=True):
        assert found[line] == pytest.approx(depth, abs=max(0.1 * depth, 0.005)), (line, depth)
