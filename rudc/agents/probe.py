"""Asking the road how well it grips: short full brakings, since friction shows once a command exceeds it.

The ego knows the grip of the road where it has used it. A few metres on it may be another. So what it was
shown counts for FRESH m; after that only FALLEN times that grip is trusted. An ego that is too fast for so
little asks again: before a bend, or, where grip is poor, before its stop line. It asks at the last place from
which it could still slow down. At the start of an episode it asks at once; in the junction it never asks.
Braking and bends that the driver takes anyway show the grip, too; then nothing is asked.
"""

from __future__ import annotations

import math

from rudc.world.scene import Scene

FRESH = 8.0
"""m driven, for which what the road has shown counts"""
FALLEN = 0.5
"""share of the grip known that the road ahead is trusted to have unasked"""
SLOWEST = 4.0
"""m/s, below which braking says little"""
LONGEST_S = 0.5
"""s after which a braking ends, whatever it has shown"""
SHOWN = 0.9
"""share of full braking, or of the grip known, at which the road has shown it"""
SETTLED = 0.5
"""m/s2, change of the acceleration from one decision to the next below which the response to a braking is
there"""
STRAIGHT = 0.3
"""share of the grip that a bend may take where the brakes are asked for all of it"""


class Probe:
    """Of one episode."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._driven, self._shown = 0.0, -math.inf
        """m driven, then and when the road showed its grip last"""
        self._ends: float | None = None
        """s, when the braking under way ends; None without one"""
        self._braking = math.inf
        """m/s2, acceleration a decision ago in a braking"""

    def look(self, scene: Scene, grip: float) -> None:
        """Take in what the road gives, of which `grip` (m/s2) is known; called once a decision."""
        ego = scene.ego
        if self._last is not None:
            self._driven += 0.5 * (ego.v + self._last[1]) * (scene.time_s - self._last[0])
        self._last = scene.time_s, ego.v
        used = math.hypot(min(ego.acceleration, 0.0), _lateral(scene))
        if used > SHOWN * min(grip, -scene.network.vehicle.a_min):
            self._shown = self._driven

    def asks(self, scene: Scene, grip: float, *, limited: bool, allowed: float) -> bool:
        """Whether to brake now.

        `grip` (m/s2) is what is known of the road, `limited` whether that is less than a dry road's, and
        `allowed` (m/s) the speed that FALLEN of it allows.
        """
        if self._ends is None:
            if scene.ego.v < SLOWEST or self._driven < self._shown + FRESH:
                return False
            if _busy(scene, grip) or (math.isfinite(self._shown) and scene.ego.v <= allowed):
                return False
            self._ends, self._braking = scene.time_s + LONGEST_S, math.inf
        change, self._braking = abs(scene.ego.acceleration - self._braking), scene.ego.acceleration
        if self._shown == self._driven or scene.time_s >= self._ends or (limited and change < SETTLED):
            self._ends, self._shown = None, self._driven
            return False
        return True


def _busy(scene: Scene, grip: float) -> bool:
    """Whether this is no place to brake: in the junction, where others have been promised that the ego will
    be gone, or in a bend."""
    front = scene.ego_s + 0.5 * scene.vehicle.length
    inside = scene.route.stop_line_s < front and scene.ego_s < scene.route.exit_s
    return inside or abs(_lateral(scene)) > STRAIGHT * grip


def _lateral(scene: Scene) -> float:
    """m/s2, lateral acceleration of the ego's centre of gravity."""
    ego, body = scene.ego, scene.vehicle
    slip = math.atan(body.cg_to_rear / body.wheelbase * math.tan(ego.steering))
    return ego.v**2 * math.sin(slip) / body.cg_to_rear
