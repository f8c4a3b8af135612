"""A driver of one's own: two methods, in a file of its own.

    rudc sweep dense_left_turn --agent "examples/own_agent.py:Patient(gap_s=3)" --agent rudc-t \\
        --episodes 4 --out out/own

It follows the path and stops at the stop line until nobody will be in the junction for `gap_s` seconds.
`+ttcbf` puts a safety filter behind it, as behind any other: `examples/own_agent.py:Patient+ttcbf`.
"""

import numpy as np

from rudc.env.tracking import steering


class Patient:
    """Stops at the stop line until nobody will be near the junction for a while."""

    def __init__(self, speed: float = 7.0, gap_s: float = 2.5) -> None:
        self.speed = speed
        self.gap_s = gap_s

    def reset(self, scene, seed):
        """Called once an episode: forget the last one. All randomness comes from `seed`."""
        self.gone = False

    def act(self, scene):
        """Called ten times a second: acceleration m/s2 and front-wheel angle rad. See rudc/world/scene.py."""
        front = scene.ego_s + 0.5 * scene.vehicle.length
        room = scene.route.stop_line_s - front
        self.gone = self.gone or scene.route.major or room < 0.0 or (room < 8.0 and self.is_free(scene))
        wanted = self.speed if self.gone else min(self.speed, np.sqrt(2.0 * 2.0 * max(room - 1.0, 0.0)))
        return np.clip(2.0 * (wanted - scene.ego.v), -4.0, 2.0), steering(scene)

    def is_free(self, scene) -> bool:
        """Whether nobody who drives on as now comes within 10 m of the junction's centre in `gap_s` s."""
        times = np.linspace(0.0, self.gap_s, 6)[:, None, None]
        ahead = scene.position + times * scene.velocity
        return not (np.hypot(*np.moveaxis(ahead - scene.network.center, -1, 0)) < 10.0).any()
