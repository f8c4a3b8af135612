"""What sumo-gui is shown: everybody where they are in our SUMO, the ego among them, and nobody else."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from typer.testing import CliRunner

from rudc.agents.registry import make_agent
from rudc.cli.commands import app
from rudc.drawing import sumo_gui
from rudc.drawing.palette import EVENT
from rudc.drawing.sumo_gui import EGO_NAME, SCHEME, VIEW, SumoGui
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
    with pytest.raises(InputError, match=r"unable to open display.*needs a display.*--replay FILE.html"):
        SumoGui(program, load_network("four_way").path, 10.0)


@pytest.fixture
def display(monkeypatch):
    """A display: the one there is, or one of Xvfb's."""
    if "DISPLAY" in os.environ:
        yield
        return
    xvfb = shutil.which("Xvfb")
    if xvfb is None:
        # sumo-gui refuses to start without a display, and Xvfb is a program of the system, which neither
        # pip nor `make test` can install. What the window is shown is tested above without one.
        pytest.skip("no display, and no Xvfb, which pip cannot install")
    command = [xvfb, "-displayfd", "1", "-screen", "0", "1280x960x24"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        monkeypatch.setenv("DISPLAY", f":{server.stdout.readline().strip()}")
        yield
        server.terminate()


def test_the_window_follows_the_ego(display):
    scenario, agent = load_scenario("dense_left_turn", {"episode.timeout": 1}), make_agent("gap-acceptance")
    program = find_program("sumo-gui")
    assert program is not None
    with World(load_network(scenario.network)) as world:
        episode = Episode(world)
        shown = SumoGui(program, world.network.path, 100.0)
        run_episode(
            episode, scenario.plan(0), agent, watch=lambda _s, _d, r: shown.show(view_of(world, r.outcome))
        )
        gui, ego = shown._traci.gui, world.scene().ego
        assert gui.getTrackedVehicle(VIEW) == EGO_NAME
        assert gui.getSchema(VIEW) == SCHEME
        (left, low), (right, high) = gui.getBoundary(VIEW)
        assert (0.5 * (left + right), 0.5 * (low + high)) == pytest.approx((ego.x, ego.y), abs=3.0)
        assert 40.0 < right - left < 120.0
        shown.close()
        shown.show(view_of(world))  # a window that is gone shows nothing


def test_the_window_goes_when_the_episode_ends(display, monkeypatch):
    started, popen = [], subprocess.Popen

    def start(*args, **kwargs):
        started.append(popen(*args, **kwargs))
        return started[-1]

    monkeypatch.setattr(sumo_gui.subprocess, "Popen", start)
    command = ["run", "dense_left_turn", "--agent", "follower", "--set", "episode.timeout=1", "--gui"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert [process.poll() for process in started] == [0]
