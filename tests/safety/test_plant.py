"""The plant monitor against the plant itself: every unusual car is recognised, an ordinary one never
suspected."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.safety.plant import PlantMonitor
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import GRAVITY, EgoPlant

BODY = EgoVehicle()
BRAKES_AT = 5
"""decision at which the driver below brakes fully, for PULSE decisions"""
PULSE = 5


def drive(
    actuation: Actuation, *, seed: int = 0, noise: float = 0.0, seconds: float = 4.0, pulse: bool = True
):
    """A monitor that has watched a drive, and the last estimate of every decision."""
    rng = np.random.default_rng(seed)
    plant, monitor = EgoPlant(BODY), PlantMonitor(BODY)
    plant.reset(0.0, 0.0, 0.0, 9.0, actuation)
    monitor.update(plant.state, (0.0, 0.0))
    found = []
    for k in range(round(seconds * 10)):
        u = 1.5 * np.sin(0.3 * k) + rng.normal(0.0, 0.3), 0.04 * np.sin(0.2 * k)
        if pulse and BRAKES_AT <= k < BRAKES_AT + PULSE:
            u = BODY.a_min, u[1]
        for _ in range(2):
            plant.step(*u, 0.05)
        read = replace(plant.state, acceleration=plant.state.acceleration + rng.normal(0.0, noise))
        found.append(monitor.update(read, u).actuation)
    return monitor, found


@pytest.mark.parametrize("seed", range(20))
def test_an_ordinary_car_is_never_suspected(seed):
    _, found = drive(Actuation(), seed=seed, noise=0.15, seconds=20.0)
    assert set(found) == {Actuation()}


@pytest.mark.parametrize("noise", [0.0, 0.15])
@pytest.mark.parametrize("friction", [0.15, 0.2, 0.27, 0.35, 0.5])
def test_friction_is_known_after_a_short_braking_and_stays_known(friction, noise):
    _, found = drive(Actuation(friction=friction), noise=noise, seconds=12.0)
    for actuation in (found[BRAKES_AT + 3], found[-1]):
        assert actuation.friction is not None
        assert 0.85 * friction <= actuation.friction <= 1.18 * friction
        assert actuation.delay_s + actuation.lag_s <= 0.05


def test_friction_does_not_show_where_nothing_exceeds_it():
    _, found = drive(Actuation(friction=0.5), pulse=False)
    assert set(found) == {Actuation()}


@pytest.mark.parametrize("noise", [0.0, 0.15])
@pytest.mark.parametrize("delay", [0.1, 0.2, 0.3, 0.4])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3])
def test_dead_time_and_lag_are_known_within_a_step(delay, lag, noise):
    _, found = drive(Actuation(delay, lag), noise=noise)
    assert found[-1].delay_s == pytest.approx(delay, abs=0.051)
    assert found[-1].lag_s == pytest.approx(lag, abs=0.051)
    assert found[-1].friction is None


@pytest.mark.parametrize(("decision_s", "substep_s"), [(0.05, 0.05), (0.12, 0.04), (0.2, 0.05)])
def test_dead_time_and_lag_are_known_however_long_a_decision_is(decision_s, substep_s):
    """Decisions were taken to last 0.1 s: at 0.2 s, half the dead time was found, at 0.05 s twice as much."""
    plant, monitor, rng = EgoPlant(BODY), PlantMonitor(BODY), np.random.default_rng(0)
    plant.reset(0.0, 0.0, 0.0, 6.0, Actuation(delay_s=0.2, lag_s=0.2))
    monitor.update(plant.state, (0.0, 0.0), decision_s)
    for _ in range(round(8.0 / decision_s)):
        u = rng.normal(0.0, 1.0), rng.normal(0.0, 0.04)
        for _ in range(round(decision_s / substep_s)):
            plant.step(*u, substep_s)
        found = monitor.update(plant.state, u, decision_s).actuation
    assert found.delay_s == pytest.approx(0.2, abs=0.061)
    assert found.lag_s == pytest.approx(0.2, abs=0.061)
    assert found.friction is None


def test_all_three_at_once():
    _, found = drive(Actuation(0.2, 0.1, 0.3), noise=0.15, seconds=6.0)
    assert found[-1].delay_s == pytest.approx(0.2, abs=0.051)
    assert found[-1].friction == pytest.approx(0.3, rel=0.2)


@pytest.mark.parametrize(
    ("delay", "lag"), [(1.05, 0.5), (1.35, 0.0), (1.5, 0.2), (2.0, 0.0), (0.0, 2.2), (0.2, 2.2)]
)
def test_very_slow_actuators_are_recognised(delay, lag):
    """Where the bank ended at 1.05 s and 1.25 s, one wrong car after the other was believed in."""
    _, found = drive(Actuation(delay, lag), seconds=10.0)
    for actuation in found[60:]:
        assert actuation.delay_s == pytest.approx(delay, abs=0.11)
        assert actuation.lag_s == pytest.approx(lag, rel=0.3, abs=0.1)
        assert actuation.friction is None


def test_long_dead_times_are_known_however_short_a_step_is():
    """With decisions of 0.08 s, steps were of 0.04 s, and the bank of 40 steps ended at 1.6 s."""
    plant, monitor, rng = EgoPlant(BODY), PlantMonitor(BODY), np.random.default_rng(0)
    plant.reset(0.0, 0.0, 0.0, 6.0, Actuation(delay_s=1.84))
    monitor.update(plant.state, (0.0, 0.0), 0.08)
    for _ in range(120):
        u = rng.normal(0.0, 1.0), rng.normal(0.0, 0.04)
        for _ in range(2):
            plant.step(*u, 0.04)
        found = monitor.update(plant.state, u, 0.08).actuation
    assert found.delay_s == pytest.approx(1.84, abs=0.081)
    assert found.friction is None


@pytest.mark.parametrize("decision_s", [0.01, 0.02, 0.04])
def test_long_dead_times_are_known_however_short_a_decision_is(decision_s):
    """The bank of 40 steps, a decision each, ended at 0.4 s, 0.8 s and 1.6 s."""
    plant, monitor, rng = EgoPlant(BODY), PlantMonitor(BODY), np.random.default_rng(0)
    plant.reset(0.0, 0.0, 0.0, 6.0, Actuation(delay_s=1.8))
    monitor.update(plant.state, (0.0, 0.0), decision_s)
    for k in range(round(8.0 / decision_s)):
        if k % 5 == 0:
            u = rng.normal(0.0, 1.0), rng.normal(0.0, 0.04)
        plant.step(*u, decision_s)
        found = monitor.update(plant.state, u, decision_s).actuation
    assert found.delay_s == pytest.approx(1.8, abs=0.081)
    assert found.friction is None


def test_a_car_that_changes_on_the_way_is_noticed():
    plant, monitor = EgoPlant(BODY), PlantMonitor(BODY)
    plant.reset(0.0, 0.0, 0.0, 10.0)
    monitor.update(plant.state, (0.0, 0.0))
    noticed = None
    for k in range(60):
        if k == 30:
            plant.actuation = Actuation(friction=0.2)
        u = (-5.0 if k % 10 < 3 else 2.0), 0.02 * np.sin(0.5 * k)
        for _ in range(2):
            plant.step(*u, 0.05)
        estimate = monitor.update(plant.state, u)
        if estimate.unusual and noticed is None:
            noticed = k
    assert noticed is not None
    assert 30 <= noticed <= 33
    assert estimate.grip == pytest.approx(0.2 * GRAVITY, rel=0.16)


@pytest.mark.parametrize("lag", [0.5, 0.8, 1.25])
def test_a_lag_that_begins_in_a_bend_is_soon_known_and_forgotten_once_over(lag):
    """Models were driven on from the episode's start, as if the lag had always been there: none fitted, and
    the road was taken for ice until the lag was over."""
    plant, monitor, found = EgoPlant(BODY), PlantMonitor(BODY), []
    plant.reset(0.0, 0.0, 0.0, 8.5)
    monitor.update(plant.state, (0.0, 0.0))
    for k in range(60):
        if k in (20, 45):
            plant.actuation = Actuation(0.1, lag) if k == 20 else Actuation()
        u = 0.3 * np.sin(0.3 * k), 0.2 * min(max(k - 15, 0) / 20, 1.0) + 0.05 * np.sin(0.4 * k)
        for _ in range(2):
            plant.step(*u, 0.05)
        found.append(monitor.update(plant.state, u).actuation)
    assert set(found[:20]) == {Actuation()}
    assert sum(actuation.friction is not None for actuation in found) <= 4
    for actuation in found[35:45]:
        assert 0.6 * (0.1 + lag) < actuation.delay_s + actuation.lag_s < 1.3 * (0.1 + lag)
    assert set(found[49:]) == {Actuation()}


@pytest.mark.parametrize("friction", [0.63, 0.65, 0.67, 0.71, 0.73, 0.78, 0.8])
def test_a_wet_road_that_only_bends_show_is_not_taken_for_a_late_car(friction):
    """A friction between two of the bank's looked like a lag, with which the wheels stay where they are."""
    plant, monitor, found = EgoPlant(BODY), PlantMonitor(BODY), []
    plant.reset(0.0, 0.0, 0.0, 9.3, Actuation(friction=friction))
    monitor.update(plant.state, (0.0, 0.0))
    for k in range(40):
        grip = monitor.estimate.grip
        u = -1.0 if plant.state.v**2 * 0.1 > 0.9 * grip else 0.5, min(0.02 * k, 0.29)
        for _ in range(2):
            plant.step(*u, 0.05)
        found.append(monitor.update(plant.state, u).actuation)
    for actuation in found[20:]:
        assert (actuation.delay_s, actuation.lag_s) == (0.0, 0.0)
        assert actuation.friction == pytest.approx(friction, rel=0.08)


def in_bends(actuation: Actuation, noise: float, seed: int = 0):
    """Estimates of all decisions of a drive through bends, in which the car brakes fully at first."""
    rng, plant, monitor, found = np.random.default_rng(seed), EgoPlant(BODY), PlantMonitor(BODY), []
    plant.reset(0.0, 0.0, 0.0, 9.0, actuation)
    monitor.update(plant.state, (0.0, 0.0))
    for k in range(90):
        u = 1.5 * np.sin(0.3 * k) + rng.normal(0.0, 0.3), 0.3 * np.sin(0.12 * k)
        if BRAKES_AT <= k < BRAKES_AT + PULSE:
            u = BODY.a_min, u[1]
        for _ in range(2):
            plant.step(*u, 0.05)
        read = replace(plant.state, acceleration=plant.state.acceleration + rng.normal(0.0, noise))
        found.append(monitor.update(read, u).actuation)
    return found


@pytest.mark.parametrize("noise", [0.0, 0.15])
@pytest.mark.parametrize("friction", [0.13, 0.25, 0.33, 0.41, 0.43, 0.51])
def test_ice_that_braking_has_shown_is_not_forgotten_in_bends(friction, noise):
    """A friction between two of the bank's was taken for a car with slow actuators on a dry road."""
    for actuation in in_bends(Actuation(friction=friction), noise)[BRAKES_AT + PULSE :]:
        assert actuation.friction == pytest.approx(friction, rel=0.2)
        assert actuation.delay_s + actuation.lag_s <= 0.1


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("lag", [0.5, 0.8])
def test_a_late_car_with_noisy_readings_is_not_thought_to_be_on_a_wet_road(delay, lag):
    """Noise counted for less beside a friction that bends show, so that one was found with a long lag."""
    for seed in range(4):
        assert {each.friction for each in in_bends(Actuation(delay, lag), 0.15, seed)[40:]} == {None}


def test_commands_on_their_way_are_those_given_within_the_dead_time():
    monitor = PlantMonitor(BODY)
    state = EgoPlant(BODY).state
    monitor.update(state, (0.0, 0.0))
    for a in (1.0, 2.0, 3.0):
        monitor.update(replace(state, v=5.0), (a, 0.0))
    assert monitor.pending(0.0) == []
    assert [a for a, _ in monitor.pending(0.2)] == [2.0, 2.0, 3.0, 3.0]


def test_the_commands_of_the_longest_dead_time_are_remembered():
    """Only those of the last 0.7 s were."""
    monitor, state = PlantMonitor(BODY), EgoPlant(BODY).state
    for k in range(30):
        monitor.update(replace(state, v=5.0), (0.1 * k, 0.0))
    assert [a for a, _ in monitor.pending(2.0)] == pytest.approx(
        [0.1 * k for k in range(10, 30) for _ in "ab"]
    )


def test_a_car_that_responds_very_late_or_hardly_grips_is_known_too():
    """Dead times above 0.6 s and frictions below 0.09 were taken for the nearest in the bank."""
    _, late = drive(Actuation(1.0, 0.2), seconds=8.0)
    assert late[-1].delay_s == pytest.approx(1.0, abs=0.051)
    assert late[-1].lag_s == pytest.approx(0.2, abs=0.051)
    _, slow = drive(Actuation(0.1, 0.8), seconds=8.0)
    assert slow[-1].lag_s == pytest.approx(0.8, abs=0.051)
    _, ice = drive(Actuation(friction=0.05))
    assert ice[-1].friction == pytest.approx(0.05, rel=0.2)
