"""The yielding layer's kernels agree with the path table, rudc/geometry.py and the formula of braking."""

from __future__ import annotations

import numpy as np
import pytest

from rudc.geometry import separation
from rudc.network.line_kernels import along_line
from rudc.world import yielding_kernels as kernels


@pytest.mark.parametrize("length", [1.8, 5.0, 12.0])
def test_vehicles_have_both_ends_on_their_path_as_far_beside_it_as_now(four_way, length):
    paths, rng = four_way.paths, np.random.default_rng(0)
    for row in rng.integers(0, paths.count, 20).tolist():
        s, beside, step = float(rng.uniform(-5, paths.length[row] + 5)), float(rng.normal()), 1.7
        growth = float(rng.choice([0.0, 0.2]))
        way = step * np.arange(9) + growth * np.arange(9) ** 2 / 2
        ends = [paths.pose(np.full(9, row), s + half + way) for half in (0.5 * length, -0.5 * length)]
        front, rear = (x + 1j * y for x, y, _ in ends)
        along = (front - rear) / np.abs(front - rear)
        centre = front - 0.5 * length * along + 1j * beside * along
        x, y = centre[0].real, centre[0].imag
        place, facing = kernels.in_lane(paths.poses, paths.stations, row, s, x, y, length, step, growth)
        assert place == pytest.approx(centre, abs=1e-9)
        assert facing == pytest.approx(along, abs=1e-9)


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


@pytest.mark.parametrize(("most", "wanted"), [(9.0, -1.0), (1.2, 0.0)], ids=["dry", "ice"])
def test_one_that_creeps_goes_no_faster_where_it_could_not_stop_afterwards(most, wanted):
    """Half a second later it drives 2.25 m/s after 0.8 m of 1.75 m, and needs 0.3 m to stop, on ice 2.1 m."""
    hits = np.isin(np.arange(9), [6, 7])
    assert kernels.braking(hits, 1.0, False, most) == wanted


@pytest.mark.parametrize(("most", "brakes"), [(9.0, 0.0), (1.4, 1.304), (1.0, 1.0)])
def test_on_ice_one_brakes_while_it_can_still_stop(most, brakes):
    """It braked once it needed 1.5 m/s2, where the road gave 1 m/s2."""
    hits = np.isin(np.arange(9), [6, 7])
    assert kernels.braking(hits, 3.0, False, most) == pytest.approx(brakes, abs=1e-3)


@pytest.mark.parametrize(("most", "brakes"), [(9.0, -1.0), (1.0, 0.8)])
def test_on_ice_one_that_is_faced_brakes_while_it_can_still_stop(most, brakes):
    assert kernels.braking_before(10.0, 4.0, most) == pytest.approx(brakes)
