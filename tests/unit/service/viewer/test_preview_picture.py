"""The rasteriser against closed forms, the picture against what must be seen in it, its colours against the page's."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from geometry.part import EdgeInfo, EdgeKind
from service.pictures import deviation_map
from service.pictures.annotation import scale_length
from service.pictures.camera import Camera
from service.pictures.rasterizer import Canvas
from service.viewer import preview_picture
from service.viewer.preview_picture import REMAINDER, SIZE, TOOLS, draw_preview, zone_colour
from service.viewer.view_file import Chunk, Column, write_view
from service.viewer.view_mesh import GRID, LEFT_UNIT, Facets, edge_chunk, mesh_chunks
from tests.hand_parts import as_part, box_mesh, joined

LOW = np.array([-5.0, -5.0, -5.0])


@pytest.fixture(scope="module")
def bridge():
    """A plate, two walls on it, and a bar between them, in facets: the walls are zones, the bar's outside stays."""
    part = as_part(joined(box_mesh((0, 0, 0), (40, 20, 3)), box_mesh((2, 5, 3), (38, 7, 13)),
                          box_mesh((2, 13, 3), (38, 15, 13)), box_mesh((18, 7, 8), (22, 13, 10))))
    edge = EdgeInfo((7, 8), EdgeKind.CONVEX, 36.0, 1.57, np.array([[2.0, 5, 13], [38.0, 5, 13]]))
    object.__setattr__(part, "edges", (edge,))
    t = len(part.mesh.faces)
    assert t == 48
    face = np.repeat(np.arange(t) // 2 + 1, 3).astype(np.int32)
    label = np.array([3, 0, 1, 2])[np.arange(t) // 12]
    facets = Facets(part.mesh.triangles.reshape(-1, 3), np.repeat(part.mesh.normals, 3, axis=0), face, np.zeros(3 * t),
                    np.ones(3 * t, np.int64), np.arange(3 * t).reshape(-1, 3), label)
    return part, facets


def view(bridge, ways=(), state="proved"):
    """A view file; ``ways`` are rows of (places, kinds) of finishing steps."""
    part, facets = bridge
    mesh, finer = mesh_chunks(facets, LOW)
    paths = [Chunk("path", {"step": k, "lod": 0}, {
        "place": Column(np.rint((np.array(p) - LOW) / GRID), 4, "steps"), "kind": Column(np.array(kind), 1),
        "time": Column(np.arange(len(p)), 4, "steps")}) for k, (p, kind) in enumerate(ways)]
    step = {"operation": "finishing", "tool": 1, "axis": [0.0, 0.0, 1.0]}
    head = {"low_mm": LOW.tolist(), "mesh_grid_mm": GRID, "path_grid_mm": GRID, "left_unit_mm": LEFT_UNIT,
            "axis_unit": 32000, "bounds_mm": part.bounds.tolist(), "state": state,
            "labelled": [{"zone": "Z1"}, {"zone": "Z2"}, {"remainder": 0}, {"other": True}],
            "zones": [{"id": "Z1"}, {"id": "Z2"}], "walls": [{"id": "W1", "at_mm": [20, 6, 13], "faces": [7]}],
            "connections": [{"id": "C1", "at_mm": [20, 10, 10], "faces": [19, 20, 21, 22, 23, 24]}],
            "remainder": [{"reason": "undercut behind connection C1", "area_mm2": 12.0}],
            "tools": [{"number": 1, "kind": "ball", "diameter_mm": 3.0}], "steps": [step] * len(ways)}
    return write_view(head, [*mesh, edge_chunk(part, LOW, 1.0), *paths, *finer])


def near(picture, colour, tolerance=30):
    """How many pixels have that colour."""
    wanted = np.array(colour) * 255.0
    return int((np.abs(picture.astype(float) - wanted).max(axis=-1) < tolerance).sum())


def hues(picture, colour):
    """How many pixels have the hue of that colour, in light or shade."""
    p = picture.astype(float)
    c = np.array(colour)
    strong = p.max(axis=-1) - p.min(axis=-1) > 40
    unit = p / np.maximum(np.linalg.norm(p, axis=-1, keepdims=True), 1.0)
    return int((strong & (unit @ (c / np.linalg.norm(c)) > 0.998)).sum())


def pictures(file):
    image = np.asarray(Image.open(file))
    assert image.shape == (SIZE[1], SIZE[0], 3)
    half = SIZE[0] // 2
    return image[60:820, :half], image[60:820, half:]


def draw(tmp_path, data, name="a.png"):
    draw_preview(data, tmp_path / name, "Größe ✓", {"coverage": "98 %"})
    return pictures(tmp_path / name)


def test_zones_have_their_colours_and_what_stays_is_hatched(tmp_path, bridge):
    left, right = draw(tmp_path, view(bridge))
    for index in (0, 1):
        assert hues(left, zone_colour(index)) > 2000 > 4 * hues(right, zone_colour(index))
    # stripes: both of the two colours, next to each other
    red = near(left, REMAINDER, 40)
    assert red > 150 and near(left, preview_picture.HATCHED, 40) > 150
    assert near(left, preview_picture.OTHER, 60) > 2000


def test_ways_have_the_colour_of_their_tool_and_those_up_and_down_are_faint(tmp_path, bridge):
    y = np.repeat(np.arange(0.0, 20.0, 0.5), 2)
    x = np.resize([0.0, 40.0, 40.0, 0.0], len(y))
    cuts = (np.column_stack([x, y, np.full(len(y), 14.0)]), [0, *[2] * (len(y) - 1)])
    left, right = draw(tmp_path, view(bridge, [cuts]))
    assert near(right, TOOLS[0], 90) > 2000 > 10 * near(left, TOOLS[0], 60)
    z = np.resize([14.0, 30.0, 30.0, 14.0], len(y))
    lifts = (np.column_stack([0.2 * np.arange(len(y)) // 0.4, y, z]), cuts[1])
    assert near(draw(tmp_path, view(bridge, [lifts]), "b.png")[1], TOOLS[0], 90) < 500
    rapids = (cuts[0], [0, *[1] * (len(y) - 1)])
    assert near(draw(tmp_path, view(bridge, [rapids]), "c.png")[1], TOOLS[0], 90) < 50


def test_same_bytes_twice(tmp_path, bridge):
    data = view(bridge)
    draw(tmp_path, data, "one.png"), draw(tmp_path, data, "two.png")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()


def test_the_view_with_most_of_what_stays_is_chosen(bridge, tmp_path):
    """The bar stands between the walls: from along them it is seen, from the side it is not."""
    left, _ = draw(tmp_path, view(bridge))
    from service.viewer.view_file import read_view

    camera = preview_picture._camera(preview_picture.Drawn.of(*read_view(view(bridge)), 0), (400, 400))
    across = abs(camera.basis[2] @ [0.0, 1.0, 0.0])
    assert across < 0.6 and near(left, REMAINDER, 40) > 150


def test_reasons_are_told_once_with_their_area():
    rows = [{"reason": "corner", "area_mm2": 2.0}, {"reason": "undercut", "area_mm2": 30.0},
            {"reason": "corner", "area_mm2": 3.5}]
    assert preview_picture._reasons(rows) == ["30 mm2 stay: undercut", "5.5 mm2 stay: corner (2 places)"]
    many = [{"reason": f"r{k}", "area_mm2": 10.0 - k} for k in range(8)]
    assert len(preview_picture._reasons(many)) == preview_picture.MAX_REASONS
    assert preview_picture._reasons(many)[-1] == "18.0 mm2 for 4 more reasons"


def test_colours_and_classes_are_those_of_the_page():
    source = (Path(__file__).parents[4] / "web" / "src" / "scene" / "colours.ts").read_text()

    def rows(name):
        body = re.search(rf"const {name}: RGB(?:\[\])? = (.*?);", source, re.S)[1]
        numbers = [float(v) for v in re.findall(r"\d+(?:\.\d+)?", body)]
        return np.array(numbers).reshape(-1, 3)

    assert np.allclose(rows("TOOLS"), preview_picture.TOOLS)
    for name in ("REMAINDER", "OTHER", "CONNECTION"):
        assert np.allclose(rows(name), [getattr(preview_picture, name)])
    assert np.allclose(rows("CLASSES"), deviation_map.COLOURS[:deviation_map.UNCUT])
    assert np.allclose(rows("UNCUT"), [deviation_map.COLOURS[deviation_map.UNCUT]])
    assert f"STEPS = [{deviation_map.STEPS[0]:g}, {deviation_map.STEPS[1]:g}]" in source
    hue = re.search(r"const hue = ([\d.]+) \+ ([\d.]+) \* \(\(index \* ([\d.]+)\) % 1\)", source).groups()
    assert [float(v) for v in hue] == [0.15, 0.76, 0.381966]
    assert zone_colour(0) == pytest.approx((0.8176, 0.7781, 0.4224), abs=1e-4)


def test_camera_rows_are_a_right_handed_frame_and_points_fit():
    points = np.random.default_rng(1).uniform(-50, 90, (200, 3))
    camera = Camera.fit(points, (400, 300), azimuth=0.7, elevation=0.6)
    assert np.allclose(camera.basis @ camera.basis.T, np.eye(3)) and np.linalg.det(camera.basis) == pytest.approx(1.0)
    screen = camera.screen(points)
    assert screen[:, 0].min() > 0 and screen[:, 0].max() < 400 and screen[:, 1].min() > 0 and screen[:, 1].max() < 300
    above = camera.screen(np.array([[0.0, 0, 0], [0.0, 0, 1]]))
    assert above[1, 1] < above[0, 1] and above[1, 2] > above[0, 2]


def test_triangle_covers_its_area_and_the_nearer_one_wins():
    canvas = Canvas.blank(200, 100, (0, 0, 0))
    corners = np.array([[[10.0, 10, 5], [110, 10, 5], [10, 90, 5]], [[10.0, 10, 9], [60, 10, 9], [10, 50, 9]]])
    canvas.triangles(corners, np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.array([1, 2]))
    assert (canvas.owner == 1).sum() + (canvas.owner == 2).sum() == pytest.approx(4000, rel=0.02)
    assert (canvas.owner == 2).sum() == pytest.approx(1000, rel=0.04)
    canvas.triangles(corners[::-1], np.array([[0, 1.0, 0], [1.0, 0, 0]]), np.array([2, 1]))
    assert canvas.owner[15, 15] == 2


def test_strokes_are_hidden_by_what_stands_before_them_and_blend_once():
    canvas = Canvas.blank(100, 100, (0, 0, 0))
    wall = np.array([[[50.0, 0, 5], [100, 0, 5], [100, 100, 5]], [[50.0, 0, 5], [100, 100, 5], [50, 100, 5]]])
    canvas.triangles(wall, np.zeros((2, 3)), np.array([1, 1]))
    canvas.strokes(np.array([[[10.0, 50.5, 0], [90, 50.5, 0]]]), (1, 1, 1), width=3, alpha=0.5, hidden=0.125)
    row = canvas.colour[50, :, 0]
    assert np.allclose(row[11:49], 0.5) and np.allclose(row[51:89], 0.125) and (row[:10] == 0).all()
    assert (canvas.colour[:, 30, 0] > 0).sum() == 3


def test_dashes_are_half_of_the_line():
    canvas = Canvas.blank(400, 20, (0, 0, 0))
    canvas.strokes(np.array([[[0.0, 10.5, 0], [200, 10.5, 0]], [[200.0, 10.5, 0], [400, 10.5, 0]]]), (1, 1, 1), dash=8)
    assert (canvas.colour[10, :, 0] > 0).sum() == pytest.approx(200, abs=4)


def test_scale_bar_is_a_round_length_that_fits():
    for scale in (0.013, 0.7, 1.0, 9.9, 10.0, 333.0):
        length = scale_length(scale)
        assert 79.9 < length * scale <= 200.0 * (1 + 1e-9)
        assert f"{length:e}"[0] in "125"
