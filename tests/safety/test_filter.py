"""The filter from scene to action: least change, bounds, fallbacks, refusals."""

import json
import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rudc.errors import InputError, SolverError
from rudc.safety.filter import LEAST_ROOM, Corrected, FilterConfig, SafetyFilter
from rudc.safety.qp import Problem, Solution
from rudc.safety.road_edges import RoadSettings
from rudc.safety.rows import affine_rows, per_row
from rudc.safety.rules import Ecbf, Ttcbf
from rudc.safety.vehicles import VehicleSettings
from rudc.vehicle import EgoVehicle
from tests.safety.scenes import Other, make_scene, straight_road

EGO = EgoVehicle()
CONFIGS = [
    FilterConfig.preset(kind, constrained=constrained, last_resort=False)
    for kind in ("ttcbf", "ecbf")
    for constrained in ("all", "gated")
]
FILTERS = [SafetyFilter(config) for config in CONFIGS]

others = st.builds(
    Other,
    x=st.floats(-40, 40),
    y=st.floats(-40, 40),
    heading=st.floats(-4, 4),
    speed=st.floats(0, 12),
    length=st.floats(0.4, 12),
    width=st.floats(0.4, 2.6),
    row=st.integers(-1, 2),
    s=st.floats(0, 200),
)
scenes = st.builds(
    make_scene,
    others=st.lists(others, max_size=15),
    x=st.floats(-50, 50),
    y=st.floats(-6, 6),
    psi=st.floats(-4, 4),
    v=st.floats(0, 15),
)
actions = st.builds(lambda a, delta: np.array([a, delta]), st.floats(-8, 5), st.floats(-1, 1))


def least_margin(filter: SafetyFilter, scene: Any, u: np.ndarray) -> float:
    """m2 per step, by how much u = (m/s2, rad) satisfies all conditions, worked out apart from the filter."""
    ego, config, to = scene.ego, filter.config, filter.constraints(scene)
    terms = to.terms(scene)
    weights = per_row(config.row_weights(road=False), config.row_weights(road=True), to.mode)
    action = np.array([max(u[0], -ego.v / config.dt), math.tan(u[1])])
    rows, b = affine_rows(terms, weights, *action)
    return float((rows @ action - b).min())


@pytest.mark.parametrize(
    "filter", FILTERS, ids=lambda f: f"{f.config.rule}-{f.config.barriers['vehicle'].constrained}"
)
@given(scene=scenes, u=actions)
@example(  # no solution is found within two others at 12 m/s: full braking
    scene=make_scene(
        [Other(0.0, 0.0, 4.0, length=1.0, width=0.5), Other(0.0, 0.0, 4.0, speed=1.0, length=7.0, width=1.0)],
        y=0.00390625,
        v=12.0,
    ),
    u=np.zeros(2),
)
@settings(max_examples=150)
def test_bounds_and_least_change(filter: SafetyFilter, scene: Any, u: np.ndarray) -> None:
    answer = filter.filter(scene, u)
    limit = EGO.delta_max
    assert EGO.a_min <= answer.u[0] <= EGO.a_max
    assert abs(answer.u[1]) <= limit
    assert answer.correction == pytest.approx(answer.u - u)
    asked = np.clip(u, [EGO.a_min, -limit], [EGO.a_max, limit])
    a_low = max(EGO.a_min, -scene.ego.v / filter.config.dt)
    assert answer.u[0] <= max(asked[0], a_low) + LEAST_ROOM  # it brakes, it does not accelerate
    change = math.tan(answer.u[1]) - math.tan(asked[1])
    assert abs(change) <= filter.config.max_steering_correction + 1e-9
    assert len(answer.h) == len(answer.names) == len(set(answer.names))
    assert answer.infeasible == (answer.status in ("relaxed", "braking"))
    margin = least_margin(filter, scene, asked)
    assert (answer.status == "nominal") == (margin >= 0)
    if answer.status == "nominal":
        assert np.array_equal(answer.u, asked)
        assert answer.active == ()
    else:
        assert answer.active, "something pushed"
    if answer.status == "solved":
        assert least_margin(filter, scene, answer.u) >= -2e-6
        assert answer.optimality_gap < 1e-6


@given(scene=scenes, u=actions)
@settings(max_examples=60)
def test_the_same_question_has_the_same_answer(scene: Any, u: np.ndarray) -> None:
    """A warm solver remembers no earlier problem."""
    fresh = SafetyFilter(CONFIGS[0]).filter(scene, u)
    warm = FILTERS[0].filter(scene, u)
    assert warm.status == fresh.status
    assert warm.u == pytest.approx(fresh.u, abs=1e-6)


def test_nobody_from_behind_drives_the_ego_into_who_is_ahead() -> None:
    """A standing car ahead, another that passes on the next lane: braking stays braking."""
    scene = make_scene([Other(25.0, 0.6), Other(-10.0, -3.0, speed=8.2)], v=2.0)
    u = np.array([-5.8, 0.0])
    free = SafetyFilter(FilterConfig(constrained="all", max_added_acceleration=math.inf)).filter(scene, u)
    assert free.u[0] > 0
    assert SafetyFilter(FilterConfig(constrained="all")).filter(scene, u).u[0] == pytest.approx(
        -5.8, abs=0.01
    )


def wall(v: float = 8.0, **changes: Any) -> Any:
    """A parked lorry across the ego's lane, 14 m ahead."""
    return make_scene([Other(14.0, 0.0, math.pi / 2, 0.0, 8.0, 2.5)], v=v, **changes)


def free(config: FilterConfig | None = None) -> SafetyFilter:
    return SafetyFilter(config or FilterConfig(constrained="all", last_resort=False))


def test_brakes_for_what_is_in_the_way() -> None:
    filter = free()
    answer = filter.filter(wall(v=6.5), np.array([2.0, 0.0]))
    assert answer.status == "solved"
    assert answer.correction[0] < -1.0
    assert answer.active == ("veh:sv0",)
    assert answer.names[0] == "veh:sv0"
    assert answer.names[1:] == tuple(
        f"road:{side}:{p}" for side in ("left", "right") for p in ("cg", "third", "two_thirds")
    )
    assert answer.solve_ms > 0
    assert answer.violation == 0


def test_leaves_alone_who_keeps_clear() -> None:
    filter = free()
    u = np.array([0.5, 0.02])
    answer = filter.filter(make_scene([Other(-30.0, 3.5, math.pi, 8.0)]), u)
    assert answer.status == "nominal"
    assert np.array_equal(answer.u, u)
    assert not answer.correction.any()
    assert answer.solve_ms == 0
    assert answer.h.min() > 0


def test_nothing_to_constrain() -> None:
    filter = SafetyFilter(FilterConfig(road=False))
    answer = filter.filter(make_scene(), np.array([1.0, 0.1]))
    assert answer.status == "nominal"
    assert answer.names == ()
    assert len(answer.h) == 0
    assert filter.last_problem is None


def test_infeasible_is_relaxed() -> None:
    filter = free()
    answer = filter.filter(wall(v=12.0), np.array([3.0, 0.0]))
    assert answer.status == "relaxed"
    assert answer.infeasible
    assert answer.u[0] == pytest.approx(EGO.a_min, abs=1e-6)
    assert answer.violation > 0
    assert "veh:sv0" in answer.active


@pytest.mark.parametrize("v", [0.0, 2.0])
def test_a_car_that_passes_does_not_outbid_the_truck_ahead(v: float) -> None:
    """No action satisfies both rows; the ego must not drive on towards the truck to please the other."""
    truck, passing = Other(5.6, 0.3, 0.0, 0.0, 5.0, 2.0), Other(-5.0, -3.0, 0.0, 8.2)
    filter = free(FilterConfig.preset("ttcbf", constrained="all", road=False, last_resort=False))
    answer = filter.filter(make_scene([truck, passing], v=v), np.array([3.0, 0.0]))
    assert answer.status == "relaxed"
    assert 1.0 < answer.h[0] < 1.5
    assert answer.u[0] <= LEAST_ROOM
    problem = filter.last_problem
    assert problem is not None
    violations = problem.b - problem.A @ [max(answer.u[0], problem.lower[0]), math.tan(answer.u[1])]
    assert answer.violation == pytest.approx(violations.max(), abs=1e-6)
    alone = filter.filter(make_scene([truck], v=v), np.array([3.0, 0.0]))
    assert answer.u[0] <= alone.u[0] + 1e-3, "who passes asks for nothing that the truck does not allow"


def test_where_all_gain_by_it_the_ego_may_accelerate_as_proposed() -> None:
    """Somebody comes up askew from behind, and nobody is ahead: to go on is the way out."""
    scene = make_scene([Other(-6.0, -3.0, 0.3, 9.0)], v=2.0)
    answer = free(FilterConfig.preset("ttcbf", constrained="all", road=False, last_resort=False)).filter(
        scene, np.array([3.0, 0.0])
    )
    assert answer.status == "relaxed"
    assert answer.u[0] == pytest.approx(3.0)


def test_vehicles_come_before_the_road() -> None:
    """Pressed between a vehicle and the edge, the filter gives the edge up."""
    road = straight_road(half_width=2.0)
    beside = Other(0.5, 2.8, -math.pi / 2, 2.0, 1.8, 4.5)
    scene = make_scene([beside], y=-0.7, psi=-0.05, v=6.0, route=road)
    vehicles_first = free().filter(scene, np.zeros(2))
    slacks = FilterConfig(
        constrained="all", last_resort=False, vehicle_violation_weight=1e2, road_violation_weight=1e5
    )
    road_first = free(slacks).filter(scene, np.zeros(2))
    assert vehicles_first.status == road_first.status == "relaxed"
    assert {"veh:sv0", "road:right:cg"} <= set(vehicles_first.active)
    assert vehicles_first.u[1] < -0.04, "away from the vehicle, towards the edge"
    assert road_first.u[1] > 0.04


def test_full_braking_when_nothing_can_be_solved() -> None:
    filter = free()

    class Failing:
        def solve(self, problem: Problem) -> Solution:
            n, k = len(problem.q), len(problem.b)
            return Solution(np.zeros(n), False, math.inf, np.zeros(k), 0.01)

    filter._solver = Failing()
    answer = filter.filter(wall(v=7.0), np.array([2.0, 0.1]))
    assert answer.status == "braking"
    assert answer.infeasible
    assert answer.u == pytest.approx([EGO.a_min, 0.1])
    assert answer.violation == math.inf
    assert answer.solve_ms > 0


def test_a_standing_vehicle_is_not_asked_to_reverse() -> None:
    """Whoever drives up to a standing ego cannot be kept off by braking: that is no solution, and said so."""
    oncoming = [Other(9.0, 0.0, math.pi, 8.0)]
    answer = free().filter(make_scene(oncoming, v=0.0), np.array([-3.0, 0.0]))
    assert answer.infeasible
    assert answer.u[0] == pytest.approx(-3.0), "as good as standing: the proposed brake is kept"
    standing = make_scene([Other(9.0, 0.0)], v=0.0)
    assert free().filter(standing, np.array([-3.0, 0.0])).status == "nominal"


def test_steering_correction_is_bounded_or_not() -> None:
    road = straight_road(half_width=2.0)
    scene = make_scene(y=0.4, psi=0.15, v=6.0, route=road)
    u = np.array([0.0, 0.1])
    tight = free().filter(scene, u)
    loose = free(FilterConfig(max_steering_correction=math.inf)).filter(scene, u)
    assert tight.infeasible
    assert not loose.infeasible
    assert math.tan(u[1]) - math.tan(loose.u[1]) > 0.05


def changed(answer: Corrected) -> float:
    return float(np.abs(answer.correction).sum())


@pytest.mark.parametrize("kind", ["ttcbf", "ecbf"])
def test_slack_and_residual_relax_and_tighten(kind: str) -> None:
    filter, u = free(FilterConfig.preset(kind, constrained="all", last_resort=False)), np.array([1.0, 0.0])
    scene = wall(v=6.5 if kind == "ttcbf" else 2.0)
    count = filter.constraints(scene).count
    plain = filter.filter(scene, u)
    assert plain.status == "solved"
    assert changed(filter.filter(scene, u, slack=0.02)) < changed(plain)
    assert changed(filter.filter(scene, u, slack=-0.02)) > changed(plain)
    assert filter.filter(scene, u, slack=100.0).status == "nominal"
    residual = np.zeros(count)
    assert changed(filter.filter(scene, u, residual=residual)) == pytest.approx(changed(plain))
    residual[0] = -0.02
    by_residual = filter.filter(scene, u, residual=residual)
    assert by_residual.u == pytest.approx(filter.filter(scene, u, slack=-0.02).u, abs=1e-7)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_refuses_what_is_not_finite(bad: float) -> None:
    filter, scene, u = free(), wall(), np.array([1.0, 0.0])
    for action in ([bad, 0.0], [0.0, bad]):
        with pytest.raises(SolverError, match="not finite"):
            filter.filter(scene, np.array(action))
    with pytest.raises(SolverError, match="not finite"):
        filter.filter(scene, u, slack=bad)
    with pytest.raises(SolverError, match="rows are not finite for road:left:cg"):
        filter.filter(scene, u, residual=np.array([0.0, bad, 0.0, 0.0, 0.0, 0.0, 0.0]))
    for name in ("position", "velocity", "heading", "size", "path_s", "acceleration"):
        broken = np.array(getattr(scene, name), copy=True)
        broken.flat[-1] = bad
        with pytest.raises(SolverError, match=f"whose {name} is not finite"):
            filter.filter(wall(**{name: broken}), u)
    with pytest.raises(SolverError, match="ego state"):
        filter.filter(make_scene(v=bad), u)


def test_residual_of_the_wrong_length() -> None:
    with pytest.raises(SolverError, match="7 constraints"):
        free().filter(wall(), np.zeros(2), residual=np.zeros(3))


def test_presets() -> None:
    ttcbf, ecbf = FilterConfig.preset("ttcbf"), FilterConfig.preset("ecbf", d_safe=0.3)
    assert (ttcbf.rule, ttcbf.rule_settings, ttcbf.dt) == ("ttcbf", Ttcbf(rate=0.1, gamma=100.0), 0.1)
    assert (ecbf.rule, ecbf.rule_settings) == ("ecbf", Ecbf(rate1=1.5, rate2=0.3))
    assert ecbf.barriers == {"vehicle": VehicleSettings(d_safe=0.3), "road": RoadSettings()}
    assert ttcbf.barriers == {"vehicle": VehicleSettings(constrained="gated"), "road": RoadSettings()}
    assert ttcbf.max_steering_correction == 0.05
    assert (ttcbf.acceleration_weight, ttcbf.steering_weight) == (1.0, 20.0)


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"rule": "cbf"}, "correction: rule: there is no 'cbf' (did you mean 'ecbf'?)"),
        ({"constrained": "some"}, "correction: constrained: expected 'gated' or 'all'"),
        ({"dt": 0.0}, "correction: dt: must be greater than 0"),
        ({"d_safe": -0.1}, "correction: d_safe: must be at least 0"),
        ({"ttcbf_rate": 1.5}, "correction: ttcbf_rate: must be at most 1"),
        ({"rule": "ecbf", "ecbf_rate1": math.nan}, "correction: ecbf_rate1: expected a finite number"),
        ({"gate_horizon": math.inf}, "correction: gate_horizon: expected a finite number"),
        ({"ecbf_rate1": 2.0}, "ecbf_rate1: has no effect with rule=ttcbf"),
        ({"rule": "ecbf", "ttcbf_road_rate": 0.2}, "ttcbf_road_rate: has no effect with rule=ecbf"),
        ({"constrained": "all", "gate_step": 0.1}, "gate_step: has no effect with constrained=all"),
        ({"road": False, "road_d_safe": 0.1}, "road_d_safe: has no effect with road=false"),
        ({"last_resort": False, "last_resort_margin": 1}, "last_resort_margin: has no effect"),
    ],
)
def test_settings_that_cannot_work(settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=re.escape(complaint)):
        FilterConfig.preset(**{"rule": "ttcbf", **settings})


@pytest.mark.parametrize("config", [*CONFIGS, FilterConfig.preset("ecbf", road=False, max_vehicles=None)])
def test_settings_come_back_from_what_is_written_of_them(config: FilterConfig) -> None:
    written = json.loads(json.dumps(config.model_dump(mode="json")))
    assert FilterConfig.model_validate(written) == config
    assert not any(name.startswith("ttcbf" if config.rule == "ecbf" else "ecbf") for name in written)


def test_unknown_settings() -> None:
    with pytest.raises(InputError, match="no such setting \\(did you mean 'd_safe'"):
        FilterConfig.preset("ttcbf", dsafe=0.3)
    with pytest.raises(InputError, match=r"correction: rule: there is no"):
        FilterConfig.preset("clf")


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
def test_other_solvers_give_the_same_action(solver: str) -> None:
    scene, u = wall(v=6.5), np.array([2.0, 0.0])
    mine, theirs = free(), free(FilterConfig(constrained="all", last_resort=False, solver=solver))
    assert theirs.filter(scene, u).u == pytest.approx(mine.filter(scene, u).u, abs=1e-6)
    hopeless = wall(v=12.0)
    assert theirs.filter(hopeless, u).status == mine.filter(hopeless, u).status == "relaxed"
