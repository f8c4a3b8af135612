"""What sumo-gui is shown: everybody where they are in our SUMO, the ego among them, and nobody else."""

import os

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.drawing.palette import EVENT
from rudc.drawing.sumo_gui import EGO_NAME, SumoGui
from rudc.drawing.view import view_of
from rudc.env.episode import Episode
from rudc.errors import InputError
from rudc.evaluation.rollout import run_episode
from rudc.network.build import find_program
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.world import World

PROGRAM = find_program("sumo")
assert PROGRAM is not None


@pytest.mark.parametrize("name", ["blocked_left_turn", "jaywalkers", "roundabout_crossing"])
def test_everybody_stands_where_they_are_in_ours(name):
    """The same file, without its window."""
    scenario, agent = load_scenario(name, {"episode.timeout": 4}), make_agent("gap-acceptance")
    with World(load_network(scenario.network)) as world:
        episode, seen = Episode(world), []
        shown = SumoGui(PROGRAM, world.network.path, 1000.0)

        def watch(_scene, _decision, result):
            view = view_of(world, result.outcome)
            shown.show(view)
            there = shown._traci.vehicle
            scene = view.truth
            wanted = {f"sv {n}": (*p, s[0], h) for n, p, s, h in zip(scene.ids, scene.position, scene.size,
                                                                     scene.heading, strict=True)}  # fmt: skip
            wanted[EGO_NAME] = (scene.ego.x, scene.ego.y, scene.vehicle.length, scene.ego.psi)
            assert set(there.getIDList()) == wanted.keys()
            for who, (x, y, length, psi) in wanted.items():
                front = x + 0.5 * length * np.cos(psi), y + 0.5 * length * np.sin(psi)
                assert there.getPosition(who) == pytest.approx(front, abs=0.01), who
                assert there.getAngle(who) == pytest.approx((90.0 - np.degrees(psi)) % 360.0, abs=0.01)
            seen.append({there.getColor(f"sv {n}")[:3] for n in view.numbers})

        run_episode(episode, scenario.plan(3), agent, watch=watch)
        shown.close()
    assert len(seen) == 40
    if name == "blocked_left_turn":
        assert seen[0] == {EVENT}


def test_without_a_display_it_says_so(monkeypatch):
    program = find_program("sumo-gui")
    assert program is not None
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"needs a display.*--replay FILE.html"):
        SumoGui(program, load_network("four_way").path, 10.0)


@pytest.mark.skipif("DISPLAY" not in os.environ, reason="no display for sumo-gui to open its window on")
def test_the_window_follows_the_ego():
    scenario, agent = load_scenario("dense_left_turn", {"episode.timeout": 1}), make_agent("gap-acceptance")
    program = find_program("sumo-gui")
    assert program is not None
    with World(load_network(scenario.network)) as world:
        episode = Episode(world)
        shown = SumoGui(program, world.network.path, 100.0)
        run_episode(
            episode, scenario.plan(0), agent, watch=lambda _s, _d, r: shown.show(view_of(world, r.outcome))
        )
        assert shown._traci.gui.getTrackedVehicle("View #0") == EGO_NAME
        shown.close()
        shown.show(view_of(world))  # a window that is gone shows nothing
