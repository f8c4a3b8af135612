"""The yielding layer's kernels against the path table, rudc/geometry.py and the formula of braking."""

from __future__ import annotations

import numpy as np
import pytest

from rudc.geometry import separation
from rudc.network.line_kernels import along_line
from rudc.world import yielding_kernels as kernels


def test_vehicles_keep_their_offset_from_their_path(four_way):
    paths, rng = four_way.paths, np.random.default_rng(0)
    for row in rng.integers(0, paths.count, 20).tolist():
        s, beside, step = float(rng.uniform(-5, paths.length[row] + 5)), float(rng.normal()), 1.7
        x, y, psi = paths.pose(np.full(9, row), s + step * np.arange(9))
        x, y = x - beside * np.sin(psi), y + beside * np.cos(psi)
        place, facing = kernels.in_lane(paths.poses, paths.stations, row, s, float(x[0]), float(y[0]), step)
        assert place == pytest.approx(x + 1j * y, abs=1e-9)
        assert facing == pytest.approx(np.exp(1j * psi), abs=1e-9)


@pytest.mark.parametrize("s", [-7.0, 30.0, 1e4])
def test_the_ego_is_where_its_path_leads(four_way, s):
    path = four_way.route("south", "left").path
    way = 1.5 * np.arange(9)
    x, y, psi = path.pose(s + way)
    place, facing = along_line(path.poses, len(path.poses), 0, s, 0j, 1 + 0j, way)
    assert place == pytest.approx(x + 1j * y, abs=1e-9)
    assert facing == pytest.approx(np.exp(1j * psi), abs=1e-9)


def test_overlaps_are_geometrys():
    rng = np.random.default_rng(1)
    for _ in range(30):
        own, other = rng.uniform(-5, 5, (2, 9, 3))
        half, its_half = rng.uniform(0.3, 4, (2, 2))
        (place, facing), (there, turned) = (
            (p[:, 0] + 1j * p[:, 1], np.exp(1j * p[:, 2])) for p in (own, other)
        )
        apart = separation(there - place, facing, turned, half, its_half)
        hits = rng.random(9) < 0.2
        wanted = hits | (apart <= 0.0)
        kernels.mark_overlaps(hits, place, facing, *half, there, turned, *its_half)
        assert hits.tolist() == wanted.tolist()


@pytest.mark.parametrize(
    ("at", "speed", "passed", "wanted"),
    [
        ([], 8.0, False, -1.0),
        ([6], 8.0, False, 8.0**2 / (2 * (8.0 * 0.25 * 5 - 0.3))),
        ([6, 7], 3.0, False, 0.0),
        ([6, 7], 1.0, False, -1.0),
        ([1, 2], 8.0, False, 9.0),
        ([0, 1, 2], 8.0, False, -1.0),
        ([0, 1, 2], 1.0, True, 9.0),
        (range(9), 8.0, False, 9.0),
    ],
    ids=["nothing", "in time", "no faster", "creeps", "at once", "drives out", "is passed", "stuck"],
)
def test_braking_stops_before_the_first_overlap(at, speed, passed, wanted):
    hits = np.isin(np.arange(9), list(at))
    assert kernels.braking(hits, speed, passed, 9.0) == pytest.approx(wanted)
