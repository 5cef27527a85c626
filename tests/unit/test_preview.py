"""The rasteriser against closed forms, the picture against what must be seen in it."""

import numpy as np
import pytest
from PIL import Image

from geometry.mesh import TriangleMesh
from geometry.part import EdgeInfo, EdgeKind, FaceInfo, Part
from service.camera import Camera
from service.lettering import scale_length
from service.preview import CONNECTION, REMAINDER, SIZE, TOOLS, draw_preview, wall_colour
from service.raster import Canvas
from tests.synthetic_plan import BALL, line, step
from toolpath.motion import Motion
from zones.model import Connection, Decomposition, Wall


def box(low, high, first):
    """Vertices, triangles and face numbers first..first+5 of a box, outward."""
    x, y, z = zip(low, high, strict=True)
    v = np.array([[x[i], y[j], z[k]] for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    f = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return v, np.array(f), np.repeat(np.arange(first, first + 6), 2)


@pytest.fixture(scope="module")
def bridge():
    """A plate, two walls on it, and a bar between them."""
    solids = [box((0, 0, 0), (40, 20, 3), 1), box((2, 5, 3), (38, 7, 13), 7), box((2, 13, 3), (38, 15, 13), 13),
              box((18, 7, 8), (22, 13, 10), 19)]
    count = np.cumsum([0] + [len(v) for v, _, _ in solids])
    mesh = TriangleMesh(np.concatenate([v for v, _, _ in solids]),
                        np.concatenate([f + n for (_, f, _), n in zip(solids, count, strict=False)]),
                        np.concatenate([i for _, _, i in solids]))
    assert mesh.volume == pytest.approx(40 * 20 * 3 + 2 * 36 * 2 * 10 + 4 * 6 * 2)
    faces = tuple(FaceInfo(n, "plane", 1.0, False, 0.0, 0.0) for n in range(1, 25))
    edge = EdgeInfo((7, 8), EdgeKind.CONVEX, 36.0, 1.57, np.array([[2.0, 5, 13], [38.0, 5, 13]]))
    part = Part(mesh, faces, (edge,), mesh.volume, mesh.bounds, "mm", 0.01, 0.2, 0.0, (), "0" * 64)
    roles = dict.fromkeys(range(1, 7), "base") | {2: "floor"} | dict.fromkeys(range(7, 19), "wall")
    walls = (Wall("W1", tuple(range(7, 13)), (9, 10), 2.0, 3.0, 13.0),
             Wall("W2", tuple(range(13, 19)), (15, 16), 2.0, 3.0, 13.0))
    bar = Connection("C1", tuple(range(19, 25)), ("W1", "W2"), 8.0, 10.0)
    return part, Decomposition(walls, (bar,), (), roles | dict.fromkeys(range(19, 25), "connection"))


def near(picture, colour, tolerance=30):
    """How many pixels have that colour."""
    wanted = np.array(colour) * 255.0
    return int((np.abs(picture.astype(float) - wanted).max(axis=-1) < tolerance).sum())


def hues(picture, colour):
    """How many pixels have the hue of that colour, in light or shade."""
    p = picture.astype(float)
    c = np.array(colour)
    strong = p.max(axis=-1) - p.min(axis=-1) > 60
    unit = p / np.maximum(np.linalg.norm(p, axis=-1, keepdims=True), 1.0)
    return int((strong & (unit @ (c / np.linalg.norm(c)) > 0.995)).sum())


def draw(tmp_path, bridge, name="a.png", remainder=None, steps=()):
    part, decomposition = bridge
    file = tmp_path / name
    draw_preview(part, decomposition, {n: "Z1" for n in range(7, 25)}, steps, remainder, file, "bridge",
                 {"coverage": "98 %"})
    return file


def pictures(file):
    image = np.asarray(Image.open(file))
    assert image.shape == (SIZE[1], SIZE[0], 3)
    half = SIZE[0] // 2
    return image[60:820, :half], image[60:820, half:]


def test_connections_and_both_walls_are_seen(tmp_path, bridge):
    left, right = pictures(draw(tmp_path, bridge))
    assert hues(left, CONNECTION) > 2000
    for index in (0, 1):
        assert hues(left, wall_colour(index)) > 2000
    assert hues(right, CONNECTION) == 0 or hues(right, CONNECTION) < hues(left, CONNECTION) / 4


def test_paths_have_the_colour_of_their_tool_and_remainder_is_red(tmp_path, bridge):
    cut = tuple(line(Motion.CUT, (0, y, 14), (40, y, 14), feed=100) for y in np.arange(0.0, 20.0, 0.25))
    red = np.array([[18 + 0.1 * i, 8 + 0.1 * j, 10.0] for i in range(40) for j in range(40)])
    left, right = pictures(draw(tmp_path, bridge, "b.png", red, [step(1, BALL, "floor", trajectories=cut)]))
    assert near(right, TOOLS[0], 90) > 2000 and near(left, TOOLS[0], 60) < 500
    assert hues(right, REMAINDER) > 1000 and hues(left, REMAINDER) < 20


def test_same_bytes_twice(tmp_path, bridge):
    assert draw(tmp_path, bridge, "one.png").read_bytes() == draw(tmp_path, bridge, "two.png").read_bytes()


def test_a_part_without_walls_or_paths_is_drawn(tmp_path, bridge):
    file = tmp_path / "plain.png"
    draw_preview(bridge[0], Decomposition((), (), ()), None, [], None, file, "Größe ✓")
    assert pictures(file)[0].std() > 5.0


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
