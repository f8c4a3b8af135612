"""Short full brakings that ask the road how well it grips: when, and what is won by them."""

# ruff: noqa: F811 -- fixtures come by import
import math
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.adaptation import Adaptation
from rudc.agents.base import Decision
from rudc.agents.outlook import OutlookAgent, OutlookSettings
from rudc.agents.probe import FRESH, LONGEST_S, SLOWEST, Probe
from rudc.env.episode import Episode
from rudc.env.tracking import steering
from rudc.safety.plant import PlantEstimate
from rudc.vehicle import Actuation
from tests.plans import PlanSource, event
from tests.world.conftest import four_way, make_scene, world_on  # noqa: F401 -- fixtures

DRY = 0.9 * 9.81


class Hurried:
    """Follows its path at 10 m/s, whatever comes."""

    name, ego_driver = "hurried", "agent"

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        u = np.array([2.0 * (10.0 - scene.ego.v), steering(scene)])
        return Decision(u, u)


def looked(probe, scene, way=0.0, grip=DRY, **ego):
    """The scene `way` m on, taken in by the probe."""
    here = replace(scene, time_s=scene.time_s + way / scene.ego.v, ego=replace(scene.ego, **ego))
    probe.look(here, grip)
    return here


def asks(probe, scene, allowed, *, limited=False):
    return probe.asks(scene, DRY, limited=limited, allowed=allowed)


def test_it_asks_at_once_until_the_road_has_answered_and_again_where_it_is_too_fast(make_scene):
    scene, probe = make_scene(front=-60.0, v=10.0), Probe()
    looked(probe, scene)
    assert asks(probe, scene, 20.0)
    scene = looked(probe, scene, 1.0, acceleration=-6.0)
    assert not asks(probe, scene, 5.0)  # shown
    scene = looked(probe, scene, FRESH - 1.0, acceleration=0.0)
    assert not asks(probe, scene, 5.0)  # not long ago
    scene = looked(probe, scene, 2.0)
    assert not asks(probe, scene, 11.0)  # slow enough for half of it
    assert asks(probe, scene, 9.0)


def test_it_never_asks_in_the_junction_not_even_first(make_scene):
    inside, probe = make_scene(front=3.0, v=6.0), Probe()
    looked(probe, inside)
    assert not asks(probe, inside, 20.0)
    before = make_scene(front=-10.0, v=6.0)
    looked(probe, before)
    assert asks(probe, before, 20.0)


@pytest.mark.parametrize(("front", "often"), [(-60.0, True), (30.0, False)])
def test_on_a_poor_road_it_asks_before_the_stop_line_and_not_behind_the_junction(make_scene, front, often):
    adaptation = Adaptation("estimated", probe=True)
    scene = make_scene(turn="straight", front=front, v=6.0)
    adaptation.reset(scene)
    adaptation.see(scene)
    adaptation.estimate = PlantEstimate(Actuation(friction=0.2), unusual=True)
    asked, s = 0, scene.ego_s
    for k in range(90):
        x, y, psi = map(float, scene.route.path.pose(s))
        here = replace(scene, time_s=3.0 + 0.1 * k, ego=replace(scene.ego, x=x, y=y, psi=psi), ego_s=s)
        adaptation._probe.look(here, 0.2 * 9.81)
        asked += adaptation._asks(here, 0.2 * 9.81)
        s += 0.6
        if front < 0.0 and s + 2.5 > scene.route.stop_line_s:
            break
    assert (asked > 1) == often, "after the first of all"


def test_who_creeps_does_not_ask(make_scene):
    scene, probe = make_scene(front=-60.0, v=0.9 * SLOWEST), Probe()
    looked(probe, scene)
    assert not asks(probe, scene, 1.0)


def test_a_bend_that_is_taken_shows_the_same(make_scene):
    scene, probe = make_scene(front=-60.0, v=10.0), Probe()
    tight = math.atan(scene.vehicle.wheelbase * 7.0 / 10.0**2)
    scene = looked(probe, scene, steering=tight)
    scene = looked(probe, scene, 1.0, steering=0.0)
    assert not asks(probe, scene, 5.0)


@pytest.mark.parametrize(("front", "angle"), [(3.0, 0.0), (-30.0, 0.12)])
def test_neither_in_the_junction_nor_in_a_bend(make_scene, front, angle):
    far, probe = make_scene(front=-60.0, v=10.0), Probe()
    looked(probe, far, acceleration=-6.0)
    scene = make_scene(front=front, v=10.0)
    scene = replace(scene, time_s=far.time_s + 6.0, ego=replace(scene.ego, steering=angle))
    probe.look(scene, DRY)
    assert not asks(probe, scene, 5.0)


def test_a_road_that_does_not_answer_is_not_asked_for_longer_than_stated(make_scene):
    scene, probe = make_scene(front=-60.0, v=10.0), Probe()
    asked = 0
    for _ in range(20):
        looked(probe, scene, acceleration=-2.0)
        if not asks(probe, scene, 20.0):
            break
        asked, scene = asked + 1, replace(scene, time_s=scene.time_s + 0.1)
    assert asked == round(LONGEST_S / 0.1)


@pytest.mark.parametrize("friction", [0.45, 0.5, 0.56, None])
def test_what_a_wet_road_gives_is_known_after_the_first_braking(world_on, friction):
    wet = (event("low_friction", friction=friction),) if friction else ()
    plan = PlanSource(origin="south", turn="straight", distance=(60.0, 60.0), density=1.0, events=wet).plan(0)
    agent = OutlookAgent(Hurried(), "hurried", OutlookSettings(plant="estimated").make())
    episode = Episode(world_on("four_way"))
    scene = episode.reset(plan)
    agent.reset(scene, 0)
    braked = []
    for _ in range(10):
        decision = agent.act(scene)
        braked.append(decision.u[0] == -6.0)
        scene = episode.step(decision.u).scene
    known = decision.plant.actuation.friction
    if friction is None:
        assert known is None
        assert sum(braked) == 1
    else:
        assert known == pytest.approx(friction, rel=0.06)
        assert sum(braked) <= LONGEST_S / 0.1


@pytest.mark.parametrize(("probe", "outcome"), [(True, "success"), (False, "off_road")])
def test_a_road_that_turns_wet_before_a_bend_is_found_out_in_time(world_on, probe, outcome):
    wet = event("low_friction", friction=0.3, when={"ego_distance_to_junction": {"below": 20.0}})
    plan = PlanSource(network="roundabout", origin="south", turn="left", density=1.0, events=(wet,)).plan(0)
    agent = OutlookAgent(Hurried(), "hurried", OutlookSettings(plant="estimated", probe=probe).make())
    episode = Episode(world_on("roundabout"))
    scene = episode.reset(plan)
    agent.reset(scene, 0)
    while episode.outcome is None:
        scene = episode.step(agent.act(scene).u).scene
    assert episode.outcome == outcome
