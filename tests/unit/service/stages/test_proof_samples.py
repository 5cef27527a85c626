"""Zones that answer for the samples of the proof, against a search among all planning samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.sampling import SurfaceSamples
from service.stages.proof_samples import NEIGHBOURS, _neighbours


def _samples(rng: np.random.Generator, count: int, faces: int) -> SurfaceSamples:
    upright = rng.random(count) < 0.5
    normals = np.where(upright[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    return SurfaceSamples(rng.uniform(0, 30, (count, 3)), normals, np.ones(count),
                          rng.integers(1, faces + 1, count).astype(np.int32), np.zeros(count, np.int32))


@pytest.mark.parametrize("seed", range(6))
def test_the_zone_is_that_of_the_nearest_sample_that_has_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planned, asked = _samples(rng, 400, 6), _samples(rng, 300, 8)
    # faces of one zone, of none, of one zone and none, and of two
    zone = np.choose(planned.face - 1, [1, 0, 2, 3, 3, 1])
    zone = np.where((planned.face > 4) & (rng.random(400) < 0.6), 0, zone)
    owner = np.where((planned.face == 4) & (rng.random(400) < 0.5), 2, zone).astype(np.int32)
    got = _neighbours(SimpleNamespace(samples=planned), owner, asked)  # type: ignore[arg-type]
    key, wanted = (2 * s.face.astype(np.int64) + (s.normals[:, 2] > 0.5) for s in (planned, asked))
    near = KeyedPoints(key, planned.points).nearest(wanted, asked.points, NEIGHBOURS)
    for row, zone_of in zip(near, got, strict=True):
        owners = [int(owner[k]) for k in row if k >= 0 and owner[k] > 0]
        assert zone_of == (owners[0] if owners else 0)
