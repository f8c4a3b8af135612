"""How fast the bare environment is, as ratios inside one run, and where its time goes.

    python -m tests.benchmarks.world_speed [--episodes N] [--resets N] [--seconds S]

    environment / SUMO     decisions/s of the bare environment (20 SVs, observation, reward, collision test,
                           yielding layer) over those of libsumo when it steps the same traffic at the same
                           sub-steps and nothing is read. Once the very same traffic: all commands of the
                           episode played back, the ego's poses among them; once the same inflow, and SUMO
                           drives the ego as it likes
    environment / HighwayEnv   over HighwayEnv's intersection-v1 and -v2 at 15 Hz / 10 Hz with 20 vehicles
    two workers / one      decisions/s of two processes over one
    reset, memory          median of the resets; what a process grows by over many

Both sides of a ratio take turns, so that a machine with other work to do slows both, and the ratios against
SUMO are also given of the median times, which such work touches less.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

import rudc.env.episode as episode_module
import rudc.world.world as world_module
from rudc.env.intersection import IntersectionEnv
from rudc.env.observation import ObservationKind
from rudc.scenario import load_scenario
from rudc.scenario.model import Scenario
from rudc.world.borders import Borders
from rudc.world.ego import EgoPlant
from rudc.world.reading import Reader
from rudc.world.scene import Scene
from rudc.world.sumo import Sumo
from rudc.world.world import World

SVS = 20
LONGEST = 300
"""decisions an episode is followed at most"""


def busy_scenario() -> Scenario:
    """Random destination with 20 SVs on the road."""
    return load_scenario("random_destination", {"traffic.density": SVS / 0.48})


def drive(scene: Scene) -> np.ndarray:
    """Follow the path, wait at the stop line until second 12, then go."""
    ego, path = scene.ego, scene.route.path
    front = scene.ego_s + 0.5 * scene.vehicle.length
    room = scene.route.stop_line_s - 1.0 - front
    wanted = 7.0 if scene.time_s > 12.0 or room < 0 else min(7.0, np.sqrt(max(4.0 * room, 0.0)))
    x, y, _ = path.pose(scene.ego_s + 3.0 + 0.5 * ego.v)
    bearing = np.arctan2(y - ego.y, x - ego.x) - ego.psi
    bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
    return np.array([np.clip(1.5 * (wanted - ego.v), -4.0, 2.0), np.clip(1.2 * bearing, -0.5, 0.5)])


class Tape:
    """What an episode asked of SUMO, to be played back without us."""

    INFLOW = ("load", "add_route", "add", "personality", "limit_lane")
    CONTROL = ("take_over", "place", "slow_down", "set_mode", "hold_lane", "set_lane_changes", "overlook")

    def __init__(self, sumo: Sumo) -> None:
        self._sumo = sumo
        kept = (*self.INFLOW, *self.CONTROL)
        self._play = {name: getattr(sumo, name) for name in (*kept, "step")}
        self.calls: list[tuple[int, str, tuple, dict]] = []
        self.steps = 0
        for name in kept:
            setattr(sumo, name, self._kept(name))
        sumo.step = self._step  # pyright: ignore[reportAttributeAccessIssue] - recorded on purpose

    def _kept(self, name: str) -> Callable[..., Any]:
        def keep(*args: Any, **kwargs: Any) -> Any:
            if name == "load":  # an episode begins, or an unsafe start is drawn again
                self.calls.clear()
                self.steps = 0
            self.calls.append((self.steps, name, args, kwargs))
            return self._play[name](*args, **kwargs)

        return keep

    def _step(self) -> None:
        self.steps += 1
        self._play["step"]()

    def replay(self, decisions: int, substeps: int, kept: tuple[str, ...]) -> list[float]:
        """Seconds that SUMO takes for each of the last decisions, with the kept kinds of calls."""
        due: dict[int, list] = defaultdict(list)
        for at, name, args, kwargs in self.calls:
            if name in kept:
                due[at].append((self._play[name], args, kwargs))
        step, taken, first = self._play["step"], [], self.steps - decisions * substeps
        for i in range(self.steps):
            start = time.perf_counter()
            for call, args, kwargs in due.get(i, ()):
                call(*args, **kwargs)
            step()
            if i >= first and (i - first) % substeps == 0:
                taken.append(0.0)
            if taken:
                taken[-1] += time.perf_counter() - start
        return taken


def play(env: IntersectionEnv, seed: int) -> tuple[list[float], list[int]]:
    """Seconds that each decision took in `step`, and how many SVs there were at each."""
    _, info = env.reset(seed=seed)
    taken, counts = [], []
    for _ in range(LONGEST):
        u = drive(info["scene"])
        start = time.perf_counter()
        _, _, terminated, truncated, info = env.step_physical(u)
        taken.append(time.perf_counter() - start)
        counts.append(info["scene"].count)
        if terminated or truncated:
            break
    return taken, counts


def against_sumo(kind: ObservationKind, episodes: int) -> float:
    """Prints the ratios and returns the environment's decisions/s."""
    env = IntersectionEnv(busy_scenario(), observation=kind)
    env.reset(seed=0)
    world = env.episode.world
    assert isinstance(world, World)
    tape, substeps = Tape(world._sumo), world.config.substeps
    ours: list[float] = []
    same: list[float] = []
    free: list[float] = []
    counts: list[int] = []
    for seed in range(episodes + 1):
        taken, seen = play(env, seed)
        end = world._reader.read().position
        same_traffic = tape.replay(len(taken), substeps, (*Tape.INFLOW, *Tape.CONTROL))
        assert np.array_equal(world._reader.read().position, end), "the same traffic, to the last digit"
        sumo_driven = tape.replay(len(taken), substeps, Tape.INFLOW)
        if seed:  # the first warms caches up
            ours, counts, same, free = ours + taken, counts + seen, same + same_traffic, free + sumo_driven
    env.close()
    print(
        f"environment, observation {kind!r}: {1 / np.mean(ours):.0f} decisions/s, {np.mean(counts):.1f} SVs"
    )
    for bare, what in ((same, "the very same traffic"), (free, "the same inflow, SUMO drives the ego too")):
        print(
            f"    SUMO alone, {what}: {1 / np.mean(bare):.0f} decisions/s, ours are "
            f"{100 * np.mean(bare) / np.mean(ours):.0f} % of it; by medians "
            f"{100 * np.median(bare) / np.median(ours):.0f} % "
            f"({1e3 * np.median(bare):.3f} / {1e3 * np.median(ours):.3f} ms)",
            flush=True,
        )
    return float(1 / np.mean(ours))


# ---- where the time goes


class Clock:
    """Exclusive time of the functions it wraps."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)
        self._inner: list[float] = [0.0]

    def wrap(self, owner: Any, name: str, label: str) -> None:
        inside = getattr(owner, name)

        @wraps(inside)
        def timed(*args: Any, **kwargs: Any) -> Any:
            self._inner.append(0.0)
            start = time.perf_counter()
            try:
                return inside(*args, **kwargs)
            finally:
                taken = time.perf_counter() - start
                self.spent[label] += taken - self._inner.pop()
                self.calls[label] += 1
                self._inner[-1] += taken

        setattr(owner, name, timed)


def where_time_goes(kind: ObservationKind, episodes: int) -> None:
    """Run in a process of its own: it wraps functions for good."""
    clock = Clock()
    for owner, name, label in (
        (Sumo, "step", "SUMO: simulationStep"),
        (Sumo, "place", "SUMO: moveToXY of the ego"),
        (World, "_brake", "yielding layer"),
        (World, "_nearest_now", "contact test"),
        (world_module, "survey", "contact test"),
        (Borders, "left", "off-road and wrong-way test"),
        (World, "_look", "scene"),
        (EgoPlant, "step", "ego's plant"),
        (Reader, "read", "reading the SVs"),
        (Reader, "scene", "scene"),
        (Reader, "new_overlaps", "overlaps among SVs"),
        (IntersectionEnv, "_observe", f"observation {kind!r}"),
        (episode_module, "reward_terms", "reward"),
        (episode_module, "step_cost", "reward"),
        (episode_module, "measure", "distances for reward and observation"),
        (World, "advance", "world, the rest"),
        (IntersectionEnv, "step_physical", "environment, the rest"),
    ):
        clock.wrap(owner, name, label)
    env = IntersectionEnv(busy_scenario(), observation=kind)
    clock.wrap(type(env), "reset", "reset")
    decisions = 0
    for k in range(2 * episodes):
        if k == episodes:  # the first round warms caches up, and makes the raster of the road
            clock.spent.clear()
            decisions = 0
        before = dict(clock.spent)
        _, info = env.reset(seed=k % episodes)
        clock.spent.update({label: before.get(label, 0.0) for label in clock.spent})
        for _ in range(LONGEST):
            _, _, terminated, truncated, info = env.step_physical(drive(info["scene"]))
            decisions += 1
            if terminated or truncated:
                break
    env.close()
    clock.spent.pop("reset", None)
    total = sum(clock.spent.values())
    print(f"where the time of a decision goes ({1e3 * total / decisions:.3f} ms, with clocks):")
    for label, taken in sorted(clock.spent.items(), key=lambda item: -item[1]):
        print(f"    {label:40s} {1e6 * taken / decisions:6.1f} us  {100 * taken / total:4.1f} %")


# ---- resets, memory, workers, HighwayEnv


def resident_mb() -> float:
    """MB this process holds in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def resets(number: int) -> None:
    """Median reset and growth over many; in a process of its own."""
    env = IntersectionEnv(busy_scenario())
    times, memory = [], []
    for seed in range(number):
        start = time.perf_counter()
        _, info = env.reset(seed=seed)
        times.append(time.perf_counter() - start)
        for _ in range(3):
            _, _, terminated, truncated, info = env.step_physical(drive(info["scene"]))
            if terminated or truncated:
                break
        if seed in (number // 4, number // 2, number - 1):
            memory.append(resident_mb())
    env.close()
    print(
        f"reset: median {1e3 * np.median(times):.1f} ms, "
        f"p99 {1e3 * np.quantile(times, 0.99):.1f} ms of {number}"
    )
    print(
        f"memory: {', '.join(f'{mb:.0f}' for mb in memory)} MB after a quarter, a half and all of the resets"
    )


def work(seconds: float, ready: Any, decided: Any) -> None:
    """One worker: plays for some seconds once all are ready and adds up its decisions."""
    env = IntersectionEnv(busy_scenario())
    for seed in range(12):
        env.reset(seed=seed)
    ready.wait()
    number, seed, end = 0, 0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        _, info = env.reset(seed=seed)
        seed += 1
        for _ in range(LONGEST):
            _, _, terminated, truncated, info = env.step_physical(drive(info["scene"]))
            number += 1
            if terminated or truncated or time.perf_counter() > end:
                break
    env.close()
    with decided.get_lock():
        decided.value += number


def workers(number: int, seconds: float) -> float:
    """Decisions/s of some processes together, resets included."""
    context = multiprocessing.get_context("spawn")
    ready, decided = context.Barrier(number), context.Value("i", 0)
    processes = [context.Process(target=work, args=(seconds, ready, decided)) for _ in range(number)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    return decided.value / seconds


def two_workers(seconds: float) -> None:
    one, two = [], []
    for _ in range(2):
        one.append(workers(1, seconds))
        two.append(workers(2, seconds))
    print(
        f"workers: one {np.mean(one):.0f} decisions/s, two {np.mean(two):.0f}: "
        f"x{np.mean(two) / np.mean(one):.2f}"
    )


def highway(name: str, decisions: int) -> float | None:
    """Decisions/s of HighwayEnv's environment of that name; None where it is not installed."""
    try:
        import gymnasium
        import highway_env
    except ImportError:
        return None
    gymnasium.register_envs(highway_env)
    config = {
        "simulation_frequency": 15,
        "policy_frequency": 10,
        "initial_vehicle_count": SVS,
        "duration": 40,
    }
    env = gymnasium.make(name, config=config)
    inside: Any = env.unwrapped
    still = np.zeros_like(env.action_space.sample())
    taken, done, counts, seed = 0.0, 0, [], 0
    while done < decisions:
        env.reset(seed=seed)
        seed += 1
        for _ in range(100):
            start = time.perf_counter()
            _, _, terminated, truncated, _ = env.step(still)
            taken += time.perf_counter() - start
            counts.append(len(inside.road.vehicles))
            done += 1
            if terminated or truncated:
                break
    env.close()
    print(f"HighwayEnv {name}, 15/10 Hz: {done / taken:.1f} decisions/s, {np.mean(counts):.1f} vehicles")
    return done / taken


def alone(function: Callable[..., None], *args: Any) -> None:
    """In a process of its own."""
    process = multiprocessing.get_context("spawn").Process(target=function, args=args)
    process.start()
    process.join()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=30)
    parser.add_argument("--resets", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=8.0)
    asked = parser.parse_args()
    speeds = {kind: against_sumo(kind, asked.episodes) for kind in ("paper", "conflict")}
    for name in ("intersection-v1", "intersection-v2"):
        if slow := highway(name, 300):
            print(
                f"environment / {name}: x{speeds['paper'] / slow:.1f} "
                f"('conflict': x{speeds['conflict'] / slow:.1f})"
            )
    alone(where_time_goes, "paper", asked.episodes)
    alone(resets, asked.resets)
    two_workers(asked.seconds)


if __name__ == "__main__":
    main()
