"""A world in a process of its own: the same episodes, its errors, its end."""

import contextlib
import gc
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import NetworkError, SimulationError, WorldBusyError
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.config import WorldConfig
from rudc.world.isolated import IsolatedWorld, open_world
from rudc.world.world import World

COAST = np.array([0.0, 0.0])


def drive(world, scenario, seed, decisions=60):
    """All scenes of a coasting ego, true and perceived, and what the world said of each decision."""
    world.reset(load_scenario(scenario).plan(seed))
    seen = [(world.scene(), world.perceived(), None)]
    for _ in range(decisions):
        advance = world.advance(COAST)
        seen.append((world.scene(), world.perceived(), advance))
        if advance.collision is not None:
            break
    return seen


@pytest.fixture(scope="module")
def apart():
    """One for all scenarios on its network."""
    world = IsolatedWorld(load_network("four_way"))
    yield world
    world.close()


@pytest.mark.parametrize("scenario", ["dense_left_turn", "perfect_storm", "jaywalkers"])
def test_the_same_episodes_as_in_this_process(apart, scenario):
    network = load_network(load_scenario(scenario).network)
    with World(network) as here:
        for seed in (3, 4):
            mine, theirs = drive(here, scenario, seed), drive(apart, scenario, seed)
            assert len(mine) == len(theirs)
            assert all(a == b for a, b in zip(mine, theirs, strict=True))
        np.testing.assert_array_equal(here.sensors().occluders, apart.sensors().occluders)
        assert [h.begun_s for h in here.happenings()] == [h.begun_s for h in apart.happenings()]
        assert apart.plan == here.plan
        assert here.put_ego(10.0, 2.0, 0.5, 3.0) == apart.put_ego(10.0, 2.0, 0.5, 3.0)
        assert apart.scene().network is network


def test_the_second_world_moves_out_by_itself():
    network, config = load_network("four_way"), WorldConfig()
    first = open_world(network, config)
    second = open_world(network, config)
    assert isinstance(first, World)
    assert isinstance(second, IsolatedWorld)
    with pytest.raises(WorldBusyError):
        open_world(network, config, isolated=False)
    first.close()
    with World(network):  # not busy
        process = second._process
        del second
        gc.collect()
    assert process.returncode is not None, "ended, and waited for"
    assert process.stdin is not None
    assert process.stdin.closed


def test_a_dropped_world_is_released():
    network = load_network("four_way")
    world = World(network)
    world.reset(load_scenario("dense_left_turn").plan(0))
    del world
    gc.collect()
    with World(network) as world:  # not busy
        world.reset(load_scenario("dense_left_turn").plan(0))
    with pytest.raises(SimulationError, match="closed"):
        world.reset(load_scenario("random_destination").plan(0))


def test_closing_an_old_world_leaves_the_new_one_alone():
    network = load_network("four_way")
    old = World(network)
    old.close()
    with World(network) as new:
        new.reset(load_scenario("dense_left_turn").plan(0))
        old.close()
        del old
        gc.collect()
        with pytest.raises(WorldBusyError):
            World(network)
        new.advance(COAST)


def test_its_errors_are_ours_and_a_reset_starts_another_after_an_interrupt():
    world = IsolatedWorld(load_network("four_way"))
    with pytest.raises(SimulationError, match="no episode"):
        world.scene()
    far = load_scenario("random_destination", {"ego.distance": 900}).plan(0)
    with pytest.raises(SimulationError, match=r"ego\.distance 900\.0 m does not fit"):
        world.reset(far)
    plan = load_scenario("random_destination").plan(0)
    scene = world.reset(plan)
    with pytest.raises(SimulationError, match=r"own process: TypeError: .*\.py:\d+") as caught:
        world.advance(np.array(["a", "b"]))
    assert "Traceback" in caught.value.__notes__[0]
    with pytest.raises(SimulationError, match="does not fit"):
        world.reset(far)
    for ask in (world.scene, world.perceived, lambda: world.plan):  # not of the episode before
        with pytest.raises(SimulationError, match="no episode"):
            ask()
    assert world.reset(plan) == scene
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    os.kill(world._process.pid, signal.SIGSTOP)  # it will not answer
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    with pytest.raises(KeyboardInterrupt):
        world.advance(COAST)
    assert world._process.returncode is not None
    with pytest.raises(SimulationError, match="has ended; reset"):
        world.advance(COAST)
    assert world.reset(plan) == scene
    world.advance(COAST)
    os.kill(world._process.pid, signal.SIGKILL)
    with pytest.raises(SimulationError, match="has died"):
        world.advance(COAST)
    with pytest.raises(SimulationError, match="has ended; reset"):
        world.advance(COAST)
    world.close()
    with pytest.raises(SimulationError, match="closed"):
        world.advance(COAST)
    with pytest.raises(SimulationError, match="closed"):
        world.reset(plan)


def test_a_process_whose_world_cannot_be_opened_is_ended(monkeypatch):
    def refusing(world, method, *arguments):
        raise NetworkError("it is not there")

    monkeypatch.setattr(IsolatedWorld, "_ask", refusing)
    world = IsolatedWorld.__new__(IsolatedWorld)
    world.network, world.config, world._closed = load_network("four_way"), WorldConfig(), False
    with pytest.raises(NetworkError, match="not there"):
        world._start()
    assert not world._end.alive  # so that a reset starts another


PARENT = """
import os, subprocess, time
from rudc.network.network import load_network
from rudc.world.isolated import IsolatedWorld
popen = subprocess.Popen

def impatient(command, **given):  # the world's process looks for its parent every 0.1 s, not every 2 s
    now = "; import rudc.world.isolated as own; own.ORPHAN_S = 0.1; serve("
    return popen([*command[:2], command[2].replace("; serve(", now)], **given)

subprocess.Popen = impatient
world = IsolatedWorld(load_network("four_way"))
if os.fork() == 0:
    time.sleep(60)  # holds the pipe's other end, too
print(world._process.pid, flush=True)
time.sleep(60)
"""


def test_it_dies_with_its_parent():
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 60.0
    while _runs(child) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not _runs(child)
    parent.stdout.close()
    with contextlib.suppress(ProcessLookupError):
        os.killpg(parent.pid, signal.SIGKILL)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False
