"""Of the braking that an event asks for and that of the yielding layer the harder acts, at every decision."""

from dataclasses import replace

import libsumo
import numpy as np
import pytest

from rudc.world.events.selection import pick
from tests.plans import event
from tests.world.test_event_ends import LED, run_on


@pytest.fixture
def led(world, monkeypatch):
    """m/s of a leader that the yielding layer brakes with `asked` m/s2, at the start and after each of so
    many decisions; an event slows it down to `slow` m/s, with 3 m/s2, from the decision `after` on."""

    def drive(slow, asked, decisions, after=0):
        when = {"simulation_time": {"above": 0.1 * after - 0.05}} if after else None
        slows = event("slow_vehicle", vehicle="leader", speed=slow, when=when)
        scene = world.reset(replace(LED, density=0.0, events=(slows,)).plan(0))
        name = scene.ids[pick(scene, "leader", np.random.default_rng(0))[0]]

        def brake(scene, s):
            world._brakes.apply({name: (libsumo.vehicle.getSpeed(name), asked)}, s)

        monkeypatch.setattr(world, "_brake", brake)
        return run_on(world, decisions, name)

    return drive


@pytest.mark.parametrize(("gap", "looks"), [(0.3, 10), (0.8, 2)])
def test_the_yielding_layer_looks_at_every_decision_while_somebody_is_at_the_egos_side(
    world, monkeypatch, gap, looks
):
    """Twice a second is too seldom there: an SV set off beside an ego that drove, and into it as it stopped
    again.
    """
    stands = event("accident", objects=[{"lane": "north_in_0", "at": 20, "size": [4, 2]}])
    there = world.reset(replace(LED, density=0.0, events=(stands,)).plan(0))
    i = there.ids.index("accident0:0")
    (x, y), psi, (_, width) = there.position[i], float(there.heading[i]), there.size[i]
    aside = gap + 0.5 * (width + world.vehicle.width)
    world.put_ego(x - aside * np.sin(psi), y + aside * np.cos(psi), psi)
    seen, brake = [], world._brake
    monkeypatch.setattr(world, "_brake", lambda scene, s: (seen.append(s), brake(scene, s)))
    for _ in range(10):
        world.advance(np.array([-6.0, 0.0]))
    assert len(seen) == looks


@pytest.mark.parametrize("asked", [0.0, 1.0, 2.8, 5.0])
def test_who_is_slowed_down_brakes_no_less_hard_where_it_must_yield_too(led, asked):
    """The yielding layer's weaker braking took the place of the event's."""
    assert np.diff(led(1.0, asked, 7)) == pytest.approx(-0.1 * max(asked, 3.0), abs=0.02)


@pytest.mark.parametrize("after", [0, 2])
def test_who_is_slow_enough_for_an_event_brakes_on_to_yield(led, after):
    """From then on, not from the layer's next look."""
    begin = 9.0 - 0.1 * after
    slowed = -np.diff(led(begin - 0.6, 1.0, 5, after))
    assert slowed[after : after + 2] == pytest.approx(0.3, abs=0.02)
    assert np.delete(slowed, [after, after + 1]) == pytest.approx(0.1, abs=0.02)


def test_at_the_speed_it_is_slowed_down_to_it_brakes_to_yield(world, led):
    """However hard the event would brake it: it brakes it no more."""
    led(5.0, 1.0, 1)
    (name,) = world.happenings()[0].bodies
    world.stage.scene = world.scene()
    speed = world.stage.speed(name)
    world.stage.slow_down(name, 9.0, least=speed)
    world._brakes.apply({name: (speed, 1.0)}, 0.5)
    world._sumo.step()
    assert libsumo.vehicle.getSpeed(name) < speed - 0.04


def test_an_ego_that_sumo_drove_off_the_road_is_neither_let_off_the_brakes_nor_slips(world, monkeypatch):
    """SUMO was asked to do so to a vehicle that it no longer knew: the episode failed."""
    ice = event("low_friction", friction=0.2, when={"simulation_time": {"above": 30.0}})
    world.reset(replace(LED, density=0.0, turn="right", events=(ice,)).plan(0), ego_driver="sumo")

    def brake(scene, s):
        held = {"ego": (30.0, 0.0)}  # it drives on
        world._brakes.apply(held if "ego" in libsumo.vehicle.getIDList() else {}, s)

    monkeypatch.setattr(world, "_brake", brake)
    while world.scene().time_s < 31.0:
        world.advance(np.zeros(2))
    assert "ego" not in libsumo.vehicle.getIDList()
    assert world.happenings()[0].begun_s is not None
