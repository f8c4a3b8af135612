"""No surrounding vehicle jumps into another lane where SUMO does not see the ego."""

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.scenario import load_scenario
from rudc.world.lane_keeping import LaneKeeping
from rudc.world.props import Prop, standing
from rudc.world.scene import Kind
from tests.plans import PlanSource, event
from tests.world.conftest import four_way, make_scene, world, world_on  # noqa: F401 -- fixtures


def test_inside_the_junction_nobody_near_the_ego_changes_lanes(world_on):  # noqa: F811
    """Seed 8 had a car jump sideways onto the ego's corner at 6.4 s."""
    found = load_scenario("wrong_way_driver")
    world = world_on(found.network)  # noqa: F811
    episode = Episode(world)
    scene = episode.reset(found.plan(8))
    agent = make_agent("rudc-t")
    agent.reset(scene, 8)
    paths, jumps = scene.network.paths, 0
    while episode.outcome is None and scene.time_s < 9.0:
        before = {name: (scene.path[i], scene.position[i]) for i, name in enumerate(scene.ids)}
        scene = episode.step(agent.act(scene).u).scene
        for i, name in enumerate(scene.ids):
            row, position = before.get(name, (-1, None))
            if row < 0 or scene.path[i] < 0 or position is None:
                continue
            inside = paths.stop_s[row] < scene.path_s[i] < paths.exit_s[row]
            moved = scene.position[i] - position
            jumps += inside and scene.path[i] != row and float(moved @ moved) > 2.5**2
    assert not jumps
    assert episode.outcome is None


class Held:
    """In SUMO's place: who is held in its lane."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def hold_lane(self, name: str) -> int:
        self.names.append(name)
        return 0


@pytest.mark.parametrize(("gap", "held"), [(24.0, True), (26.0, False)])
def test_near_a_long_closure_it_is_its_near_end_that_counts(make_scene, four_way, gap, held):  # noqa: F811
    row = four_way.movement("south", "north").rows[0]
    scene = make_scene({"row": row, "s": 0.5 * (four_way.paths.stop_s[row] + four_way.paths.exit_s[row])})
    x, y = scene.position[0]
    closure = standing("closure", Kind.OBSTACLE, x, y + 2.5 + gap + 30.0, scene.heading[0], 60.0, 3.0)
    sumo = Held()
    LaneKeeping(sumo).step(scene, [closure])  # pyright: ignore[reportArgumentType]
    assert sumo.names == ["other0"] * held


@pytest.mark.parametrize(("gap", "speed", "held"), [(14.0, 1.4, True), (16.0, 1.4, False), (5.0, 0.0, False)])
def test_nobody_changes_lanes_beside_somebody_who_walks_over_the_road(make_scene, four_way, gap, speed, held):  # noqa: F811
    """A car hopped from lane to lane beside pedestrians on an arm, and drove into one."""
    scene = make_scene({"row": four_way.movement("south", "north").rows[0], "s": 50.0})
    x, y = scene.position[0]
    way = np.array([[x, y + 2.5 + gap + 0.25], [x + 4.0, y + 2.5 + gap + 0.25]])
    walker = Prop("walker", Kind.PEDESTRIAN, (0.5, 0.5), way, wanted=speed)
    sumo = Held()
    LaneKeeping(sumo).step(scene, [walker])  # pyright: ignore[reportArgumentType]
    assert sumo.names == ["other0"] * held


def test_what_is_taken_away_beside_somebody_who_walks_is_no_vehicle(world):  # noqa: F811
    """An accident that was over was to be held in its lane, and SUMO did not know it."""
    accident = event("accident", vehicles=[{"lane": "north_in_0", "at": 20}], duration=2.0)
    walkers = event("pedestrian_crossing", arm="north", at=10, speed=1.0, count=3)
    world.reset(PlanSource(density=0.0, speed=(0.0, 0.0), events=(accident, walkers)).plan(0))
    there = set[str]()
    for _ in range(30):
        world.advance(np.array([-6.0, 0.0]))
        there |= set(world.scene().ids)
    assert "accident0:0" in there - set(world.scene().ids)
