"""The others that an outlook shows, in the order of their distances."""

# ruff: noqa: F811 -- fixtures come by import
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.outlook import OutlookSettings
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.vehicle import Actuation
from rudc.world.perception import Sensors
from tests.plans import PlanSource
from tests.world.conftest import four_way, world, world_on  # noqa: F401 -- fixtures


@pytest.mark.parametrize(
    ("flaw", "actuation"),
    [
        ({"position_std": 0.5}, None),
        ({"miss": 0.4}, None),
        ({"position_std": 0.5, "miss": 0.4}, None),
        ({}, Actuation(delay_s=0.4)),
    ],
)
def test_the_nearest_come_first_whatever_the_others_are_taken_for(world, flaw, actuation):
    """Smoothed, remembered, or where they will be when a command acts."""
    plan = PlanSource(origin="south", turn="left", density=30.0).plan(4)
    episode, agent = Episode(world), make_agent("gap-acceptance")
    scenes = [episode.reset(plan)]
    agent.reset(scenes[0], 4)
    while episode.outcome is None:
        scenes.append(episode.step(agent.act(scenes[-1]).u).scene)
    scenes = [replace(scene, actuation=actuation or scene.actuation) for scene in scenes]
    outlook = OutlookSettings(course=True, plant="known").make()
    assert outlook is not None
    outlook.reset(scenes[0])
    rng, moved = np.random.default_rng(0), 0
    for scene in scenes:
        given = Sensors(**flaw).perceive(scene, rng)
        shown = outlook.see(given)
        away = np.hypot(*(shown.position - shown.ego_position).T)
        assert (np.diff(away) >= 0.0).all()
        moved += shown.ids != given.ids
    assert moved > 10
