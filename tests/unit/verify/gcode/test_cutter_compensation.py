"""Cutter radius compensation: offsets by hand, corners by control, contours that cannot be followed."""

import cmath
import math

import numpy as np
import pytest

from geometry.errors import ProgramError
from tests.random_programs import RandomContour
from verify.gcode.cutter_compensation import (
    FANUC_STYLE,
    LINUXCNC_STYLE,
    Approach,
    CompensationError,
    Contour,
    Corner,
    Element,
    Style,
)
from verify.gcode.reader import FEED, read_program

HEAD = "G21 G90 G17 G94 G40 G49 G54\nT10 M6\nS1000 M3\nG43 H10\nG0 X-30. Y0. Z10.\nG1 Z-2. F300.\n"
RADII = {3: 1.5, 10: 5.0}
NORM = Style(Corner.ARC, Approach.NEXT_NORMAL)


def read(body, dialect="fanuc", **options):
    return read_program(HEAD + body + "M30\n", radii=RADII, dialect=dialect, **options)


def ends(program, level=-2.0):
    """Ends of the feed moves in the plane after the plunge."""
    keep = (program.kind == FEED) & (program.line > 6)
    return program.end[keep][:, :2]


def test_a_corner_of_fanuc_outside_and_inside():
    """Left of a square run counterclockwise is inside: the offset square; right of it the corners are cut square."""
    square = "{} D10 X0. Y0. F800.\nX40.\nY40.\nX0.\nY0.\nG40 X-30. Y-30.\n"
    np.testing.assert_allclose(ends(read(square.format("G41"))), [[0, 5], [35, 5], [35, 35], [5, 35], [5, 0],
                                                                  [-30, -30]], atol=1e-9)
    np.testing.assert_allclose(ends(read(square.format("G42"))),
                               [[0, -5], [45, -5], [45, 45], [-5, 45], [-5, 0], [-30, -30]], atol=1e-9)


def test_a_sharp_corner_of_fanuc_gets_a_straight_link():
    """The direction turns by 135 degrees: both offsets go on by the radius, with a line between."""
    found = ends(read("G42 D10 X0. Y0. F800.\nX40.\nX20. Y20.\nG40 X0. Y60.\n"))
    h = 5 * math.sqrt(0.5)
    np.testing.assert_allclose(found, [[0, -5], [45, -5], [40 + 2 * h, 0], [20 + h, 20 + h], [0, 60]],
                               atol=1e-9)


@pytest.mark.parametrize("dialect", ["linuxcnc", "siemens", "heidenhain"])
def test_outside_corners_of_other_styles_are_arcs_round_the_corner(dialect):
    style = {"linuxcnc": LINUXCNC_STYLE}.get(dialect, NORM)
    contour = Contour(-1, 2.0, 0j)
    pieces = [p for e in (Element(0j, 10 + 0j), Element(10 + 0j, 20 + 0j), Element(20 + 0j, 20 + 10j))
              for p in contour.add(e, style)] + list(contour.close())
    arcs = [p for p in pieces if p.centre is not None]
    assert len(arcs) == 1 and arcs[0].link and arcs[0].centre == 20 and arcs[0].sweep == pytest.approx(math.pi / 2)
    assert pieces[0].end == pytest.approx(10 - 2j) and pieces[-1].end == pytest.approx(22 + 10j)


def test_the_intersection_of_g451_turns_into_an_arc_where_it_gets_too_sharp():
    style = Style(Corner.INTERSECTION, Approach.NEXT_NORMAL)
    for turned, lines in ((90, True), (99, True), (101, False)):
        contour, way = Contour(-1, 2.0, -5 + 0j), cmath.rect(10, math.radians(turned))
        pieces = [p for e in (Element(-5 + 0j, 0j), Element(0j, 10 + 0j), Element(10 + 0j, 10 + way))
                  for p in contour.add(e, style)] + list(contour.close())
        assert (not any(p.centre for p in pieces)) == lines
        if lines:
            reach = 2 * math.tan(math.radians(turned / 2))
            assert max(p.end.real for p in pieces) == pytest.approx(10 + reach, abs=1e-9)


FILLET = "{} D10 X0. Y0. F800.\nX40.\nY15.\n{}\nG1 X10.\nG40 X-30.\n"


@pytest.mark.parametrize("arc", ["G3 X35. Y20. R5.", "G3 X35. Y20. I-4.9995"])
def test_a_fillet_of_the_radius_of_the_tool_is_a_place(arc):
    """A pocket of corners R5 milled by a tool of 10 mm: the centre stands where the offsets of both walls meet."""
    np.testing.assert_allclose(ends(read(FILLET.format("G41", arc))), [[0, 5], [35, 5], [35, 15], [35, 15], [10, 15],
                                                                       [-30, 20]], atol=6e-4)


def test_a_whole_turn_of_the_radius_of_the_tool_goes_straight_down():
    found = read("G41 D10 X5. Y0. F800.\nG3 X5. Y0. I-5. Z-4.\nG1 Y1.\nG40 X-30.\n")
    np.testing.assert_allclose(found.end[found.line == 8], [[0, 0, -4]], atol=1e-9)


@pytest.mark.parametrize("body, reason", [
    (FILLET.format("G41", "G3 X35. Y20. I-4.998"), "inside arc of radius 4.998 mm"),
    (FILLET.format("G41", "G3 X35. Y20. R5.").replace("X10.", "X10. Y40."), "next to it is not tangent")])
def test_a_smaller_fillet_and_one_with_a_corner_are_refused(body, reason):
    with pytest.raises(ProgramError, match=reason):
        read(body)


def test_linuxcnc_refuses_a_fillet_of_the_radius_of_the_tool():
    with pytest.raises(ProgramError, match="inside arc of radius 5 mm"):
        read(FILLET.format("G41", "G3 X35. Y20. R5."), "linuxcnc")


def test_arcs_keep_their_centre():
    """A quarter inside and outside; the start of the next element is tangent."""
    found = read("G42 D10 X0. Y0. F800.\nX10.\nG3 X30. Y20. J20.\nG1 Y40.\nG40 X60.\n")
    arc = found.end[(found.line == 9)][:, :2]
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 10, arc[:, 1] - 20), 25, atol=1e-9)
    np.testing.assert_allclose(ends(found)[-2:], [[35, 40], [60, 40]], atol=1e-9)
    inside = read("G41 D10 X0. Y0. F800.\nX10.\nG3 X30. Y20. J20.\nG1 Y40.\nG40 X60.\n")
    arc = inside.end[(inside.line == 9)][:, :2]
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 10, arc[:, 1] - 20), 15, atol=1e-9)


def test_moves_along_z_stay_in_their_order_at_the_inside_corner():
    p = read("G41 D10 X0. Y0. F800.\nX40.\nZ-4.\nY40.\nG40 X0.\n")
    z = p.end[p.line == 9]
    np.testing.assert_allclose(z, [[35, 5, -4]], atol=1e-9)
    assert p.line[p.kind == FEED].tolist() == [6, 7, 8, 9, 10, 11]


def test_after_g40_a_height_alone_keeps_the_place():
    """Fanuc leaves the offset with the next word of the plane."""
    p = read("G41 D10 X0. Y0. F800.\nX40.\nG40\nG0 Z50.\nX0. Y0.\n")
    np.testing.assert_allclose(p.end[-2:], [[40, 5, 50], [0, 0, 50]], atol=1e-9)


def test_speeds_belong_to_the_moves_after_them():
    p = read("G41 D10 X0. Y0. F800.\nX40.\nS2000\nX50.\nX60.\nG40 Y20.\n")
    by_line = dict(zip(p.line.tolist(), p.speed.tolist(), strict=True))
    assert [by_line[n] for n in (7, 8, 10, 11)] == [1000, 1000, 2000, 2000]


@pytest.mark.parametrize(("body", "radius"), [
    ("G41 D10 X0. Y0. F800.\n", 5.0), ("G41 D0 X0. Y0. F800.\n", 0.0), ("G41 X0. Y0. F800.\n", 5.0),
    ("G41 D60 X0. Y0. F800.\n", 5.0), ("G41 D3 X0. Y0. F800.\n", 1.5),
    ("G10 L12 P10 R4.9\nG41 D10 G1 X0. Y0. F800.\n", 4.9), ("G10 L13 P10 R-0.1\nG41 D10 G1 X0. Y0. F800.\n", 4.9),
    ("G10 L12 P10 R0\nG10 L13 P10 R0.05\nG41 D10 G1 X0. Y0. F800.\n", 0.05),
    ("G10 L12 P10 R9.8\nG41 D10 G1 X0. Y0. F800.\n", 4.9),
    ("G91 G10 L12 P10 R-0.5\nG90\nG41 D10 G1 X0. Y0. F800.\n", 4.5)])
def test_which_radius(body, radius):
    """The register of the tool, no compensation, the tool in the spindle, a register of no tool, of another tool."""
    p = read(body + "X40.\nG40 Y20.\n")
    np.testing.assert_allclose(ends(p)[:2], [[0, radius], [40, radius]], atol=1e-9)
    assert any("radius D3 with tool T10" in r.message for r in p.remarks) == ("D3" in body)


@pytest.mark.parametrize(("dialect", "told"), [("fanuc", True), ("haas", True), ("linuxcnc", False)])
def test_no_register_in_the_program_is_a_finding_where_the_control_keeps_one(dialect, told):
    for first, word in (("", "G41"), ("", "G42"), ("G41 D10 X0. Y0. F800.\nX40.\nG40 Y20.\n", "G41")):
        p = read(f"{first}{word} X0. Y-30. F800.\nX40.\nG40 Y20.\n", dialect=dialect)
        assert any("without D" in r.message for r in p.remarks) == (told and not first)


def test_a_register_that_is_no_tool_s_and_no_habit_is_a_finding():
    assert any("radius D11 with tool T10" in r.message for r in read("G41 D11 X0. Y0. F800.\nG40 X9.\n").remarks)


@pytest.mark.parametrize(("body", "words"), [
    ("G41 D10 G2 X0. Y0. R30. F800.\n", ("line 7", "an arc in the block that begins")),
    ("G41 D10 X0. Y0. F800.\nX20.\nG3 X20. Y8. J4.\nG1 X0.\n", ("line 9", "inside arc of radius")),
    ("G41 D10 X0. Y0. F800.\nX20.\nX21. Y2.\nX0. Y30.\nX-30.\n", ("line 10", "cannot follow the contour of line 9",
                                                                  "2.2361 mm long")),
    ("G41 D10 X0. Y0. F800.\nG28 Z0.\n", ("line 8", "G28 or G30 while", "G40")),
    ("G41 D10 X0. Y0. F800.\nG81 X1. Y1. Z-3. R1.\n", ("line 8", "a drilling cycle while")),
    ("G41 D10 X0. Y0. F800.\nG18\n", ("line 8", "G18 while")),
    ("G41 D10 X0. Y0. F800.\nT3 M6\n", ("line 8", "M6 while")),
    ("G41 D10 X0. Y0. F800.\nG42 X9.\n", ("line 8", "G42 while")),
    ("G41 D10 X0. Y0. F800.\nG53 G0 Z0.\n", ("line 8", "G53 while"))])
def test_what_cannot_be_followed_names_its_line(body, words):
    with pytest.raises(ProgramError) as caught:
        read(body + "G40\n")
    assert all(w in caught.value.message for w in words), caught.value.message


def test_the_tool_never_comes_nearer_to_an_outside_contour_than_its_radius():
    """Random contours of lines: each piece of the path keeps the radius from the contour's element and corner."""
    followed = 0
    for seed in range(60):
        made = RandomContour(seed)
        made.text(elements=0)
        elements, at = [], made.at
        for _ in range(6):
            made.heading += made.r.uniform(-1.4, 1.4)
            step = cmath.rect(made.r.uniform(8, 20), made.heading)
            elements.append(Element(at, at + step))
            at += step
        for style in (FANUC_STYLE, LINUXCNC_STYLE, NORM):
            contour = Contour(1, 2.0, elements[0].start)
            try:
                pieces = [p for e in elements for p in contour.add(e, style)] + list(contour.close())
            except CompensationError:
                continue
            followed += 1
            for piece in pieces[1:]:
                near = elements[max(elements.index(piece.element) - 1, 1):elements.index(piece.element) + 2]
                for t in np.linspace(0, 1, 7):
                    at_piece = piece.start + t * (piece.end - piece.start) if piece.centre is None else (
                        piece.centre + (piece.start - piece.centre) * cmath.exp(1j * piece.sweep * t))
                    assert min(distance(at_piece, e) for e in near) >= 2.0 - 1e-5 - 2.0 * style.tangent**2
    assert followed > 90


def distance(place, element):
    way = element.end - element.start
    t = min(max(((place - element.start) * way.conjugate()).real / abs(way) ** 2, 0.0), 1.0)
    return abs(place - element.start - t * way)


@pytest.mark.parametrize(("dialect", "between", "told"), [
    ("fanuc", "G4 P100\nM8\n", True), ("fanuc", "Z-3.\nZ-2.\nG4 P10\n", True), ("fanuc", "M88\nM89\n", True),
    ("fanuc", "M8\n", False), ("fanuc", "(A)\n(B)\nN30\nM8\n", False), ("haas", "G4 P100\nM8\nM9\n", False),
    ("linuxcnc", "M8\nM9\nG4 P1\nM8\nM9\n", False)])
def test_a_corner_behind_many_blocks_without_a_move_is_told(dialect, between, told):
    """Fanuc: with two or more of them in a row the vector stands square to the last line, and the corner is overcut."""
    inside = f"G41 D10 G1 X0. Y0. F100.\nX20.\n{between}Y20.\nG40 G1 X-9.\n"
    p = read(inside, dialect)
    assert any("without a move in the plane stand before this corner" in r.message for r in p.remarks) == told
    straight = f"G41 D10 G1 X0. Y0. F100.\nX20.\n{between}X30.\n{between}G40 G1 X40.\n"
    assert not any("without a move in the plane" in r.message for r in read(straight, dialect).remarks)
