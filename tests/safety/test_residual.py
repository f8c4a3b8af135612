"""What the residual predictor sees, and the prediction that it adds to."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.safety.barrier import STEP
from rudc.safety.config import FilterConfig
from rudc.safety.constraints import ConstraintBuilder
from rudc.safety.filter import SafetyFilter
from rudc.safety.residual import features, heads, predicted_change, shipped_predictor, trust
from rudc.safety.rows import affine_rows, ttcbf_weights
from rudc.vehicle import EgoVehicle
from tests.safety.scenes import Other, make_scene

VEHICLE, ROAD = heads().values()
SCENE = make_scene(others=[Other(20.0, 3.0, 0.3, 6.0), Other(-15.0, -8.0, 2.0, 4.0, row=0, s=90.0)])
CONSTRAINTS = ConstraintBuilder(FilterConfig.preset("ttcbf", constrained="all")).build(SCENE)


def test_the_prediction_is_the_rows_own():
    """dt h' + dt^2/2 h'' is what TTCBF's row says at the action it is linearised about."""
    terms = CONSTRAINTS.terms(SCENE)
    a, z = -2.0, 0.1
    rows, b = affine_rows(terms, ttcbf_weights(0.1, 0.0, STEP), a, z)
    np.testing.assert_allclose(rows @ [a, z] - b - 0.1 * terms.h, predicted_change(terms, a, z), atol=1e-9)


def test_weak_brakes_are_no_poor_road():
    """w was halved where a vehicle braked as hard as it can, on a dry road."""
    weak, u = EgoVehicle(a_min=-2.5), np.array([-2.5, 0.2])
    assert trust(weak, 8.0, u, weak) == 1.0
    assert trust(replace(weak, a_min=-1.0), 8.0, u, weak) < 1.0


def test_features_say_what_they_are_named_after():
    vehicles, road = features(SCENE, CONSTRAINTS, np.array([-2.0, np.arctan(0.1)])).values()
    assert vehicles.shape == (2, len(VEHICLE))
    assert road.shape == (6, len(ROAD))
    seen = dict(zip(VEHICLE, vehicles[0], strict=True))
    first = CONSTRAINTS.parts[0].found.others[0]
    away = SCENE.position[first] - SCENE.ego_position
    assert np.hypot(seen["ahead / 20"], seen["to the left / 20"]) * 20 == pytest.approx(np.hypot(*away))
    assert seen["distance / 20"] * 20 == pytest.approx(np.hypot(*away))
    assert seen["tan(steering)"] == pytest.approx(0.1)
    assert seen["speed / 10"] * 10 == pytest.approx(SCENE.ego.v)
    assert seen["buffer"] == pytest.approx(0.5)
    speed = np.hypot(seen["its speed ahead / 10"], seen["its speed to the left / 10"]) * 10
    assert speed == pytest.approx(np.hypot(*SCENE.velocity[first]))
    edge = dict(zip(ROAD, road[0], strict=True))
    assert edge["to the left / 20"] > 0  # the left edge comes first
    assert edge["ahead / 20"] == pytest.approx(0.0, abs=1e-9)


def test_no_action_drives_backwards():
    standing = make_scene(others=[Other(20.0, 3.0)], v=0.0)
    constraints = ConstraintBuilder(FilterConfig.preset("ttcbf", constrained="all")).build(standing)
    one, other = (features(standing, constraints, np.array([a, 0.0]))["vehicle"] for a in (-6.0, 0.0))
    np.testing.assert_array_equal(one, other)


def test_a_negative_residual_tightens_and_a_positive_one_relaxes():
    guard = SafetyFilter(FilterConfig.preset("ttcbf", constrained="all", road=False))
    scene = make_scene(others=[Other(17.0, 0.0, 0.0, 0.0)], v=8.0)
    u_rl = np.array([0.0, 0.0])
    none = np.zeros(guard.constraints(scene).count)
    kept, harder, softer = (guard.filter(scene, u_rl, residual=none + w).u[0] for w in (0.0, -0.2, 50.0))
    assert harder < kept < 0.0
    assert softer == 0.0


@pytest.mark.parametrize("size", [(12.0, 2.5), (1.6, 0.6), (0.5, 0.5), (20.0, 3.5)])
def test_sizes_that_the_shipped_predictor_has_not_seen_do_not_mislead_it(size):
    """Trucks, bicycles, pedestrians and closed lanes: their residual is that of a car in their place."""
    guard = SafetyFilter(FilterConfig.preset("ttcbf", constrained="all", road=False))
    u_rl = np.array([1.0, 0.0])
    scenes = [
        make_scene(others=[Other(20.0, 0.5, 0.0, 0.0, length, width)], v=8.0)
        for length, width in (size, (5.0, 1.8))
    ]
    w, of_car = (shipped_predictor()(scene, guard.constraints(scene), u_rl) for scene in scenes)
    assert w == pytest.approx(of_car, abs=0.05)
    assert np.abs(w).max() < 2.0


def test_residuals_fade_towards_standstill():
    predictor, u = shipped_predictor(), np.array([1.0, 0.05])
    xi = features(SCENE, CONSTRAINTS, u)["vehicle"]
    slow, faster = xi.copy(), xi.copy()
    slow[:, VEHICLE.index("speed / 10")], faster[:, VEHICLE.index("speed / 10")] = 0.0, 0.1
    assert not predictor.of("vehicle", slow).any()
    assert predictor.of("vehicle", faster).all()
    standing = make_scene(others=[Other(6.0, 3.0), Other(-8.0, -3.0, 0.3, 6.0)], v=0.0)
    constraints = ConstraintBuilder(FilterConfig.preset("ttcbf", constrained="all")).build(standing)
    assert not predictor(standing, constraints, u).any()


@pytest.mark.parametrize(
    ("a_min", "braking", "counts"),
    [(-6.0, 6.0, 1.0), (-2.0, 3.0, 1.0), (-2.0, 4.0, 0.5), (-2.0, 5.0, 0.0), (-0.0, 1.0, 0.0)],
)
def test_residuals_fade_where_more_is_asked_than_the_road_is_known_to_give(a_min, braking, counts):
    """The predictor was fitted on dry roads."""
    predictor, u = shipped_predictor(), np.array([-braking, 0.0])
    dry = predictor(SCENE, CONSTRAINTS, u)
    assert dry.any()
    slippery = replace(SCENE, vehicle=replace(SCENE.vehicle, a_min=a_min))
    np.testing.assert_allclose(predictor(slippery, CONSTRAINTS, u), counts * dry)
    turning = np.array([0.0, 0.4])  # 11 m/s2 to the side
    assert predictor(slippery, CONSTRAINTS, turning).any() == (a_min == -6.0)


def test_each_kind_of_action_has_its_predictor():
    adjustment, direct, other = (shipped_predictor(kind).arrays for kind in ("adjustment", "direct", "mine"))
    assert not np.array_equal(adjustment["road/w1"], direct["road/w1"])
    np.testing.assert_array_equal(other["road/w1"], adjustment["road/w1"])


def test_the_shipped_predictor_speaks_of_every_constraint():
    w = shipped_predictor()(SCENE, CONSTRAINTS, np.array([1.0, 0.05]))
    assert w.shape == (CONSTRAINTS.count,)
    assert np.isfinite(w).all()
    assert np.abs(w).max() < 5.0
