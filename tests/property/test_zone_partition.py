"""Zones and the remainder partition the machinable area, as samples and as trimmed faces."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from geometry.sampling import sample_surface
from service.from_wire import parse_setup
from service.report.report import dry_report
from service.stages.preparation import Prepared, prepare

pytest.importorskip("cadquery")

EVERYDAY = [("narrow", 1)]
SWEEP = [("demo", 1), ("impeller", 2), ("wavy", 3), ("leaning_pair", 4), ("three_walls", 5), ("random", 6)]


def prepared(recipe: str, seed: int, folder: Path) -> Prepared:
    from examples.family.recipes import make_part

    made = make_part(seed, recipe)
    return prepare(made.write(folder)[0], parse_setup(json.dumps(made.setup)), lambda _stage, _share: None)


def check(recipe: str, seed: int, folder: Path) -> None:
    """No sample twice, areas add up, and in the parameters of each face no patch over another and none missing."""
    ready = prepared(recipe, seed, folder)
    area = ready.samples.area
    held = np.concatenate([z.samples for z in ready.zones])
    assert len(np.unique(held)) == len(held) and (np.bincount(held, minlength=len(area)) == ready.zoning.taken).all()
    report = dry_report(ready)
    total = sum(z["area_mm2"] for z in report["zones"]) + sum(x["area_mm2"] for x in report["remainder"])
    assert total == pytest.approx(float(area.sum()), rel=1e-3)
    check_sums(report, total)

    patches = [(name, p) for name, found in ready.patches.items() for p in found]
    whole = {int(f): float(ready.part.mesh.areas[ready.part.mesh.face_ids == f].sum())
             for f in np.unique(ready.samples.face)}
    for face, wanted in whole.items():
        assert sum(p.area for _, p in patches if p.face == face) == pytest.approx(wanted, rel=1e-9)
        shapes = [shapely.Polygon(p.loops[0], p.loops[1:]) for _, p in patches if p.face == face]
        union = shapely.union_all([shapely.make_valid(s) for s in shapes]).area
        assert sum(s.area for s in shapes) == pytest.approx(union, rel=1e-3)
    by_zone = {name: sum(p.area for n, p in patches if n == name) for name in ready.patches}
    off = sum(abs(by_zone.get(z.id, 0.0) - float(area[z.samples].sum())) for z in ready.zones)
    assert off <= 0.01 * float(area.sum())  # the spacing of the samples along every border between two zones


def check_sums(report: dict[str, Any], total: float) -> None:
    """What a reader of zones.json can add up: area by role, and what stays by face and place."""
    assert report["machinable_area_mm2"] == pytest.approx(total, rel=1e-3)
    assert sum(report["machinable_by_role_mm2"].values()) == pytest.approx(report["machinable_area_mm2"], rel=1e-6)
    lower, upper = np.array(report["part"]["bbox_mm"])
    for item in report["remainder"]:
        assert sum(p["area_mm2"] for p in item["patches"]) == pytest.approx(item["area_mm2"], abs=0.01)
        assert [p["face"] for p in item["patches"]] == item["faces"]
        for p in item["patches"]:
            box = np.array(p["box_mm"])
            assert (lower - 0.01 <= box[0]).all() and (box[0] <= box[1]).all() and (box[1] <= upper + 0.01).all()


@pytest.mark.parametrize(("recipe", "seed"), EVERYDAY)
def test_zones_partition_a_part(recipe: str, seed: int, tmp_path: Path) -> None:
    check(recipe, seed, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("recipe", "seed"), SWEEP)
def test_sweep(recipe: str, seed: int, tmp_path: Path) -> None:
    check(recipe, seed, tmp_path)


def test_every_point_has_one_region(tmp_path: Path) -> None:
    ready = prepared("narrow", 2, tmp_path)
    view = ready.views[0]
    points = sample_surface(view.part.mesh, 3.0, seed=99)
    labels = view.label(points)
    assert (labels.code >= 0).all()
    assert all((r.kind == "SCZI") == bool(r.connections) for r in labels.regions)
