"""The agents' kernels against numpy."""

import numpy as np
import pytest

from rudc.agents.kernels import two_way


def test_functions_of_two_places_are_added_between_their_knots():
    rng = np.random.default_rng(0)
    knots, other_knots = np.sort(rng.uniform(-40, 40, 9)), np.sort(rng.uniform(0, 80, 5))
    values, other_values = rng.normal(size=(3, 9)), rng.normal(size=(3, 5))
    for x, y in rng.uniform([-60, -20], [60, 100], (200, 2)):
        wanted = [
            np.interp(x, knots, f) + np.interp(y, other_knots, g)
            for f, g in zip(values, other_values, strict=True)
        ]
        assert two_way(x, y, knots, values, other_knots, other_values) == pytest.approx(wanted, abs=1e-12)
