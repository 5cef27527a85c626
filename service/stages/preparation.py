"""From a STEP file and a setup to zones: the first half of the chain, shared by planning and the dry check."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from pathlib import Path

import numpy as np

from geometry.errors import SetupError
from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import Part
from geometry.sampling import SurfaceSamples, joined, sample_borders, sample_surface, with_surface_normals
from geometry.tool_body import ToolBody
from geometry.trimming.trim import FacePatch
from schemas.setup import Access, Setup
from service.from_wire import face_numbers
from service.part_reading import PartReading
from service.stages.blank_model import Blank
from service.stages.job_inputs import JobInputs
from service.stages.job_part import JobPart, Progress, read_job_part
from service.stages.sample_spacing import coarse_sets, coarse_spacing
from zones.features.decomposition import decompose
from zones.lattice import lattice_step
from zones.machinable_area import machinable_faces
from zones.model import Decomposition
from zones.plan_view.categories import Categories
from zones.plan_view.channel_plan import ChannelPlan
from zones.plan_view.regions import RegionLocator
from zones.reach.access_reach import Reach
from zones.reach.access_view import View, access_rotation, turned, turned_samples
from zones.reach.approach_cones import directions_over_hemisphere
from zones.reach.index_orientations import DIRECTIONS, AxisCoverage, orientations
from zones.reach.tip_field import DiscHeights, TipField
from zones.remainder.obstructions import AIR
from zones.zoning.zone_patches import zone_patches
from zones.zoning.zones import ZoneArea, Zoning, build_zones

PLANNING_DENSITY = 25.0  # samples a mm²
MAX_SAMPLES = 1_500_000
MIN_FACE_SAMPLES = 1200.0  # on a face, as far as MAX_DENSITY allows
MAX_DENSITY = 150.0
BORDER_SPACING = 0.2  # mm
BORDER_INSET = 0.0  # mm: on the border itself
MIN_ACCESS_GAIN_MM2, MIN_ACCESS_GAIN_SHARE = 10.0, 0.002  # area, and share of Ma, that a further tool axis must win
TABLE, TABLE_SPARE = 1000.0, 0.01  # mm: half width of the table, and clearance that planning adds above it
UPRIGHT = 1.0 - 1e-12  # Z of a unit tool axis, from which on it counts as upright
MAX_ROOM = 60.0  # mm beyond the cutter's radius that the planning lattice covers beside a large block

@dataclass(frozen=True, eq=False)
class Prepared:
    """A part with everything that is known before the first pass is laid.

    inputs        : JobInputs, the converted setup
    part          : Part in the setup frame
    blank         : Blank, the stock before the first cut
    accesses      : of the setup, then those found for a machine with rotary axes
    views         : one per access, each in its own frame
    decomposition : in the frame of the first view, like the samples
    samples       : of the machinable area, planning density
    zoning        : zones, each in the frame of its view
    seen_from     : (d, 3) float64, dimensionless, setup frame: unit directions that the machinable area is seen from
    lift          : mm, distance along the normal within which a tool touches a sample
    warnings      : sentences for the report and the headers of programs
    """

    inputs: JobInputs
    part: Part
    blank: Blank
    accesses: tuple[Access, ...]
    views: tuple[View, ...]
    decomposition: Decomposition
    zoning: Zoning
    seen_from: F64
    lift: float
    warnings: tuple[str, ...]

    @property
    def samples(self) -> SurfaceSamples:
        """The samples in the frame of the first view."""
        return self.views[0].samples

    @property
    def zones(self) -> tuple[ZoneArea, ...]:
        """The zones in machining order."""
        return self.zoning.zones

    @cached_property
    def patches(self) -> dict[str, tuple[FacePatch, ...]]:
        """Trimmed faces of every zone; of the remainder under ''."""
        return zone_patches(self.views[0], self.zones)

    def view(self, access: str) -> View:
        """The view of an access id."""
        return next(v for v in self.views if v.id == access)


def table_height(inputs: JobInputs, blank: Blank) -> float:
    """Height that a tilted tool stays above, mm, setup frame: the table, or the bottom of the blank if unknown."""
    return blank.seat if inputs.machine.table_z_mm is None else inputs.machine.table_z_mm


def obstacle_mesh(part: Part, inputs: JobInputs, *, table: float | None = None) -> TriangleMesh:
    """The part and the fixture boxes, these grown by the rapid clearance, as one mesh.

    table : mm, setup frame, height of the machine table, which a tilted tool must avoid; None: no table
    """
    vertices, faces, ids = [part.mesh.vertices], [part.mesh.faces], [part.mesh.face_ids]
    n = len(part.mesh.vertices)
    boxes = [*inputs.fixtures]
    if table is not None:
        middle = part.bounds.mean(axis=0)
        boxes.append(np.array([[middle[0] - TABLE, middle[1] - TABLE, table - TABLE],
                               [middle[0] + TABLE, middle[1] + TABLE, table + TABLE_SPARE]]))
    for box in boxes:
        lo, hi = box[0] - inputs.clearances.rapid, box[1] + inputs.clearances.rapid
        v, f = _box(lo, hi)
        vertices.append(v)
        faces.append((f + n).astype(np.int32))
        ids.append(np.zeros(len(f), np.int32))
        n += len(v)
    return TriangleMesh(np.vstack(vertices), np.vstack(faces), np.concatenate(ids))


def _box(lo: F64, hi: F64) -> tuple[F64, np.ndarray]:
    corners = np.array([[(lo, hi)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)


def planning_room(body: ToolBody, bounds: F64, blank: Blank, rotation: F64) -> float:
    """How far around the part a tool is planned, mm. Beside a large blank it has to pass around the stock there.

    bounds   : (2, 3) float64, mm, of the part in the access frame
    rotation : (3, 3) float64, dimensionless, from the setup frame to the access frame
    """
    around = 0.0
    if blank.stands_alone:
        stock = blank.corners(rotation)
        spare = float(np.max([bounds[0, :2] - stock[0, :2], stock[1, :2] - bounds[1, :2]]))
        around = min(spare + blank.uncertainty + body.widest_radius, MAX_ROOM)
    return body.widest_radius + max(AIR, around)


def prepare(path: Path, setup: Setup, progress: Progress, *, search: bool = True,
            blank_path: Path | None = None, reading: PartReading | None = None,
            begin: Callable[[JobPart], None] | None = None) -> Prepared:
    """Read the part, decompose it, measure the reach of the tools and build zones.

    search     : look for further tool axes on a machine with rotary axes; False: the accesses of the setup only
    blank_path : STEP file of a blank of kind 'step'
    reading    : the reading of this part, where it has begun already
    begin      : called once the part is read, before anything large is made

    Raises
    ------
    CamError
        The part or the setup is wrong, or the reader exceeds its limits; or what ``begin`` raises.
    """
    read = read_job_part(path, setup, progress, blank_path, reading)
    if begin is not None:
        begin(read)
    inputs, part, blank = read.inputs, read.part, read.blank
    progress("zones", 0.12)
    accesses = list(inputs.accesses)
    rotations = [access_rotation(a.direction) for a in accesses]
    first = turned(part, rotations[0])
    decomposition = decompose(first)
    seen_from = _seen_from(inputs, rotations, search)
    samples = planning_samples(first, decomposition, inputs, seen_from @ rotations[0].T)
    channels = ChannelPlan.of(first, decomposition)
    lift = max(inputs.budget.reach, 1.5 * part.chord)
    views: list[View] = []

    def add_view(access: Access) -> None:
        rotation = access_rotation(access.direction)
        views.append(_view(inputs, access.id, part, blank, rotation, rotations[0], samples, decomposition, channels))

    def zoned(known: Sequence[Mapping[str, Reach]] = ()) -> Zoning:
        return build_zones(views, decomposition, inputs.quality.scallop_height_mm, lift, Categories(channels), known)

    for k, access in enumerate(accesses):
        add_view(access)
        progress("zones", 0.14 + 0.08 * (k + 1) / len(accesses))
    zoning = zoned()
    progress("zones", 0.24)
    for access in _further(inputs, part, blank, views, zoning, lift) if search else ():
        accesses.append(access)
        add_view(access)
        progress("zones", 0.25)
    if len(views) > len(zoning.reach):
        zoning = zoned([*zoning.reach, *({} for _ in range(len(views) - len(zoning.reach)))])
    progress("zones", 0.27)
    warnings = (*read.warnings, *decomposition.warnings, *_stood_askew(inputs, part, decomposition))
    return Prepared(inputs, part, blank, tuple(accesses), tuple(views), decomposition, zoning, seen_from, lift,
                    warnings)


def _seen_from(inputs: JobInputs, rotations: list[F64], search: bool) -> F64:
    """(d, 3) float64, dimensionless, setup frame: unit vectors of the accesses and of all axes the machine turns to."""
    given = np.array([r[2] for r in rotations])
    machine = inputs.rotary
    if machine is None or not search or inputs.machine.orientations == "given":
        return given
    axes = directions_over_hemisphere(DIRECTIONS)
    return np.vstack([given, axes[machine.stands(axes)]])


def _further(inputs: JobInputs, part: Part, blank: Blank, views: list[View], zoning: Zoning,
             lift: float) -> list[Access]:
    """Further accesses of a machine with rotary axes, for the area that those of the setup leave."""
    machine = inputs.rotary
    if machine is None or inputs.machine.orientations == "given":
        return []
    samples = views[0].samples
    turn = views[0].rotation
    here = turned_samples(samples, turn.T)
    coverage = AxisCoverage(TriangleTree(obstacle_mesh(part, inputs, table=table_height(inputs, blank))), inputs.bodies,
                        inputs.clearances, inputs.quality.scallop_height_mm, lift, inputs.quality.stock_allowance_mm)
    worth = max(MIN_ACCESS_GAIN_MM2, MIN_ACCESS_GAIN_SHARE * float(samples.area.sum()))
    known = np.array([v.direction for v in views])
    axes = orientations(here.subset(np.flatnonzero(~zoning.taken)), coverage, machine.stands, machine.even, known,
                        worth)
    names = (f"I{k}" for k in count(1) if f"I{k}" not in {a.id for a in inputs.accesses})
    offset = inputs.accesses[0].work_offset
    return [Access(id=next(names), direction=[round(v, 12) + 0.0 for v in axis], work_offset=offset)
            for axis in axes.tolist()]


def _stood_askew(inputs: JobInputs, part: Part, decomposition: Decomposition) -> tuple[str, ...]:
    """A warning where no wall stands along the first access, although walls stand along another one."""
    if decomposition.walls:
        return ()
    for access in inputs.accesses[1:]:
        count = len(decompose(turned(part, access_rotation(access.direction))).walls)
        if count:
            first = inputs.accesses[0].id
            return (f"no wall stands along the first access, {first}, and {count} stand along {access.id}; walls are "
                    f"found along the first access only: name {access.id} first",)
    return ()


def tip_field(inputs: JobInputs, blank: Blank, rotation: F64, standing: DiscHeights, bounds: F64,
              body: ToolBody) -> TipField:
    """Tip limits of a tool along an access, over the part, the room beside it and the blank.

    blank    : Blank in the setup frame
    rotation : (3, 3) float64, dimensionless, from the setup frame to the access frame
    standing : DiscHeights of part and fixtures, access frame
    bounds   : (2, 3) float64, mm, of the part in the access frame
    """
    room = planning_room(body, bounds, blank, rotation)
    return TipField(standing.tree, body, inputs.clearances, bounds, room, lattice_step(body),
                    inputs.quality.stock_allowance_mm, inputs.quality.scallop_height_mm, standing)


def _view(inputs: JobInputs, name: str, part: Part, blank: Blank, rotation: F64, first: F64, samples: SurfaceSamples,
          decomposition: Decomposition, channels: ChannelPlan) -> View:
    """An access: the part turned into its frame, tip limits of all tools, regions of the samples."""
    is_first = rotation is first or np.array_equal(rotation, first)
    here = turned(part, rotation)
    tree = TriangleTree(here.mesh)
    table_known = inputs.machine.table_z_mm is not None
    obstacles, leaning = tree, inputs.turns and (table_known or rotation[2, 2] < UPRIGHT)
    if inputs.fixtures or leaning:
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        table = table_height(inputs, blank) if leaning else None
        obstacles = TriangleTree(obstacle_mesh(part, inputs, table=table).transformed(matrix))
    standing = DiscHeights(obstacles)
    fields = {b.id: tip_field(inputs, blank, rotation, standing, here.bounds, b) for b in inputs.bodies}
    seen = turned_samples(samples, rotation @ first.T)
    locator = RegionLocator(here, decomposition, channels, first=is_first)
    there = None if is_first else (samples.points, samples.normals)
    labels = locator.of(seen.points, seen.normals, seen.face, there)
    return View(name, rotation, here, tree, obstacles, seen, labels, fields, locator, first)


def planning_samples(part: Part, decomposition: Decomposition, inputs: JobInputs, directions: F64) -> SurfaceSamples:
    """The samples that zones are built of and passes are measured at, in the frame of the part.

    Every face gets ``PLANNING_DENSITY`` samples a mm², a small one more: ``MIN_FACE_SAMPLES`` or ``MAX_DENSITY``. A
    large plane that is level or upright has fewer inside (``service.stages.sample_spacing``). The borders of a face get
    a sample every ``BORDER_SPACING`` mm, so that the deepest and the outermost place of a zone are among them. Normals
    are those of the exact surface: with the normals of facets a tool would stand too far aside to fit into a fillet.

    directions : (d, 3) float64, dimensionless, frame of the part: unit vectors the area is seen from
    """
    triangles = machinable_triangles(part, decomposition.seat, inputs, directions)
    ids, areas = part.mesh.face_ids[triangles], part.mesh.areas[triangles]
    wide = coarse_spacing(part, inputs, directions)
    close = areas[~np.isin(ids, list(wide))]
    thin = min(1.0, MAX_SAMPLES / max(PLANNING_DENSITY * float(close.sum()), 1e-9))
    sets = coarse_sets(part.mesh, triangles, wide, PLANNING_DENSITY**-0.5)
    for face in np.setdiff1d(ids, list(wide)):
        mine = triangles[ids == face]
        area = float(part.mesh.areas[mine].sum())
        density = max(PLANNING_DENSITY * thin, min(MIN_FACE_SAMPLES / max(area, 1e-9), MAX_DENSITY))
        sets.append(sample_surface(part.mesh, density, seed=int(face), triangles=mine))
    sets.append(sample_borders(part.mesh, BORDER_SPACING, BORDER_INSET, triangles))
    return with_surface_normals(joined(sets), part.mesh)


def machinable_triangles(part: Part, seat: Collection[int], inputs: JobInputs, directions: F64) -> np.ndarray:
    """The mesh triangles of the machinable area Ma, (n,) int64, index.

    seat       : numbers of the faces that the part stands on
    directions : (d, 3) float64, dimensionless, frame of the part: unit vectors the area is seen from

    Raises
    ------
    SetupError
        The setup names faces the part does not have.
    """
    wanted = None if inputs.operations.faces is None else set(face_numbers(inputs.operations.faces))
    excluded = set(face_numbers(inputs.operations.exclude_faces))
    known = {f.number for f in part.faces}
    if unknown := sorted(((wanted or set()) | excluded) - known):
        raise SetupError(f"faces {', '.join(f'F{f}' for f in unknown)} do not exist; the part has F1 to "
                         f"F{len(part.faces)}", code="no_such_face", subjects=tuple(f"F{f}" for f in unknown),
                         limit=len(part.faces), remedy="name faces of zones.json")
    mesh = part.mesh
    facets = SurfaceSamples(mesh.triangles.mean(axis=1), mesh.normals, mesh.areas, mesh.face_ids,
                            np.arange(len(mesh.faces), dtype=np.int32))
    faces = machinable_faces(facets, seat, wanted, excluded, directions)
    return np.flatnonzero(np.isin(part.mesh.face_ids, sorted(faces)))
