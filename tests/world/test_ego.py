"""The ego's plant agrees with an independent integration of its equations, and does what any car does."""

# pyright: reportPossiblyUnboundVariable=false, reportOperatorIssue=false
# states are read after loops that always run
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, EgoPlant, realised

BODY = EgoVehicle()
DT = 0.05
GRIPS = 1e3
"""friction of a road on which no car slides"""

speeds = st.floats(0.0, 14.0)
accelerations = st.floats(-6.0, 3.0)
angles = st.floats(-0.6, 0.6)
headings = st.floats(-math.pi, math.pi)
commands = st.lists(st.tuples(accelerations, angles), min_size=1, max_size=12)


def integrate(state, a, delta, dt, lag=0.0, a0=None, delta0=None):
    """x, y, psi, v after dt by scipy, stopping where the speed reaches 0 or v_max."""
    a0, delta0 = (a if a0 is None else a0), (delta if delta0 is None else delta0)

    def lagged(target, start, t):
        return target if lag == 0 else target + (start - target) * math.exp(-t / lag)

    def rates(t, y):
        v = min(max(y[3], 0.0), BODY.v_max)
        slip = math.atan(BODY.cg_to_rear / BODY.wheelbase * math.tan(lagged(delta, delta0, t)))
        push = lagged(a, a0, t)
        if (y[3] <= 0 and push < 0) or (y[3] >= BODY.v_max and push > 0):
            push = 0.0
        return [
            v * math.cos(y[2] + slip),
            v * math.sin(y[2] + slip),
            v * math.sin(slip) / BODY.cg_to_rear,
            push,
        ]

    found = solve_ivp(rates, (0.0, dt), state, rtol=1e-10, atol=1e-12, max_step=dt / 50)
    return found.y[:, -1]


def plant_at(x, y, psi, v, actuation=None):
    plant = EgoPlant(BODY)
    plant.reset(x, y, psi, v, actuation or Actuation(friction=GRIPS))
    return plant


@settings(max_examples=60)
@given(headings, st.floats(2.0, 11.0), commands)
def test_follows_the_bicycle_model(psi, v, inputs):
    plant = plant_at(3.0, -2.0, psi, v)
    expected = np.array([3.0, -2.0, psi, v])
    for a, delta in inputs:
        if not 0.4 < expected[3] + a * DT < BODY.v_max - 0.4:
            a = 0.0
        expected = integrate(expected, a, delta, DT)
        state = plant.step(a, delta, DT)
    assert [state.x, state.y, state.psi, state.v] == pytest.approx(expected, abs=2e-6)
    slip = math.atan(BODY.cg_to_rear / BODY.wheelbase * math.tan(delta))
    assert state.slip == pytest.approx(slip)
    assert state.yaw_rate == pytest.approx(state.v * math.sin(slip) / BODY.cg_to_rear)
    assert state.acceleration == pytest.approx(a)
    assert state.steering == delta


@settings(max_examples=40)
@given(st.floats(3.0, 10.0), st.floats(0.05, 0.8), commands)
def test_follows_commands_with_a_first_order_lag(v, lag, inputs):
    plant = plant_at(0.0, 0.0, 0.4, v, Actuation(lag_s=lag, friction=GRIPS))
    expected, a0, delta0 = np.array([0.0, 0.0, 0.4, v]), 0.0, 0.0
    for a, delta in inputs:
        if not 1.0 < expected[3] < BODY.v_max - 1.0:
            a = -a0
        a, delta = 0.3 * a, delta
        expected = integrate(expected, a, delta, DT, lag, a0, delta0)
        state = plant.step(a, delta, DT)
        decay = math.exp(-DT / lag)
        a0, delta0 = a + (a0 - a) * decay, delta + (delta0 - delta) * decay
        assert state.acceleration == pytest.approx(a0)
        assert state.steering == pytest.approx(delta0)
    assert [state.x, state.y, state.psi, state.v] == pytest.approx(expected, abs=5e-6)


@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_stops_within_a_step_where_it_would_by_hand(lag):
    v, a = 0.2, -6.0
    plant = plant_at(1.0, 0.0, 0.0, v, Actuation(lag_s=lag))
    for _ in range(12):
        state = plant.step(a, 0.0, DT)
    if lag == 0:
        travelled = v**2 / (2 * -a)
    else:
        times = np.linspace(0.0, 12 * DT, 200_001)
        speed = v + a * (times - lag * (1 - np.exp(-times / lag)))
        travelled = np.trapezoid(np.maximum(speed, 0.0), times)
    assert state.v == 0.0
    assert state.x == pytest.approx(1.0 + travelled, abs=1e-5)
    assert state.y == 0.0


def test_never_rolls_back_and_starts_again():
    plant = plant_at(0.0, 0.0, 0.3, 1.0)
    for _ in range(20):
        state = plant.step(-6.0, 0.2, DT)
    assert (state.v, state.acceleration, state.yaw_rate) == (0.0, 0.0, 0.0)
    here = state.x, state.y, state.psi
    for _ in range(20):
        state = plant.step(-6.0, 0.2, DT)
    assert (state.x, state.y, state.psi) == here
    assert plant.step(2.0, 0.0, DT).v == pytest.approx(0.1)


def test_keeps_to_its_limits():
    plant = plant_at(0.0, 0.0, 0.0, 14.9)
    assert plant.step(99.0, 9.0, DT).steering == BODY.delta_max
    assert plant.state.v <= BODY.v_max
    for _ in range(10):
        state = plant.step(99.0, 0.0, DT)
    assert state.v == BODY.v_max
    assert state.acceleration == pytest.approx(0.0)
    assert plant.step(-99.0, -9.0, DT).acceleration == pytest.approx(BODY.a_min)
    assert plant.state.steering == -BODY.delta_max


def test_top_speed_is_reached_in_place_and_time():
    plant = plant_at(0.0, 0.0, 0.0, 14.9)
    expected = integrate([0.0, 0.0, 0.0, 14.9], 3.0, 0.0, DT)
    state = plant.step(3.0, 0.0, DT)
    assert state.x == pytest.approx(expected[0], abs=1e-3)


def test_commands_arrive_late():
    plant = plant_at(0.0, 0.0, 0.0, 8.0, Actuation(delay_s=0.2))
    realised = [plant.step(-3.0, 0.1, DT) for _ in range(8)]
    assert [state.acceleration for state in realised[:4]] == [0.0] * 4
    assert [state.acceleration for state in realised[4:]] == pytest.approx([-3.0] * 4)
    assert [state.steering for state in realised] == [0.0] * 4 + [0.1] * 4
    plant.reset(0.0, 0.0, 0.0, 8.0, Actuation(delay_s=0.2))
    assert plant.step(-3.0, 0.1, DT).acceleration == 0.0, "a reset forgets the commands on their way"


@settings(max_examples=100)
@given(speeds, st.floats(0.05, 1.0), accelerations, angles)
def test_friction_bounds_the_total_acceleration(v, mu, a, delta):
    plant = plant_at(0.0, 0.0, 0.0, v, Actuation(friction=mu))
    state = plant.step(a, delta, DT)
    lateral = v * v * math.sin(state.slip) / BODY.cg_to_rear
    assert math.hypot(lateral, state.acceleration) <= mu * GRAVITY + 1e-6


def test_a_dead_time_that_begins_holds_the_last_command_and_one_that_ends_lets_go():
    plant = plant_at(0.0, 0.0, 0.0, 8.0, Actuation())
    plant.step(-1.0, 0.05, DT)
    plant.actuation = Actuation(delay_s=0.1)
    late = [plant.step(-2.0 - k, 0.0, DT).acceleration for k in range(4)]
    assert late == pytest.approx([-1.0, -1.0, -2.0, -3.0])
    plant.actuation = Actuation(delay_s=0.05)
    assert plant.step(-6.0, 0.0, DT).acceleration == pytest.approx(-5.0)
    plant.actuation = Actuation()
    assert plant.step(1.0, 0.0, DT).acceleration == pytest.approx(1.0)


@pytest.mark.parametrize("v", [6.0, 10.0, 14.0])
def test_a_dry_road_has_its_limit_too(v):
    plant = plant_at(0.0, 0.0, 0.0, v, Actuation())
    for _ in range(20):
        state = plant.step(-3.0, 0.5, DT)
        assert math.hypot(state.v * state.yaw_rate, state.acceleration) <= DRY * GRAVITY + 1e-6


def test_friction_leaves_a_gentle_drive_alone():
    free, slippery = plant_at(0, 0, 0, 5.0), plant_at(0, 0, 0, 5.0, Actuation(friction=0.5))
    for _ in range(20):
        one, other = free.step(1.0, 0.05, DT), slippery.step(1.0, 0.05, DT)
    assert one == other


def test_braking_takes_longer_on_ice():
    dry, ice = plant_at(0, 0, 0, 8.0), plant_at(0, 0, 0, 8.0, Actuation(friction=0.1))
    for _ in range(400):
        on_dry, on_ice = dry.step(-6.0, 0.0, DT), ice.step(-6.0, 0.0, DT)
    assert on_dry.x == pytest.approx(64 / 12, abs=1e-6)
    assert on_ice.x == pytest.approx(64 / (2 * 0.1 * GRAVITY), abs=1e-6)
    assert on_ice.v == 0.0


@settings(max_examples=30)
@given(speeds, accelerations, angles)
def test_two_half_steps_are_one_step(v, a, delta):
    one, two = plant_at(0, 0, 0.7, v), plant_at(0, 0, 0.7, v)
    whole = one.step(a, delta, DT)
    two.step(a, delta, DT / 2)
    halves = two.step(a, delta, DT / 2)
    assert [halves.x, halves.y, halves.psi, halves.v] == pytest.approx(
        [whole.x, whole.y, whole.psi, whole.v], abs=5e-4
    )


@settings(max_examples=60)
@given(st.floats(1.0, 12.0), headings, accelerations, angles)
def test_what_somebody_else_did_is_told_from_the_states(v, psi, a, delta):
    plant = plant_at(0.0, 0.0, psi, v)
    before = plant.state
    plant.step(a, delta, DT)
    after = plant.step(a, delta, DT)
    assert realised(before, after, 2 * DT, BODY) == pytest.approx((a, delta), abs=1e-6)


def test_a_standing_vehicle_says_nothing_about_its_wheels():
    plant = plant_at(0.0, 0.0, 1.0, 0.0)
    assert realised(plant.state, plant.state, 0.1, BODY) == (0.0, 0.0)


def test_a_road_that_turns_slippery_is_felt_at_once_also_behind_a_lag():
    plant = plant_at(0.0, 0.0, 0.0, 10.0, Actuation(lag_s=0.3))
    for _ in range(40):
        state = plant.step(0.0, 0.2, 0.05)
    assert state.v * state.yaw_rate > 6.0
    plant.actuation = Actuation(lag_s=0.3, friction=0.2)
    for _ in range(20):
        state = plant.step(-6.0, 0.2, 0.05)
        assert math.hypot(state.v * state.yaw_rate, state.acceleration) < 0.2 * GRAVITY + 0.02


def test_a_lag_too_short_to_be_felt_takes_no_time():
    """A lag of 1e-6 s, which scenarios allow, took 200,000 Runge-Kutta steps: 5 s for each sub-step."""
    felt, none = (plant_at(0.0, 0.0, 0.4, 8.0, Actuation(lag_s=lag)) for lag in (1e-9, 0.0))
    began = time.process_time()
    state, wanted = (plant.step(1.0, 0.1, DT) for plant in (felt, none))
    assert time.process_time() - began < 1.0
    assert (state.x, state.y, state.psi, state.v) == pytest.approx(
        (wanted.x, wanted.y, wanted.psi, wanted.v), abs=1e-3
    )
