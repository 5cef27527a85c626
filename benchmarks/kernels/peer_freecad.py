"""Run by ``freecadcmd``, started by ``bench_peer.py``: one program through FreeCAD's own path simulator.

Not of our making and on nothing of ours: ``PathSimulator`` keeps one height a square of a raster. The folder named in
ZONEMILL_PEER holds ``ask.npz`` (stock (2, 3), tools (k, 2) radius and corner radius, tool (m,) rows of it, start and
end (m, 3), resolutions (r,), all mm); ``told.npz`` is written beside it: volume (r, 2) mm³ before and after, and
seconds (r,).

Ramps are given as stairs a quarter of the resolution off at most: FreeCAD 0.20 divides the rise of a move by the
squares across the tool instead of those along its way.
"""

import math
import os
import time
from pathlib import Path

import FreeCAD
import numpy as np
import Part
import Path as Cam
import PathSimulator

FLUTES = 60.0


def solid(radius, corner):
    """A ball or flat mill that stands on its tip."""
    if corner == 0.0:
        return Part.makeCylinder(radius, FLUTES)
    top = FreeCAD.Vector(0, 0, radius)
    return Part.makeSphere(radius, top).fuse(Part.makeCylinder(radius, FLUTES, top))


def volume(meshes):
    """mm³ between the level facets; the meshes are open, as small steps between squares get no wall."""
    total = 0.0
    for mesh in meshes:
        points, facets = mesh.Topology
        if len(facets):
            t = np.array([[p.x, p.y, p.z] for p in points])[np.array(facets)]
            u, v = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
            total += float((t[:, :, 2].mean(axis=1) * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])).sum()) / 2.0
    return total


def stairs(a, b, rise):
    """Places on the way from a to b with steps of ``rise`` mm where it climbs and goes aside at once."""
    if a[2] == b[2] or math.hypot(b[0] - a[0], b[1] - a[1]) < 1e-9:
        return [b]
    n = math.ceil(abs(b[2] - a[2]) / rise)
    out = []
    for k in range(n):
        z = a[2] + (k + 0.5) / n * (b[2] - a[2])
        for s in (k / n, (k + 1) / n):
            out.append([a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), z])
    return [*out, b]


def go(sim, a, b):
    """Cut from a to b."""
    place = FreeCAD.Placement(FreeCAD.Vector(*a), FreeCAD.Rotation())
    sim.ApplyCommand(place, Cam.Command("G1", {"X": b[0], "Y": b[1], "Z": b[2]}))


def run(ask, resolution):
    """Volumes before and after."""
    low, high = ask["stock"]
    block = Part.makeBox(*(high - low), FreeCAD.Vector(*low))
    sim = PathSimulator.PathSim()
    sim.BeginSimulation(stock=block, resolution=resolution)
    shapes = [solid(*t) for t in ask["tools"]]
    sim.SetToolShape(shapes[0], resolution)
    before, now, here = volume(sim.GetResultMesh()), 0, None
    for row, a, b in zip(ask["tool"].tolist(), ask["start"].tolist(), ask["end"].tolist(), strict=True):
        if row != now:
            sim.SetToolShape(shapes[row], resolution)
            now = row
        if here != a:  # a move cuts round its end alone: where a new chain begins, the tool comes down first
            go(sim, a, a)
        for p in stairs(a, b, 0.5 * resolution):
            go(sim, a, p)
            a = p
        here = b
    return before, volume(sim.GetResultMesh())


folder = Path(os.environ["ZONEMILL_PEER"])
with np.load(folder / "ask.npz") as given:
    question = {key: given[key] for key in given.files}
told, seconds = [], []
for width in question["resolutions"].tolist():
    began = time.perf_counter()
    told.append(run(question, width))
    seconds.append(time.perf_counter() - began)
np.savez(folder / "told.npz", volume=np.array(told), seconds=np.array(seconds), version=FreeCAD.Version()[:3])
