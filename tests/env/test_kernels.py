"""The observation's kernels against numpy and brute force; what they come to is in test_conflict.py and
test_observation.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from rudc.env import kernels


def test_seen_from_the_nearest_station():
    rng = np.random.default_rng(0)
    course = np.cumsum(rng.normal(0, 0.02, 80))
    line = np.cumsum(0.5 * np.stack([np.cos(course), np.sin(course)], axis=1), axis=0)
    xy, heading = rng.uniform(-10, 40, (25, 2)), rng.uniform(-3, 3, 25)
    at = np.hypot(*(xy[:, None] - line).transpose(2, 0, 1)).argmin(axis=1)
    away = ((xy - line[at]) @ [1, 1j]) * np.exp(-1j * course[at])
    turn = heading - course[at]
    wanted = np.stack([0.5 * at + away.real, away.imag, np.cos(turn), np.sin(turn)], axis=1)
    assert kernels.seen_from_line(line, course, 0.5, xy, heading) == pytest.approx(wanted, abs=1e-12)


def test_interpolation_is_numpys():
    xp = np.cumsum(np.random.default_rng(1).uniform(0.01, 1, 40))
    fp = np.random.default_rng(2).normal(size=40)
    x = np.concatenate([np.linspace(-1, xp[-1] + 1, 300), xp])
    got = [kernels.interpolated(float(v), xp, fp) for v in x]
    assert got == pytest.approx(np.interp(x, xp, fp), abs=1e-9)


@pytest.mark.parametrize(("length", "width"), [(4.75, 1.8), (4.08, 1.73), (1.8, 0.65), (16.5, 2.55)])
def test_a_code_holds_a_size_in_decimetres(length, width):
    """4.75 x 1.8 m was read as 4.7 x 51.8 m."""
    row, size = divmod(kernels.code(7, length, width), 1_000_000)
    assert (row, *divmod(size, 1000)) == (7, np.rint(10 * length), np.rint(10 * width))
