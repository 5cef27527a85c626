"""How large a job is: the lengths of the arrays that its stages will allocate, counted before any of them exists.

Each count follows the rule of the module that allocates the array, with the constants of that module. So a stage that
changes its density or its lattice changes the estimate with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.part import Part
from geometry.tool_body import ToolBody
from service.stages.access_settings import stock_step
from service.stages.blank_model import Blank
from service.stages.job_inputs import JobInputs
from service.stages.job_part import JobPart
from service.stages.preparation import (
    BORDER_SPACING,
    MAX_DENSITY,
    MAX_SAMPLES,
    MIN_FACE_SAMPLES,
    PLANNING_DENSITY,
    machinable_triangles,
    planning_room,
)
from service.stages.proof_samples import PROOF_DENSITY
from service.stages.sample_spacing import coarse_spacing
from verify.material.material import LINES_APART, NODES_APART
from verify.material.stock_field import MAX_NODES
from verify.material.stock_lines import MAX_LINES
from verify.model import ProofSetup
from zones.lattice import Lattice, lattice_step
from zones.reach.access_view import access_rotation

# A machine with rotary axes gets further accesses while its zones are made. Four is the most seen on the parts of
# docs/scale.md, and each costs its own lattices.
FURTHER_ACCESSES = 4
CLOSE_STRIP = 1.25  # coarse cells: mean width of the strip of close samples along a border
UPRIGHT = 1e-3  # component of the normal of a facet along an axis: a facet of an upright cylinder has less
LEAST_END = 0.05  # mm: a radius of an end that counts for the spacing of the stock, where an end is a point


@dataclass(frozen=True)
class JobSize:
    """Lengths of the arrays of a job.

    facets           : triangles of part and blank
    area             : mm², machinable area
    planning_samples : places at which zones are made and passes measured
    proof_samples    : places that the proof measures
    accesses         : tool axes, with those that a machine with rotary axes will get
    tools            : tools of the setup
    tool_nodes       : nodes of the lattices of all tools, along all accesses
    widest_nodes     : nodes of the largest of these lattices
    stock_nodes      : nodes of the planner's stock along all accesses
    proof_nodes      : lines of the proof's stock, or nodes of its field where the tool tilts
    curved_path      : mm of finishing passes over curved faces
    plain_path       : mm of finishing passes over planes and upright cylinders, and of depth layers
    """

    facets: int
    area: float
    planning_samples: int
    proof_samples: int
    accesses: int
    tools: int
    tool_nodes: int
    widest_nodes: int
    stock_nodes: int
    proof_nodes: int
    curved_path: float
    plain_path: float

    @classmethod
    def of(cls, job: JobPart) -> JobSize:
        """Counted from a part that is read and a setup that is converted; a few array operations, no search.

        Raises
        ------
        SetupError
            The setup names faces that the part does not have.
        """
        inputs, part, blank = job.inputs, job.part, job.blank
        rotations = [access_rotation(a.direction) for a in inputs.accesses]
        directions = np.array([r[2] for r in rotations])
        # where the axes turn, every side may be seen: the six of a box stand for all directions
        seen = np.vstack([directions, np.eye(3), -np.eye(3)]) if inputs.turns else directions
        triangles = machinable_triangles(part, (), inputs, seen)
        spacing = coarse_spacing(part, inputs, seen)
        areas = part.mesh.areas[triangles]
        by_face = np.bincount(part.mesh.face_ids[triangles], areas, len(part.faces) + 1).astype(np.float64)
        rims = rim_lengths(part, by_face)
        found = FURTHER_ACCESSES if inputs.turns and inputs.machine.orientations != "given" else 0
        lattices = [lattice_nodes(inputs, blank, part.bounds, rotation, body) for rotation in rotations
                    for body in inputs.bodies]
        # an access that is yet to be found is taken to be as large as the mean of those that are given
        more = (len(rotations) + found) / len(rotations)
        stock = sum(stock_nodes(inputs, blank, rotation) for rotation in rotations)
        curved = float(areas[curved_facets(part, triangles, directions)].sum())
        plain = plain_path(inputs, float(areas.sum()) - curved)
        blank_facets = 0 if blank.solid is None else len(blank.solid.mesh.faces)
        return cls(len(part.mesh.faces) + blank_facets, float(areas.sum()), planning_count(by_face, rims, spacing),
                   proof_count(by_face, rims, spacing), len(rotations) + found, len(inputs.bodies),
                   round(more * sum(lattices)), max(lattices, default=0), round(more * stock),
                   proof_nodes(inputs, blank), curved_path(inputs, curved),
                   plain + rough_path(inputs, blank, part.volume, float(areas.sum())))


def rim_lengths(part: Part, by_face: F64) -> F64:
    """Length of the borders of each face, (n + 1,) float64, mm; that of a circle of its area at least.

    by_face : (n + 1,) float64, mm², machinable area by face number
    """
    out = np.zeros(len(by_face))
    for edge in part.edges:
        out[list(edge.faces)] += edge.length
    return np.where(by_face > 0.0, np.maximum(out, 2.0 * np.sqrt(math.pi * by_face)), 0.0)


def planning_count(by_face: F64, rims: F64, spacing: dict[int, float]) -> int:
    """Samples of ``service.stages.preparation.planning_samples``.

    by_face : (n + 1,) float64, mm², machinable area by face number
    rims    : (n + 1,) float64, mm, length of the borders by face number
    spacing : mm between the samples inside the faces that need few, by face number
    """
    close = _close(by_face, spacing)
    thin = min(1.0, MAX_SAMPLES / max(PLANNING_DENSITY * float(close.sum()), 1e-9))
    density = np.clip(MIN_FACE_SAMPLES / np.maximum(close, 1e-9), PLANNING_DENSITY * thin, MAX_DENSITY)
    borders = float(rims.sum()) / BORDER_SPACING
    return round(float((density * close).sum()) + _coarse(by_face, rims, spacing, PLANNING_DENSITY) + borders)


def proof_count(by_face: F64, rims: F64, spacing: dict[int, float]) -> int:
    """Samples of ``service.stages.proof_samples.score``.

    by_face : (n + 1,) float64, mm², machinable area by face number
    rims    : (n + 1,) float64, mm, length of the borders by face number
    spacing : mm between the samples inside the faces that need few, by face number
    """
    return round(PROOF_DENSITY * float(_close(by_face, spacing).sum()) + _coarse(by_face, rims, spacing, PROOF_DENSITY))


def _close(by_face: F64, spacing: dict[int, float]) -> F64:
    """The areas of the faces that have close samples all over, mm²."""
    return np.delete(by_face, [n for n in spacing if n < len(by_face)])


def _coarse(by_face: F64, rims: F64, spacing: dict[int, float], density: float) -> float:
    """Samples of the faces that need few: one in each coarse cell, and close ones along their borders."""
    total = 0.0
    for n, apart in spacing.items():
        near = min(CLOSE_STRIP * apart * float(rims[n]), float(by_face[n]))
        total += (float(by_face[n]) - near) / apart**2 + near * density
    return total


def lattice_nodes(inputs: JobInputs, blank: Blank, bounds: F64, rotation: F64, body: ToolBody) -> int:
    """Nodes of the planning lattice of a tool along an access, ``service.stages.preparation.tip_field``.

    bounds   : (2, 3) float64, mm, of the part in the setup frame
    rotation : (3, 3) float64, dimensionless, from the setup frame to the access frame
    """
    corners = np.array([[bounds[i >> k & 1][k] for k in range(3)] for i in range(8)]) @ rotation.T
    here = np.array([corners.min(axis=0), corners.max(axis=0)])
    lattice = Lattice.over(here, planning_room(body, here, blank, rotation), lattice_step(body))
    return lattice.nx * lattice.ny


def stock_nodes(inputs: JobInputs, blank: Blank, rotation: F64) -> int:
    """Nodes of the planner's stock along an access, ``service.stages.access_settings.planning_stock``.

    rotation : (3, 3) float64, dimensionless, from the setup frame to the access frame
    """
    corners, beyond = blank.corners(rotation), blank.uncertainty
    lattice = Lattice.over(corners, beyond, stock_step(inputs, corners))
    return lattice.nx * lattice.ny


def proof_nodes(inputs: JobInputs, blank: Blank) -> int:
    """Lines of the proof's stock, or nodes of its field on a machine with rotary axes."""
    ends = [max(b.radius - b.corner_radius, b.corner_radius, LEAST_END) for b in inputs.bodies]
    spacing = min(ProofSetup.line_spacing, inputs.engagement_spacing,
                  (NODES_APART if inputs.turns else LINES_APART) * min(ends, default=math.inf))
    extent = blank.bounds[1] - blank.bounds[0] + 2.0 * blank.beyond
    if inputs.turns:
        return round(min(MAX_NODES, float(np.prod(extent / spacing + 4.0))))
    return round(min(MAX_LINES, float(np.prod(extent[:2] / spacing + 1.0))))


def curved_facets(part: Part, triangles: NDArray[np.int64], directions: F64) -> NDArray[np.bool_]:
    """Which triangles lie on curved faces, (n,) bool: on no plane, and on no cylinder that stands along a tool axis.

    triangles  : (n,) int64, index
    directions : (d, 3) float64, dimensionless, setup frame, tool axes
    """
    ids = part.mesh.face_ids[triangles]
    upright = np.abs(part.mesh.normals[triangles] @ directions.T) < UPRIGHT
    kinds = {f.number: f.surface for f in part.faces}
    plain = [n for n in np.unique(ids).tolist() if kinds.get(n) == "plane"
             or kinds.get(n) == "cylinder" and upright[ids == n].all(axis=0).any()]
    return ~np.isin(ids, plain)


def curved_path(inputs: JobInputs, area: float) -> float:
    """Length of finishing passes over curved faces, mm: area over side step.

    area : mm², of these faces

    What tool cuts an area shows only with the zones: the side step is the geometric mean of those of all tools.
    """
    if not inputs.operations.finishing or not inputs.bodies:
        return 0.0
    steps = [side_step(b, inputs.quality.scallop_height_mm) for b in inputs.bodies]
    return area / math.exp(sum(map(math.log, steps)) / len(steps))


def plain_path(inputs: JobInputs, area: float) -> float:
    """Length of finishing passes over planes and upright cylinders, mm: area over the radius of the widest tool.

    area : mm², of these faces
    """
    if not inputs.operations.finishing or not inputs.bodies:
        return 0.0
    return area / max(b.radius for b in inputs.bodies)


def side_step(body: ToolBody, height: float) -> float:
    """Side step of a tool on a slope, mm: that of a ball with its corner, or with its radius where it has none.

    height : mm, scallop height
    """
    radius = body.corner_radius or body.radius
    return 2.0 * math.sqrt(height * max(2.0 * radius - height, height))


def rough_path(inputs: JobInputs, blank: Blank, volume: float, area: float) -> float:
    """Length of the passes of the depth layers, mm: stock over the section that the thickest tool takes.

    volume : mm³, of the part;  area : mm², machinable area
    """
    if not inputs.operations.roughing or not inputs.bodies:
        return 0.0
    if blank.stands_alone:
        around = float(np.prod(blank.bounds[1] - blank.bounds[0])) if blank.bar is None else blank.bar.volume
        stock = max((around if blank.solid is None else blank.solid.volume) - volume, 0.0)
    else:
        stock = area * blank.margin
    widest = max(inputs.bodies, key=lambda b: b.radius)
    return stock / (inputs.cut_table[widest.id].step_down * widest.radius)


__all__ = ["JobSize"]
