"""How often surrounding vehicles (SVs) hit a standing ego, without and with the yielding layer.

    python -m tests.benchmarks.yielding [--tries N] [--density D] [--network NAME] [--list]

The ego stands on its arm for a moment and then appears, at rest, in an awkward pose: one of seven or anywhere
within 35 m of the junction's centre at any heading. It appears only when that is fair: no SV is nearer to it,
along its own lane, than it needs to stop (0.5 s of reaction, then 4 m/s2, plus 2 m). So every hit in the 20 s
that follow could have been avoided, and counts. A try without a fair moment within 15 s is left out.

Then the opposite: the ego stands for 20 s where it should, before its stop line or at its waiting point
inside the junction. The layer may brake those who queue behind it and those who owe it the right of way,
nobody else.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from rudc.geometry import rectangle_gaps
from rudc.network.network import Network, load_network
from rudc.world.config import WorldConfig
from rudc.world.scene import Scene
from rudc.world.world import World
from rudc.world.yielding import must_yield
from tests.plans import PlanSource

WATCH_S = 20.0
WAIT_S = 15.0


def awkward_poses(network: Network, origin: str) -> dict[str, tuple[float, float, float]]:
    """Name -> x m, y m, heading rad. Where an arm does not lead straight on or left, its first turn does."""
    turns = [movement.turn for movement in network.movements if movement.origin == origin]
    straight, left = (
        network.route(origin, turn if turn in turns else turns[0]) for turn in ("straight", "left")
    )

    def at(route, s, aside=0.0, turned=0.0):
        x, y, psi = (float(v) for v in route.path.pose(s))
        return x - aside * np.sin(psi), y + aside * np.cos(psi), psi + turned

    before = straight.stop_line_s - 15.0
    middle = 0.5 * (straight.stop_line_s + straight.exit_s)
    return {
        "across both lanes of its arm": at(straight, before, 1.75, np.pi / 2),
        "between two lanes": at(straight, before, 1.75),
        "its front in the lane beside, its rear in its own": at(left, before, -0.98, -0.34),
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
        if not rectangle_gaps(*pose, body.length, body.width, np.column_stack([x, y]), psi, size).all():
            return False
    return True


def fair_moment(world: World, pose: tuple[float, float, float]) -> bool:
    """Let traffic go on until the ego may appear at a pose; False when it never may."""
    while not fair(world.scene(), pose):
        hit = world.advance(np.array([-6.0, 0.0])).collision
        if hit or world.scene().time_s > WAIT_S:
            return False
    return True


def stand(world: World, pose: tuple[float, float, float]) -> str:
    """Let the ego appear and stand there: "hit", "spared", or "never" when there was no fair moment."""
    if not fair_moment(world, pose):
        return "never"
    world.put_ego(*pose)
    for _ in range(round(WATCH_S / world.config.decision_s)):
        if world.advance(np.zeros(2)).collision:
            return "hit"
    return "spared"


def anywhere(network: Network, seed: int) -> tuple[float, float, float]:
    """A pose on the road near the junction."""
    rng = np.random.default_rng([7, seed])
    while True:
        x, y = network.center + rng.uniform(-35.0, 35.0, 2)
        if network.surface.depth(x, y) > 1.0:
            return float(x), float(y), float(rng.uniform(-np.pi, np.pi))


ANYWHERE = "anywhere, at any heading"


def awkward(network: Network, tries: int, density: float, details: bool) -> tuple[float, float]:
    """Prints a row for each pose; returns the share of hits in percent, without and with the layer."""
    source = PlanSource(network=network.name, density=density, speed=(0.0, 0.0))
    names = [*awkward_poses(network, network.movements[0].origin), ANYWHERE]
    table: dict[tuple[str, bool], Counter] = {}
    for layer in (False, True):
        with World(network, WorldConfig(yielding=layer)) as world:
            for name in names:
                count = table[name, layer] = Counter()
                for seed in range(tries):
                    scene = world.reset(source.plan(seed))
                    poses = awkward_poses(network, scene.route.origin)
                    pose = anywhere(network, seed) if name == ANYWHERE else poses[name]
                    result = stand(world, pose)
                    count[result] += 1
                    if details and layer and result == "hit":
                        print(f"    {name}, seed {seed}, {world.scene().time_s:.1f} s: {np.round(pose, 1)}")
    total = {layer: sum((table[name, layer] for name in names), Counter()) for layer in (False, True)}
    for name in names:
        print(f"{name:34s} without {share(table[name, False])}   with {share(table[name, True])}")
    print(f"{'all':34s} without {share(total[False])}   with {share(total[True])}", flush=True)
    return hits(total[False]), hits(total[True])


def hits(count: Counter) -> float:
    return 100 * count["hit"] / max(count["hit"] + count["spared"], 1)


def share(count: Counter) -> str:
    return f"{hits(count):5.1f} % of {count['hit'] + count['spared']:4d}"


def waiting(world: World, tries: int, density: float) -> int:
    """How many SVs that do not queue behind the ego the layer brakes while it waits where it should."""
    network = world.network
    source = PlanSource(network=network.name, density=density, speed=(0.0, 0.0))
    wrongly: Counter = Counter()
    passed = 0
    for inside in (False, True):
        for seed in range(tries):
            route = world.reset(source.plan(seed)).route
            if inside and route.waiting_s < route.stop_line_s + 1.0:
                continue
            front = route.waiting_s if inside else route.stop_line_s - 1.0
            x, y, psi = (float(v) for v in route.path.pose(front - 0.5 * world.vehicle.length))
            if not fair_moment(world, (x, y, psi)):
                continue
            scene = world.put_ego(x, y, psi)
            for step in range(round(WATCH_S / world.config.decision_s)):
                if step % 2 == 0:
                    for row in set(must_yield(scene).rows) - set(must_yield(scene, ego_present=False).rows):
                        if not queues_behind(scene, row) and not must_wait(scene, row):
                            wrongly[inside, seed, scene.ids[row]] += 1
                world.advance(np.zeros(2))
                scene = world.scene()
            passed += 1
    print(
        f"waiting where it should ({passed} tries, {network.name}, {density:g} veh/km): "
        f"{len(wrongly)} SVs braked that neither queue behind it nor owe it the right of way"
    )
    for (inside, seed, name), number in wrongly.items():
        print(f"    {'inside' if inside else 'before the stop line'}, seed {seed}, {name}, {number} times")
    return len(wrongly)


def queues_behind(scene: Scene, row: int) -> bool:
    x, y = scene.position[row]
    s, offset = scene.route.path.project(float(x), float(y))
    return s < scene.ego_s and abs(offset) < 2.0


def must_wait(scene: Scene, row: int) -> bool:
    """Whether the right of way has that SV wait for the ego in any case."""
    return bool(scene.network.paths.yields[scene.path[row], scene.route.row])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, default=100, help="of each pose")
    parser.add_argument("--density", type=float, default=20.0)
    parser.add_argument("--network", default="four_way")
    parser.add_argument("--list", action="store_true", help="every hit with the layer")
    asked = parser.parse_args()
    network = load_network(asked.network)
    awkward(network, asked.tries, asked.density, asked.list)
    with World(network) as world:
        waiting(world, asked.tries, asked.density)


if __name__ == "__main__":
    main()
