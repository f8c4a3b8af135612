"""An ego that stands in the junction, in traffic."""

from collections.abc import Iterator

import numpy as np

from rudc.scenario import load_scenario
from rudc.world.scene import Scene
from rudc.world.world import World


def scenes_of_a_standing_ego(
    world: World, turn: str, beyond: float, duration_s: float, seed: int = 1
) -> Iterator[Scene]:
    """The scene after each decision while an ego from the south stands there, its centre `beyond` m behind
    its stop line. Nobody may hit it."""
    changes = {
        "network": world.network.name,
        "traffic.density": 25,
        "ego.route": {"from": "south", "turn": turn},
        "episode.timeout": 90,
    }
    world.reset(load_scenario("random_destination", changes).plan(seed))
    route = world.route
    world.put_ego(*map(float, route.path.pose(route.stop_line_s + beyond)))
    for _ in range(round(duration_s / world.config.decision_s)):
        assert world.advance(np.array([-1.0, 0.0])).collision is None
        yield world.scene()
