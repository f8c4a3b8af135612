"""What good, reckless, crashed and frozen episodes earn: the figures behind the scales of rudc/env/reward.py.

    python tests/benchmarks/reward_scale.py [--episodes N] [--scenario NAME ...]

Prints a Markdown table: mean reward of the episodes of each driver that ended in each way, and of its terms.
The drivers: `gap-acceptance` is the good one, `follower` ignores traffic, `waiter` stays at the stop line,
`coaster` keeps its speed and does not steer.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from rudc.agents.base import Decision, unfiltered
from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.scene import Scene
from rudc.world.world import World
from tests.env.test_reward import TERMS


class Waiter:
    """Comes to a stop at the line and waits there for good."""

    name, ego_driver = "waiter", "agent"

    def reset(self, scene: Scene, seed: int) -> None: ...

    def act(self, scene: Scene) -> Decision:
        left = scene.route.stop_line_s - scene.ego_s - 0.5 * scene.vehicle.length - 1.0
        wanted = min(math.sqrt(4.0 * max(left, 0.0)), scene.route.speed_limit)
        return unfiltered((wanted - scene.ego.v) / 0.5, 0.0)


class Coaster:
    """Goes straight on at the speed it came with."""

    name, ego_driver = "coaster", "agent"

    def reset(self, scene: Scene, seed: int) -> None: ...

    def act(self, scene: Scene) -> Decision:
        return unfiltered(0.0, 0.0)


def drivers() -> list:
    """The drivers compared."""
    return [make_agent("gap-acceptance"), make_agent("follower"), Waiter(), Coaster()]


def reward_table(scenario_name: str, episodes: int) -> list[dict[str, object]]:
    """Rows of driver, outcome, number of episodes, mean steps, mean reward, and the means of its terms."""
    scenario = load_scenario(scenario_name)
    network = load_network(scenario.network, scenario.junction)
    rows = []
    with World(network) as world:
        episode = Episode(world)
        for driver in drivers():
            ended: dict[str, list[tuple[int, np.ndarray]]] = defaultdict(list)
            for seed in range(episodes):
                scene, sums, steps = episode.reset(scenario.plan(seed)), np.zeros(len(TERMS)), 0
                driver.reset(scene, seed)
                while episode.outcome is None:
                    result = episode.step(driver.act(scene).u)
                    scene, steps = result.scene, steps + 1
                    sums += list(result.terms.values())
                ended[str(episode.outcome)].append((steps, sums))
            for outcome, played in sorted(ended.items()):
                means = np.mean([sums for _, sums in played], axis=0)
                rows.append(
                    {
                        "scenario": scenario_name,
                        "driver": driver.name,
                        "outcome": outcome,
                        "episodes": len(played),
                        "steps": float(np.mean([steps for steps, _ in played])),
                        "reward": float(means.sum()),
                        **dict(zip(TERMS, means.tolist(), strict=True)),
                    }
                )
            everything = [sums for played in ended.values() for _, sums in played]
            mean = float(np.mean(everything, axis=0).sum())
            rows.append({"scenario": scenario_name, "driver": driver.name, "outcome": "all", "reward": mean})
    return rows


def as_markdown(rows: Sequence[dict[str, object]]) -> str:
    """The rows as a Markdown table."""
    columns = ("scenario", "driver", "outcome", "episodes", "steps", "reward", *TERMS)

    def cell(value: object) -> str:
        return f"{value:.1f}" if isinstance(value, float) else str(value)

    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(cell(row.get(column, "")) for column in columns) + " |" for row in rows]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--scenario", nargs="+", default=["random_destination", "dense_left_turn"])
    arguments = parser.parse_args()
    rows = [row for name in arguments.scenario for row in reward_table(name, arguments.episodes)]
    print(as_markdown(rows))


if __name__ == "__main__":
    main()
