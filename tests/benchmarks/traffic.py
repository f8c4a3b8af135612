"""Whether traffic is believable: overlaps between surrounding vehicles (SVs), gridlock, density, and SUMO's
own driver.

    python -m tests.benchmarks.traffic [--network NAME] [--densities 10,20,30,40,50] [--episodes N] [--mixed]

Each episode lasts 40 s with SUMO's own driver in the ego's seat. Measured in each:

    overlaps    pairs of SVs whose rectangles overlap at some decision, by our own test
    gridlock    nobody on the road drives faster than 0.5 m/s for 10 s on end
    jam         on average over the episode, more than half of the SVs stand
    density     mean over the episode against what was asked
    ego         arrives in time, collides, or is still on its way after 40 s; by arm (major or minor) and turn
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from rudc.network.network import Network, load_network
from rudc.world.kernels import overlapping
from rudc.world.scene import Scene
from rudc.world.world import World
from tests.plans import ALL_KINDS, PlanSource

GRIDLOCK_S = 10.0
STANDS = 0.5
"""m/s"""
TOLERANCE = 0.15


@dataclass
class Tally:
    """What came of the episodes at one density."""

    overlaps: list[str] = field(default_factory=list)
    gridlocks: list[int] = field(default_factory=list)
    jams: int = 0
    ratios: list[float] = field(default_factory=list)
    """measured over asked density, each episode"""
    standing: list[float] = field(default_factory=list)
    """share of SVs that stand, each episode"""
    left: int = 0
    """SVs that drove off the road"""
    redraws: int = 0
    outcomes: dict[tuple[str, str], Counter] = field(default_factory=dict)
    collisions: list[str] = field(default_factory=list)


def overlaps_of(scene: Scene) -> set[tuple[str, str]]:
    svs = np.flatnonzero(scene.path >= 0)
    pairs = overlapping(scene.position[svs], scene.heading[svs], scene.size[svs])
    names = [sorted((scene.ids[svs[i]], scene.ids[svs[j]])) for i, j in pairs]
    return {(first, second) for first, second in names}


def watch(world: World, source: PlanSource, seed: int, tally: Tally) -> None:
    scene = world.reset(source.plan(seed), ego_driver="sumo")
    outcome, met, still = None, set(), 0.0
    densities, standing, present = [], [], set(scene.ids)
    still_longest = 0.0
    tally.redraws += world.plan.attempt
    arm = "major" if world.network.arm(scene.route.origin).major else "minor"
    while scene.time_s < source.timeout_s - 1e-6:
        advance = world.advance(np.zeros(2))
        scene = world.scene()
        densities.append(advance.density)
        slow = np.hypot(scene.velocity[:, 0], scene.velocity[:, 1]) < STANDS
        standing.append(slow.mean() if len(slow) else 0.0)
        still = still + world.config.decision_s if len(slow) and slow.all() else 0.0
        still_longest = max(still, still_longest)
        for pair in overlaps_of(scene) - met:
            met.add(pair)
            tally.overlaps.append(f"seed {seed} at {scene.time_s:.1f} s: {describe(scene, pair)}")
        present |= set(scene.ids)
        if outcome is None and advance.collision is not None:
            outcome = "collision"
            tally.collisions.append(
                f"seed {seed} at {scene.time_s:.1f} s: {arm} {scene.route.turn}, {advance.collision}"
            )
        elif outcome is None and scene.ego_s >= scene.destination_s:
            outcome = "success"
    tally.left += len(present - set(scene.ids))
    tally.ratios.append(float(np.mean(densities)) / source.density)
    tally.standing.append(float(np.mean(standing)))
    tally.jams += tally.standing[-1] > 0.5
    if still_longest >= GRIDLOCK_S:
        tally.gridlocks.append(seed)
    tally.outcomes.setdefault((arm, scene.route.turn), Counter())[outcome or "frozen"] += 1


def describe(scene: Scene, pair: tuple[str, str]) -> str:
    said = []
    for name in pair:
        i = scene.ids.index(name)
        (x, y), speed = scene.position[i], float(np.hypot(*scene.velocity[i]))
        where = f"path {scene.path[i]}, s {scene.path_s[i]:.1f}, {x:.1f} {y:.1f}"
        said.append(f"{name} ({where}, {speed:.1f} m/s, {scene.size[i, 0]:.1f} m long)")
    return " / ".join(said)


def report(density: float, tally: Tally, details: bool) -> None:
    ratios = np.array(tally.ratios)
    held = np.mean(np.abs(ratios - 1) <= TOLERANCE)
    episodes = len(ratios)
    print(
        f"{density:4.0f} veh/km, {episodes} episodes: overlaps {len(tally.overlaps)}, "
        f"gridlock {len(tally.gridlocks)}, jams {tally.jams}; "
        f"density x{ratios.mean():.3f} ({ratios.min():.2f} to {ratios.max():.2f}), "
        f"held in {100 * held:.0f} %; standing {100 * np.mean(tally.standing):.0f} %, "
        f"outflow {60 * tally.left / (episodes * 40):.1f} /min; redraws {tally.redraws}"
    )
    total: Counter = Counter()
    for key in sorted(tally.outcomes):
        total += tally.outcomes[key]
        print(f"      {' '.join(key):16s} {shares(tally.outcomes[key])}")
    print(f"      {'all':16s} {shares(total)}", flush=True)
    if details:
        for line in (*tally.overlaps, *tally.collisions):
            print("        ", line)


def shares(count: Counter) -> str:
    total = sum(count.values())
    parts = [f"{name} {100 * count[name] / total:5.1f} %" for name in ("success", "collision", "frozen")]
    return f"{', '.join(parts)}  (of {total})"


def study(
    network: Network, densities: list[float], episodes: int, mixed: bool, details: bool, first: int = 0
) -> dict[float, Tally]:
    tallies = {}
    with World(network) as world:
        for density in densities:
            mix = ALL_KINDS if mixed else {"car": 1.0}
            source = PlanSource(network=network.name, density=density, mix=mix)
            tally = tallies[density] = Tally()
            for seed in range(first, first + episodes):
                watch(world, source, seed, tally)
            report(density, tally, details)
    return tallies


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--network", default="four_way")
    parser.add_argument("--densities", default="10,20,30,40,50")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--mixed", action="store_true", help="trucks, buses, motorcycles, bicycles")
    parser.add_argument("--details", action="store_true", help="every overlap and collision")
    asked = parser.parse_args()
    network = load_network(asked.network)
    densities = [float(text) for text in asked.densities.split(",")]
    study(network, densities, asked.episodes, asked.mixed, asked.details, asked.first)


if __name__ == "__main__":
    main()
