"""The public family against its recorded truth, and what is found on parts by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from geometry.part import Part
from geometry.setup_frame import SetupFrame
from geometry.step_import.reader import read_part
from zones.features.decomposition import decompose
from zones.model import Decomposition

pytest.importorskip("cadquery")

EVERYDAY = [("demo", 0), ("three_walls", 0)]
SWEEP = [(r, s) for r in ("demo", "narrow", "leaning_pair", "three_walls", "wavy", "impeller") for s in (1, 2)]
SWEEP += [("impeller", 0), ("wavy", 0), ("narrow", 0), ("leaning_pair", 0)] + [("random", s) for s in range(24)]


def compare(recipe: str, seed: int, folder: Path, fillet: float = 0.0) -> None:
    """Counts exact, walls of every connection right, every primary channel found with its gap within 2 %."""
    from examples.family.recipes import make_part

    made = make_part(seed, recipe, fillet=fillet)
    part = read_part(made.write(folder)[0], chord=0.004)
    d, truth = decompose(part), made.truth
    assert len(d.walls) == len(truth["walls"])
    assert len(d.connections) == len(truth["connections"])
    place = {wall.id: nearest_wall(part, wall.sides, truth["walls"]) for wall in d.walls}
    assert sorted(place.values()) == list(range(len(d.walls)))
    joined = sorted(sorted(place[w] for w in c.walls) for c in d.connections)
    assert joined == sorted(sorted(c["walls"]) for c in truth["connections"])
    gaps = channel_gaps(d, place)
    for channel in truth["channels"]:
        pair = (min(channel["walls"]), max(channel["walls"]))
        if channel["primary"]:
            assert gaps[pair] == pytest.approx(channel["gap_min"], rel=0.02), pair


def compare_mixed(seed: int, folder: Path, **overrides: object) -> None:
    """Walls, connections, primary gaps and, where there is a classifier, profile types of a mixed part all right."""
    from benchmarks.reach.family_score import compare as hold_against
    from examples.family.recipes import make_part

    made = make_part(seed, "mixed", **overrides)
    part = read_part(made.write(folder)[0], chord=0.004)
    found = hold_against(part, decompose(part), made.truth)
    assert found["right"], found["causes"]


def nearest_wall(part: Part, sides: tuple[int, ...], walls: list[dict]) -> int:
    """Index of the true wall whose side points lie on a found wall."""
    from trimesh.triangles import closest_point

    t = part.mesh.triangles[np.isin(part.mesh.face_ids, sides)]
    far = [max(np.linalg.norm(closest_point(t, np.tile(q, (len(t), 1))) - q, axis=1).min() for q in w["side_points"])
           for w in walls]
    return int(np.argmin(far))


def channel_gaps(d: Decomposition, place: dict[str, int]) -> dict[tuple[int, int], float]:
    """Gap by pair of true walls."""
    pairs = [(sorted(place[w] for w in c.walls), c.gap_min) for c in d.channels]
    return {(p[0], p[1]): gap for p, gap in pairs}


@pytest.mark.parametrize(("recipe", "seed"), EVERYDAY)
def test_named_parts(recipe: str, seed: int, tmp_path: Path) -> None:
    compare(recipe, seed, tmp_path)


@pytest.mark.slow
def test_two_mixed_walls(tmp_path: Path) -> None:
    compare_mixed(7, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_mixed(seed: int, tmp_path: Path) -> None:
    compare_mixed(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("recipe", "seed"), SWEEP)
def test_sweep(recipe: str, seed: int, tmp_path: Path) -> None:
    compare(recipe, seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("recipe", "seed", "fillet"), [("wavy", 0, 0.8), ("demo", 0, 0.6)])
def test_fillets_at_the_foot(recipe: str, seed: int, fillet: float, tmp_path: Path) -> None:
    compare(recipe, seed, tmp_path, fillet)


@pytest.mark.slow
def test_compressor_wheel_has_nine_blades(shared_parts: Path) -> None:
    part = read_part(shared_parts / "imp_kj66_compressor_wheel.step", chord=0.01,
                     placement=SetupFrame(z_axis=(0, 1, 0), x_axis=(1, 0, 0)))
    d = decompose(part)
    assert (len(d.walls), len(d.connections), len(d.channels)) == (9, 0, 9)
    assert all(0.6 < w.thickness < 0.8 for w in d.walls)
    assert all(2.4 < c.gap_min < 2.7 for c in d.channels)


@pytest.mark.slow
def test_propeller_has_no_wall(shared_parts: Path) -> None:
    part = read_part(shared_parts / "blade_seed_propeller.stp", chord=0.02,
                     placement=SetupFrame(z_axis=(0, 1, 0), x_axis=(1, 0, 0)))
    assert decompose(part).walls == ()
