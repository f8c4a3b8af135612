"""How often surrounding vehicles (SVs) hit a standing ego, without and with the yielding layer.

    python -m tests.benchmarks.yielding [--tries N] [--density D]

The ego stands at the roadside of the story for a moment and then appears, at rest, at one of six awkward
poses. It appears only when that is fair: no SV is within the distance it needs to stop before the ego (0.5 s
of reaction, then 4 m/s2 along its own lane, plus 2 m), so every hit in the following 20 s could have been
avoided and counts.

Then the opposite: the ego stands where it should, before its stop line or at its waiting point inside the
junction, and no SV that has the right of way or crosses in front may be braked for it.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from rudc.world.config import WorldConfig
from rudc.world.geometry import rectangles_overlap
from rudc.world.network import Network, load_network
from rudc.world.scene import Scene
from rudc.world.world import World
from tests.plans import PlanSource

WATCH_S = 20.0
WAIT_S = 15.0


def awkward_poses(network: Network, origin: str) -> dict[str, tuple[float, float, float]]:
    """Name -> x m, y m, heading rad."""
    straight, left = network.route(origin, "straight"), network.route(origin, "left")

    def at(route, s, aside=0.0, turned=0.0):
        x, y, psi = (float(v) for v in route.path.pose(s))
        return x - aside * np.sin(psi), y + aside * np.cos(psi), psi + turned

    before = straight.stop_line_s - 15.0
    middle = 0.5 * (straight.stop_line_s + straight.exit_s)
    return {
        "across both lanes of its arm": at(straight, before, 1.75, np.pi / 2),
        "between two lanes": at(straight, before, 1.75),
        "in the oncoming lane": at(left, before, 3.5),
        "in the junction, at 45 degrees": at(straight, middle - 3.0, 0.0, np.pi / 4),
        "in the junction, on its left turn": at(left, 0.5 * (left.zone_start_s + left.zone_end_s)),
        "half into the crossing lane": at(straight, straight.zone_start_s - 0.5),
    }


def fair(scene: Scene, pose: tuple[float, float, float]) -> bool:
    """Whether every SV could still stop before a vehicle at that pose."""
    body = scene.vehicle
    paths = scene.network.paths
    for i in np.flatnonzero(scene.path >= 0):
        speed = float(np.hypot(*scene.velocity[i]))
        needed = 0.5 * speed + speed**2 / 8.0 + 2.0
        steps = np.arange(0.0, needed + 0.5, 0.5)
        x, y, psi = paths.pose(np.full(len(steps), scene.path[i]), scene.path_s[i] + steps)
        size = np.broadcast_to(scene.size[i] + [0.0, 0.6], (len(steps), 2))
        if rectangles_overlap(*pose, body.length, body.width, np.column_stack([x, y]), psi, size).any():
            return False
    return True


def stand(world: World, scene: Scene, pose: tuple[float, float, float]) -> str:
    """Let the ego appear and stand there: "hit", "spared", or "never" when there was no fair moment."""
    for _ in range(round(WAIT_S / world.config.decision_s)):
        if fair(scene, pose):
            break
        if world.advance(np.array([-6.0, 0.0])).collision:
            return "never"
        scene = world.scene()
    else:
        return "never"
    world.put_ego(*pose)
    for _ in range(round(WATCH_S / world.config.decision_s)):
        if world.advance(np.zeros(2)).collision:
            return "hit"
    return "spared"


def awkward(network: Network, tries: int, density: float) -> None:
    source = PlanSource(density=density, speed=(0.0, 0.0))
    origins = [arm.name for arm in network.arms]
    names = list(awkward_poses(network, origins[0]))
    table: dict[tuple[str, bool], Counter] = {}
    for layer in (False, True):
        with World(network, WorldConfig(yielding=layer)) as world:
            for name in names:
                count = table[name, layer] = Counter()
                for seed in range(tries):
                    scene = world.reset(source.plan(seed))
                    result = stand(world, scene, awkward_poses(network, scene.route.origin)[name])
                    count[result] += 1
                    if layer and result == "hit":
                        print("   hit", name, seed, world.scene().time_s)
    for name in names:
        cells = []
        for layer in (False, True):
            count = table[name, layer]
            shown = count["hit"] + count["spared"]
            cells.append(f"{100 * count['hit'] / max(shown, 1):5.1f} % of {shown:3d}")
        print(f"{name:36s} without {cells[0]}   with {cells[1]}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, default=100)
    parser.add_argument("--density", type=float, default=20.0)
    arguments = parser.parse_args()
    awkward(load_network("four_way"), arguments.tries, arguments.density)


if __name__ == "__main__":
    main()
