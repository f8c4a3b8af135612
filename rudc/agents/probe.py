"""Probes: short full brakings that show how well the road grips, since friction shows only when a command
exceeds it.

The ego knows the grip of the road only where it has used it; a few metres farther on, the grip may be
different. So what the road has shown counts for FRESH m; beyond that only FALLEN times that grip is trusted.
An ego that would be too fast with so little grip probes again: before a bend or, where grip is poor, before
its stop line, at the last place from which it could still slow down. At the start of an episode it probes at
once; in the junction it never does. Braking and bends that the driver takes anyway show the grip too; then no
probe is made.
"""

from __future__ import annotations

import math

from rudc.world.scene import Scene

FRESH = 8.0
"""m, distance driven for which what the road has shown counts"""
FALLEN = 0.5
"""share of the known grip that the road ahead is trusted to have without a probe"""
SLOWEST = 4.0
"""m/s, no probe is made below this speed, since braking says little there"""
LONGEST_S = 0.5
"""s after which a probe ends, whatever it has shown"""
SHOWN, FULL = 0.9, 0.95
"""shares of the known grip, and of full braking, from the lesser of which on the road has shown its grip"""
SETTLED = 0.5
"""m/s2, the car has responded to the braking once its acceleration changes by less than this from one
decision to the next"""
STRAIGHT = 0.3
"""share of the grip that a bend may use where a probe is made"""


class Probe:
    """Decides when to probe, in one episode."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._driven, self._shown = 0.0, -math.inf
        """m driven so far, and m driven when the road showed its grip last"""
        self._ends: float | None = None
        """s, time at which the present probe ends; None without one"""
        self._braking = math.inf
        """m/s2, acceleration one decision ago in the present probe"""

    def look(self, scene: Scene, grip: float) -> None:
        """Note whether the road shows its grip, of which `grip` (m/s2) is known; call it once a decision."""
        ego = scene.ego
        if self._last is not None:
            self._driven += 0.5 * (ego.v + self._last[1]) * (scene.time_s - self._last[0])
        self._last = scene.time_s, ego.v
        used = math.hypot(min(ego.acceleration, 0.0), _lateral(scene))
        if used > min(SHOWN * grip, FULL * -scene.network.vehicle.a_min):
            self._shown = self._driven

    def asks(self, scene: Scene, grip: float, *, limited: bool, allowed: float) -> bool:
        """Whether to brake fully now.

        `grip`: m/s2, what is known of the road's grip; `limited`: whether a limit of it was seen; `allowed`:
        m/s, the speed that FALLEN times this grip allows.
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
    """Whether this is no place for a probe: in the junction, where others rely on it that the ego leaves,
    or in a bend."""
    front = scene.front_s
    inside = scene.route.stop_line_s < front and scene.ego_s < scene.route.exit_s
    return inside or abs(_lateral(scene)) > STRAIGHT * grip


def _lateral(scene: Scene) -> float:
    """m/s2, lateral acceleration of the ego's centre of gravity."""
    ego, body = scene.ego, scene.vehicle
    slip = math.atan(body.cg_to_rear / body.wheelbase * math.tan(ego.steering))
    return ego.v**2 * math.sin(slip) / body.cg_to_rear
