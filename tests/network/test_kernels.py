"""Kernels of courses against numpy, and against trying every way."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from rudc.geometry import rectangle_gaps
from rudc.network.kernels import any_beside, cheapest_way, gaps_at


def test_gaps_are_those_of_rectangles_where_they_may_be_near():
    rng = np.random.default_rng(0)
    place, others = rng.uniform(-12, 12, (40, 2)), rng.uniform(-12, 12, (9, 2))
    heading, theirs, size = rng.uniform(-4, 4, 40), rng.uniform(-4, 4, 9), rng.uniform(0.4, 9, (9, 2))
    found = gaps_at(place, heading, 5.0, 1.8, others, theirs, size, 3.0)
    wanted = [
        rectangle_gaps(*at, psi, 5.0, 1.8, others, theirs, size)
        for at, psi in zip(place, heading, strict=True)
    ]
    near = np.isfinite(found)
    assert 50 < near.sum() < near.size - 50
    assert found[near] == pytest.approx(np.array(wanted)[near], abs=1e-12)
    assert (np.array(wanted)[~near] >= 3.0).all()


@pytest.mark.parametrize("seed", range(8))
def test_the_cheapest_way_is_that_of_trying_all(seed):
    """Five stations, five offsets, three slopes; a change of slope moves the car by the mean of the two."""
    rng = np.random.default_rng(seed)
    price, resting = rng.uniform(0, 9, (5, 5, 3)), rng.uniform(0, 2, (5, 3))
    price[rng.uniform(size=price.shape) < 0.2] = np.inf
    bend, offset, tightest = rng.uniform(-0.2, 0.2, 5), np.linspace(-1, 1, 5), 0.3
    bends, prices = np.array([-0.15, 0.0, 0.15]), np.array([2.0, 0.0, 2.0])
    best, cheapest = np.zeros(0), np.inf
    for changes in product((-1, 0, 1), repeat=4):
        row, col, cost, rows = 2, 1, 0.0, [2]
        for t, change in enumerate(changes, 1):
            col += change
            row += 2 * (col - 1) - change
            if not (0 <= row < 5 and 0 <= col < 3):
                cost = np.inf
                break
            stretch = max(1.0 - bend[t] * offset[row], 0.2)
            steep = abs(bend[t] / stretch + bends[change + 1] / stretch**2) > max(tightest, abs(bend[t]))
            cost += np.inf if steep else price[t, row, col] + resting[row, col] + prices[change + 1]
            rows.append(row)
        if cost < cheapest:
            best, cheapest = np.array(rows), cost
    assert len(best)
    found = cheapest_way(price, resting, bend, offset, 2, 1, tightest, bends, prices, 0.2)
    np.testing.assert_array_equal(found, best)


def test_somebody_is_beside_a_stretch_of_line_whose_circle_reaches_it():
    rng, found = np.random.default_rng(2), []
    line = np.stack([np.arange(0, 40, 0.5), 0.01 * np.arange(0, 40, 0.5) ** 2], axis=1)
    for _ in range(200):
        count = int(rng.integers(0, 4))
        first, last = np.sort(rng.integers(-3, 90, 2)).tolist()
        position, size = rng.uniform((-5, -8), (45, 20), (count, 2)), rng.uniform(1, 6, (count, 2))
        stretch = line[max(first, 0) : last + 1]
        away = np.linalg.norm(position[:, None] - stretch, axis=-1)
        wanted = bool((away < 2.0 + 0.5 * np.linalg.norm(size, axis=1)[:, None]).any())
        assert any_beside(line, first, last, 2.0, position, size) == wanted
        found.append(wanted)
    assert 20 < sum(found) < 180
