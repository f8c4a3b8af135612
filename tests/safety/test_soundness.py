"""Scenes that somebody made by hand and that cannot be are refused before compiled code reads them."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.errors import SolverError
from rudc.safety.filter import FilterConfig, SafetyFilter
from tests.safety.scenes import Other, make_scene

OTHERS = [Other(12.0, 0.0, speed=2.0, row=1, s=50.0), Other(20.0, 3.5, row=0, s=60.0)]


def wide(array):
    return np.column_stack([array, array])


@pytest.mark.parametrize(
    "name", ["position", "velocity", "size", "heading", "path_s", "acceleration", "path", "kind"]
)
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda array: array[:-1].copy(), id="one too few"),
        pytest.param(wide, id="a column too many"),
        pytest.param(lambda array: array[None], id="an axis too many"),
        pytest.param(lambda array: array.astype(np.float32), id="single precision"),
    ],
)
def test_arrays_that_do_not_fit_are_named(name, change):
    """Some hung for ever or crashed, from others came an action that was called safe."""
    scene, free = make_scene(OTHERS), SafetyFilter(FilterConfig.preset("ttcbf"))
    free.filter(scene, np.zeros(2))
    wrong = replace(scene, **{name: change(getattr(scene, name))})
    wanted = getattr(scene, name)
    with pytest.raises(SolverError) as error:
        free.filter(wrong, np.zeros(2))
    assert f"2 others (ids) whose {name} has shape" in str(error.value)
    assert f"it must have shape {wanted.shape} and type {wanted.dtype}" in str(error.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"ids": ("one",)}, r"1 others \(ids\) whose position"),
        ({"size": -np.ones((2, 2))}, "a length or width that is not above 0 m"),
        ({"path": np.array([0, 999])}, "whose path is not -1 to 2"),
        ({"path": np.array([-2, 0])}, "whose path is not -1 to 2"),
    ],
)
def test_what_cannot_be_is_named(change, said):
    with pytest.raises(SolverError, match=said):
        SafetyFilter(FilterConfig.preset("ttcbf")).filter(replace(make_scene(OTHERS), **change), np.zeros(2))


@pytest.mark.parametrize("action", [np.zeros(3), np.zeros(1)])
def test_an_action_has_two_numbers(action):
    with pytest.raises(SolverError, match="not an acceleration and a front-wheel angle"):
        SafetyFilter(FilterConfig.preset("ttcbf")).filter(make_scene(), action)
