"""Faces that need few samples inside, by what the tools of the setup can leave there.

Passes on a slope leave a cusp between every two of them, so samples must lie close. On a level plane a flat end leaves
nothing within its passes, and on an upright plane an upright side leaves nothing within its layers. What can stay
there is a place no pass has gone over: as wide as a pass, or at the border of the face. So such faces have samples
close together near their borders and wide apart inside (docs/theory/sampling.md).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64, TriangleMesh
from geometry.part import Part
from geometry.sampling import SurfaceSamples, graded_samples, joined, split_cells
from geometry.tool_body import ToolBody
from service.stages.job_inputs import JobInputs
from zones.machinable_area import LEVEL, SEEN, AreaForm
from zones.zoning.zones import ZoneArea

LEAST_AREA = 500.0  # mm²: a smaller face has close samples everywhere
WIDEST, LEAST = 0.5, 0.2  # mm between coarse samples: never more; where fewer would do, close ones are taken
FLOOR_SHARE = 0.25  # of the radius of the flat bottom: the planner's lines over a floor reach that far round a sample
WALL_SHARE = 0.5  # of the radius of the tool, the same along a wall
UPRIGHT = 1e-7  # component of a unit normal along the access: less is upright
# Sides of a coarse cell: this near to a border of the face all samples are close. Half a side is the least: the square
# that the proof looks at holds the place of the cell, whichever way it is turned, and must not leave the face.
MARGIN = 0.5
NEIGHBOURS = 8  # planning samples round a coarse one that must have the same zone


def coarse_spacing(part: Part, inputs: JobInputs, directions: F64) -> dict[int, float]:
    """Distance between the samples inside the faces that need few, mm, by face number.

    directions : (d, 3) float64, dimensionless, frame of the part: unit vectors the area is seen from

    Empty on a machine with rotary axes: a tool that leans leaves cusps on planes, too.
    """
    if inputs.turns or not inputs.bodies:
        return {}
    flats = [b.flat_radius for b in inputs.bodies if b.flat_radius > 0.0]
    floor = FLOOR_SHARE * min(flats, default=0.0)
    wall = WALL_SHARE * min((b.radius for b in inputs.bodies if _upright(b)), default=0.0)
    mesh, out = part.mesh, {}
    area = np.bincount(mesh.face_ids, weights=mesh.areas)
    for face in part.faces:
        if face.surface != "plane" or face.number >= len(area) or area[face.number] < LEAST_AREA:
            continue
        normals = mesh.normals[mesh.face_ids == face.number]
        if (normals @ normals[0]).min() < 1.0 - 1e-9:
            continue
        height = directions @ normals[0]
        seen = height[height > SEEN]
        level, upright = seen > LEVEL, np.abs(seen) < UPRIGHT
        if not len(seen) or not (level | upright).all():
            continue
        spacing = min(WIDEST, *([floor] if level.any() else []), *([wall] if upright.any() else []))
        if spacing >= LEAST:
            out[face.number] = spacing
    return out


def _upright(tool: ToolBody) -> bool:
    """Whether the side of a tool is upright where it meets walls: that of a barrel is its large arc."""
    return tool.taper <= 0.0 and tool.form != "barrel"


def coarse_sets(mesh: TriangleMesh, triangles: NDArray[np.int64], spacing: Mapping[int, float],
                close: float) -> list[SurfaceSamples]:
    """Samples of the faces that need few.

    triangles : (k,) int64, index of the triangles to sample
    spacing   : mm by face number, as ``coarse_spacing`` gives it
    close     : mm between samples near borders
    """
    ids = mesh.face_ids[triangles]
    return [graded_samples(mesh, triangles[ids == face], apart, parts_of(apart, close), MARGIN * apart)
            for face, apart in spacing.items() if (ids == face).any()]


def parts_of(spacing: float, close: float) -> int:
    """Number of close samples along the side of a coarse cell, odd. spacing, close : mm."""
    return 2 * int(np.ceil((spacing / close - 1.0) / 2.0 - 1e-9)) + 1


def split_where_zones_meet(samples: SurfaceSamples, planning: SurfaceSamples, zones: tuple[ZoneArea, ...],
                           close: float) -> SurfaceSamples:
    """The samples with close ones in place of coarse ones wherever more than one zone, or a ball, may answer.

    samples  : of the proof
    planning : the samples that zones are built of, same frame
    zones    : their rows are those of ``planning``
    close    : mm between close samples

    A coarse sample stays where all planning samples near it belong to one zone, or all to none. On a level plane the
    tool of that zone must have a flat bottom, on an upright one an upright side.
    """
    if samples.covers is None:
        return samples
    owner = np.zeros(len(planning), np.int64)
    for k, zone in enumerate(zones, start=1):
        owner[zone.samples] = k
    fits = np.array([True, *(z.tool.flat_radius > 0.0 if z.form is AreaForm.LEVEL else _upright(z.tool)
                             for z in zones)])
    wide = samples.covers > 0
    split = np.zeros(len(samples), np.bool_)
    for face in np.unique(samples.face[wide]).tolist():
        rows, there = np.flatnonzero(wide & (samples.face == face)), np.flatnonzero(planning.face == face)
        if not len(there):
            split[rows] = True
            continue
        owners = owner[there]
        if (owners == owners[0]).all():
            split[rows] = not fits[owners[0]]
            continue
        near = cKDTree(planning.points[there]).query(samples.points[rows], k=min(NEIGHBOURS, len(there)), workers=2)[1]
        of = owners[near.reshape(len(rows), -1)]
        split[rows] = (of != of[:, :1]).any(axis=1) | ~fits[of[:, 0]]
    if not split.any():
        return samples
    finer = []
    for covers in np.unique(samples.covers[split]).tolist():
        cells = samples.subset(split & (samples.covers == covers))
        finer.append(split_cells(cells, parts_of(covers * np.sqrt(2.0), close))[0])
    return joined([samples.subset(~split), *finer])
