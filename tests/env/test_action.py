"""Actions in [-1, 1] and in physical units."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.env.action import to_normalised, to_physical
from rudc.vehicle import EgoVehicle

VEHICLE = EgoVehicle()
unit = st.floats(-1, 1)


def test_limits():
    np.testing.assert_allclose(to_physical(np.array([-1.0, -1.0]), VEHICLE), [-6.0, -0.6])
    np.testing.assert_allclose(to_physical(np.array([1.0, 1.0]), VEHICLE), [3.0, 0.6])
    np.testing.assert_allclose(to_physical(np.array([0.0, 0.0]), VEHICLE), [-1.5, 0.0])
    np.testing.assert_allclose(to_physical(np.array([9.0, -9.0]), VEHICLE), [3.0, -0.6])


@given(unit, unit)
def test_there_and_back(a, delta):
    action = np.array([a, delta])
    np.testing.assert_allclose(to_normalised(to_physical(action, VEHICLE), VEHICLE), action, atol=1e-12)


@pytest.mark.parametrize("u", [(-9.0, 0.0), (5.0, 2.0)])
def test_beyond_the_limits_is_cut(u):
    assert np.all(np.abs(to_normalised(np.array(u), VEHICLE)) <= 1)
