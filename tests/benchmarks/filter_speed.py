"""How long the filter takes: `python -m tests.benchmarks.filter_speed` prints it.

With 12 vehicles and 6 road-edge points, `all` constrained: traffic at random places around the ego on a
straight road and random actions, a mixture of actions passed on, solved and relaxed. And with the gate
in front of it, among 20 vehicles of which most follow paths. Both with the last resort behind it, too.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from rudc.arrays import Array
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.world.scene import Scene
from tests.safety.scenes import CROSSING, Other, make_scene

DECISIONS = 4000


def random_scene(rng: np.random.Generator, vehicles: int) -> Scene:
    """`vehicles` on the paths of the crossing or at random, the nearest 8 m away."""
    others = []
    for _ in range(vehicles):
        row = int(rng.integers(-1, 3))
        if row < 0:
            d, b = rng.uniform(8, 60), rng.uniform(-3.1, 3.1)
            others.append(Other(d * np.cos(b) - 20, d * np.sin(b), rng.uniform(-3, 3), rng.uniform(0, 6)))
            continue
        k = int(rng.integers(60, 340))
        x, y = CROSSING.paths.xy[row, k]
        others.append(Other(x, y, CROSSING.paths.heading[row, k], rng.uniform(0, 8), row=row, s=0.5 * k))
    return make_scene(others, x=-20.0, y=rng.uniform(-2, 2), psi=rng.uniform(-0.1, 0.1), v=rng.uniform(2, 10))


def measure(config: FilterConfig, vehicles: int, seed: int = 0) -> tuple[Array, NDArray[np.str_], float]:
    """(DECISIONS,) ms of each whole call, (DECISIONS,) their statuses, mean number of constraints."""
    rng, filter = np.random.default_rng(seed), SafetyFilter(config)
    scenes = [random_scene(rng, vehicles) for _ in range(DECISIONS)]
    actions = np.column_stack([rng.uniform(-3, 3, DECISIONS), rng.uniform(-0.1, 0.1, DECISIONS)])
    spent, statuses, count = np.empty(DECISIONS), [], 0
    for scene, u in zip(scenes[:200], actions, strict=False):
        filter.filter(scene, u)
    filter.reset()
    for i, (scene, u) in enumerate(zip(scenes, actions, strict=True)):
        began = time.perf_counter()
        answer = filter.filter(scene, u)
        spent[i] = 1e3 * (time.perf_counter() - began)
        statuses.append(answer.status)
        count += len(answer.names)
    return spent, np.array(statuses), count / DECISIONS


def main() -> None:
    """Print the figures."""
    for kind in ("ttcbf", "ecbf"):
        for constrained, vehicles, last_resort in (
            ("all", 12, False),
            ("all", 12, True),
            ("gated", 20, False),
            ("gated", 20, True),
        ):
            config = FilterConfig.preset(kind, constrained=constrained, last_resort=last_resort)
            spent, answers, count = measure(config, vehicles)
            median, late = np.percentile(spent, [50, 99])
            by_status = ", ".join(
                f"{status} {np.median(spent[answers == status]):.3f} ({np.mean(answers == status):.0%})"
                for status in np.unique(answers)
            )
            print(
                f"{kind} {constrained:<5} {'last resort' if last_resort else 'rows':<11} {vehicles} others, "
                f"{count:4.1f} constraints: "
                f"median {median:.3f} ms, p99 {late:.3f} ms; {by_status}"
            )


if __name__ == "__main__":
    main()
