"""The ego vehicle's plant: a kinematic bicycle about the centre of gravity, with slip angle.

    beta = atan(l_r / L * tan(delta))       slip angle, l_r = centre of gravity to rear axle, L = wheelbase
    x'   = v cos(psi + beta)
    y'   = v sin(psi + beta)
    psi' = v sin(beta) / l_r
    v'   = a,  0 <= v <= v_max

The safety filter's model (paper, Sec. "Safety Correction Formulation") is simpler on purpose: no slip, yaw
rate v tan(delta) / L. The difference is what the residual predictor learns.

Actuators: a command may arrive late (dead time) and is followed with a first-order lag,
    a(t) = a_cmd + (a_0 - a_cmd) exp(-t / T),     the same for delta.
Friction: lateral acceleration v^2 sin(beta) / l_r stays below mu g (the wheels turn in, the car does not),
and longitudinal acceleration within what the friction circle leaves.

v is integrated in closed form; x, y and psi by a fourth-order Runge-Kutta step, cut where the vehicle comes
to a stop.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from rudc.world.scene import EgoState, EgoVehicle

GRAVITY = 9.81
"""m/s2"""


@dataclass(frozen=True, slots=True)
class Actuation:
    """What stands between a command and the wheels."""

    delay_s: float = 0.0
    """s, dead time of both commands"""
    lag_s: float = 0.0
    """s, first-order time constant of both"""
    friction: float | None = None
    """coefficient mu, None for no limit"""


class EgoPlant:
    """Integrates the ego's motion from one simulation step to the next."""

    def __init__(self, vehicle: EgoVehicle) -> None:
        self.vehicle = vehicle
        self.actuation = Actuation()
        self._pending: deque[tuple[float, float]] = deque()
        self.state = EgoState(0, 0, 0, 0, 0, 0, 0, 0)

    def reset(self, x: float, y: float, psi: float, v: float, actuation: Actuation | None = None) -> None:
        """Put the vehicle at a pose (m, m, rad) with a speed (m/s), wheels straight."""
        self.actuation = actuation or Actuation()
        self._pending.clear()
        self.state = EgoState(x, y, psi, min(max(v, 0.0), self.vehicle.v_max), 0.0, 0.0, 0.0, 0.0)

    def step(self, a: float, delta: float, dt: float) -> EgoState:
        """Advance by dt (s) under the commands a (m/s2) and delta (rad), each clipped to the vehicle's
        limits."""
        body = self.vehicle
        a = min(max(a, body.a_min), body.a_max)
        delta = min(max(delta, -body.delta_max), body.delta_max)
        a, delta = self._delayed(a, delta, dt)
        if self.actuation.friction is not None:
            a, delta = self._within_friction(a, delta, self.actuation.friction)
        old = self.state
        lag = self.actuation.lag_s
        a0, delta0 = (old.acceleration, old.steering) if lag > 0 else (a, delta)
        moving = _time_in_motion(old.v, a, a0, lag, dt)
        x, y, psi = self._integrate(a, delta, a0, delta0, moving)
        delta_end = _lagged(delta, delta0, lag, dt)
        v = 0.0 if moving < dt else min(_speed(old.v, a, a0, lag, dt), body.v_max)
        slip = math.atan(body.cg_to_rear / body.wheelbase * math.tan(delta_end))
        yaw_rate = v * math.sin(slip) / body.cg_to_rear
        realised = _lagged(a, a0, lag, dt) if lag > 0 else (v - old.v) / dt
        self.state = EgoState(x, y, psi, v, slip, yaw_rate, realised, delta_end)
        return self.state

    def _delayed(self, a: float, delta: float, dt: float) -> tuple[float, float]:
        steps = round(self.actuation.delay_s / dt)
        if steps == 0:
            return a, delta
        while len(self._pending) < steps:
            self._pending.append((0.0, 0.0))
        self._pending.append((a, delta))
        return self._pending.popleft()

    def _within_friction(self, a: float, delta: float, mu: float) -> tuple[float, float]:
        body, v = self.vehicle, self.state.v
        limit = mu * GRAVITY
        if v > 0.1:
            sin_slip = min(limit * body.cg_to_rear / v**2, 0.999)
            widest = math.atan(body.wheelbase / body.cg_to_rear * math.tan(math.asin(sin_slip)))
            delta = min(max(delta, -widest), widest)
        slip = math.atan(body.cg_to_rear / body.wheelbase * math.tan(delta))
        lateral = v**2 * math.sin(slip) / body.cg_to_rear
        left = math.sqrt(max(limit**2 - lateral**2, 0.0))
        return min(max(a, -left), left), delta

    def _integrate(
        self, a: float, delta: float, a0: float, delta0: float, dt: float
    ) -> tuple[float, float, float]:
        old, body, lag = self.state, self.vehicle, self.actuation.lag_s
        ratio, rear, v_max = body.cg_to_rear / body.wheelbase, body.cg_to_rear, body.v_max

        def rate(t: float, psi: float) -> tuple[float, float, float]:
            v = min(max(_speed(old.v, a, a0, lag, t), 0.0), v_max)
            slip = math.atan(ratio * math.tan(_lagged(delta, delta0, lag, t)))
            return v * math.cos(psi + slip), v * math.sin(psi + slip), v * math.sin(slip) / rear

        x1, y1, w1 = rate(0.0, old.psi)
        x2, y2, w2 = rate(dt / 2, old.psi + w1 * dt / 2)
        x3, y3, w3 = rate(dt / 2, old.psi + w2 * dt / 2)
        x4, y4, w4 = rate(dt, old.psi + w3 * dt)
        return (
            old.x + dt / 6 * (x1 + 2 * x2 + 2 * x3 + x4),
            old.y + dt / 6 * (y1 + 2 * y2 + 2 * y3 + y4),
            old.psi + dt / 6 * (w1 + 2 * w2 + 2 * w3 + w4),
        )


def _lagged(target: float, start: float, lag: float, t: float) -> float:
    return target if lag <= 0 else target + (start - target) * math.exp(-t / lag)


def _speed(v0: float, a: float, a0: float, lag: float, t: float) -> float:
    if lag <= 0:
        return v0 + a * t
    return v0 + a * t + (a0 - a) * lag * (1 - math.exp(-t / lag))


def _time_in_motion(v0: float, a: float, a0: float, lag: float, dt: float) -> float:
    """s until the speed reaches zero, at most dt."""
    if _speed(v0, a, a0, lag, dt) >= 0:
        return dt
    low, high = 0.0, dt
    for _ in range(40):
        middle = (low + high) / 2
        if _speed(v0, a, a0, lag, middle) > 0:
            low = middle
        else:
            high = middle
    return low
