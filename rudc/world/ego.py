"""The ego vehicle's plant: a kinematic bicycle about the centre of gravity, with slip angle.

    beta = atan(l_r / L * tan(delta))       slip angle, l_r = centre of gravity to rear axle, L = wheelbase
    x'   = v cos(psi + beta)
    y'   = v sin(psi + beta)
    psi' = v sin(beta) / l_r
    v'   = a,  0 <= v <= v_max

The safety filter's model (paper, Sec. "Safety Correction Formulation") is simpler on purpose: it has no slip,
and its yaw rate is v tan(delta) / L. The residual predictor learns the difference.

Actuators: a command may take effect late (dead time) and is followed with a first-order lag,
    a(t) = a_cmd + (a_0 - a_cmd) exp(-t / T),     the same for delta.
Friction: the lateral acceleration v^2 sin(beta) / l_r is at most mu g (a larger steering angle has no further
effect), and the longitudinal acceleration is within what the friction circle leaves. On a dry road mu is DRY.

Without lag, beta is constant over a step and the vehicle drives an arc of length s = v t + a t^2 / 2 and of
curvature k = sin(beta) / l_r. So, with theta = psi + beta, exactly
    psi += k s,   (x, y) += 2 sin(k s / 2) / k (cos, sin)(theta + k s / 2).
With lag, v is integrated in closed form and x, y and psi by fourth-order Runge-Kutta steps. In both cases
the motion ends where the vehicle comes to a stop.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from rudc.arrays import Array
from rudc.errors import InputError
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.kernels import on_an_arc, slip_of, widest, within_friction
from rudc.world.scene import EgoState

GRAVITY = 9.81
"""m/s2"""
DRY = 0.9
"""coefficient of friction of a dry road"""
CRAWL_M = 0.02
"""m of way below which a change of heading says nothing about the steering"""
PIECES_PER_LAG, MOST_PIECES = 4.0, 100
"""Runge-Kutta steps in one time constant of the actuators, and in a simulation step at most: a lag that would
need more is over at once
"""


def grip_of(actuation: Actuation) -> float:
    """m/s2, largest acceleration that the road gives; that of a dry road where `friction` is None."""
    return (DRY if actuation.friction is None else actuation.friction) * GRAVITY


def widest_steering(body: EgoVehicle, v: float, lateral: float) -> float:
    """rad, front-wheel angle that gives a lateral acceleration of `lateral` m/s2 at v m/s; at a stand, the
    vehicle's largest.
    """
    return widest(v, lateral, body.delta_max, body.wheelbase, body.cg_to_rear)


def refuse_no_action(u: Array) -> None:
    """Raise InputError unless u is two numbers, acceleration m/s2 and front-wheel angle rad."""
    numbers = isinstance(u, np.ndarray) and u.shape == (2,) and u.dtype.kind == "f"
    if numbers and not (math.isnan(u.item(0)) or math.isnan(u.item(1))):  # true of nearly all actions
        return
    if np.shape(u) != (2,) or np.isnan(u).any():
        raise InputError(f"the action {u} is not acceleration (m/s2) and front-wheel angle (rad)")


def within_limits(body: EgoVehicle, a: float, delta: float) -> tuple[float, float]:
    """The commands a (m/s2) and delta (rad), cut to the vehicle's limits."""
    return min(max(a, body.a_min), body.a_max), min(max(delta, -body.delta_max), body.delta_max)


class EgoPlant:
    """Integrates the ego's motion from one simulation step to the next."""

    def __init__(self, vehicle: EgoVehicle) -> None:
        self.vehicle = vehicle
        self.actuation = Actuation()
        self._pending: deque[tuple[float, float]] = deque()
        self._given = (0.0, 0.0)
        self.state = EgoState(0, 0, 0, 0, 0, 0, 0, 0)

    def reset(self, x: float, y: float, psi: float, v: float, actuation: Actuation | None = None) -> None:
        """Put the vehicle at a pose (m, m, rad) with a speed (m/s) and straight wheels."""
        self.actuation = actuation or Actuation()
        self._pending.clear()
        self._given = (0.0, 0.0)
        self.state = EgoState(x, y, psi, min(max(v, 0.0), self.vehicle.v_max), 0.0, 0.0, 0.0, 0.0)

    def slow_down(self, v: float) -> None:
        """From now on drive at v m/s, or as fast as before if that is less."""
        self.state = replace(self.state, v=min(self.state.v, v))

    def resume(self, state: EgoState, actuation: Actuation) -> None:
        """Go on from a state; commands that have not yet taken effect are dropped."""
        self.actuation = actuation
        self._pending.clear()
        self.state = state

    def step(self, a: float, delta: float, dt: float) -> EgoState:
        """Advance by dt (s) under the commands a (m/s2) and delta (rad), each clipped to the vehicle's
        limits."""
        body = self.vehicle
        a, delta = self._delayed(*within_limits(body, a, delta), dt)
        mu, old = DRY if self.actuation.friction is None else self.actuation.friction, self.state
        shape = body.wheelbase, body.cg_to_rear
        tyres = mu * GRAVITY, body.delta_max, *shape
        a, delta = within_friction(a, delta, old.v, *tyres)
        if self.actuation.lag_s > 0:
            now = within_friction(old.acceleration, old.steering, old.v, *tyres)
            self.state = self._lagging(a, delta, *now, dt)
        else:
            self.state = EgoState(*on_an_arc(old.x, old.y, old.psi, old.v, a, delta, dt, body.v_max, *shape))
        return self.state

    def _delayed(self, a: float, delta: float, dt: float) -> tuple[float, float]:
        """a (m/s2) and delta (rad) that take effect now. When a dead time begins, the last command before it
        stays in effect until the first delayed one arrives.
        """
        steps, last = round(self.actuation.delay_s / dt), self._given
        self._given = a, delta
        if not steps:
            self._pending.clear()
            return a, delta
        while len(self._pending) < steps:
            self._pending.appendleft(self._pending[0] if self._pending else last)
        self._pending.append((a, delta))
        while len(self._pending) > steps + 1:
            self._pending.popleft()
        return self._pending.popleft()

    def _lagging(self, a: float, delta: float, a0: float, delta0: float, dt: float) -> EgoState:
        """The state after dt s in which acceleration and steering, now a0 and delta0, follow their commands
        with a lag.
        """
        old, body, lag = self.state, self.vehicle, self.actuation.lag_s
        moving = _time_in_motion(old.v, a, a0, lag, dt)
        x, y, psi = self._integrate(a, delta, a0, delta0, moving)
        v = 0.0 if moving < dt else min(_speed(old.v, a, a0, lag, dt), body.v_max)
        steering = _lagged(delta, delta0, lag, dt)
        slip = slip_of(steering, body.wheelbase, body.cg_to_rear)
        yaw_rate = v * math.sin(slip) / body.cg_to_rear
        return EgoState(x, y, psi, v, slip, yaw_rate, _lagged(a, a0, lag, dt), steering)

    def _integrate(
        self, a: float, delta: float, a0: float, delta0: float, dt: float
    ) -> tuple[float, float, float]:
        """x, y, psi after dt s of lagged acceleration and steering, in steps shorter than the lag."""
        old, body, lag = self.state, self.vehicle, self.actuation.lag_s
        ratio, rear, v_max = body.cg_to_rear / body.wheelbase, body.cg_to_rear, body.v_max

        def rate(t: float, psi: float) -> tuple[float, float, float]:
            v = min(max(_speed(old.v, a, a0, lag, t), 0.0), v_max)
            slip = math.atan(ratio * math.tan(_lagged(delta, delta0, lag, t)))
            return v * math.cos(psi + slip), v * math.sin(psi + slip), v * math.sin(slip) / rear

        x, y, psi = old.x, old.y, old.psi
        pieces = min(math.ceil(PIECES_PER_LAG * min(dt / lag, MOST_PIECES)), MOST_PIECES)
        h = dt / max(pieces, 1)
        for i in range(pieces):
            t = i * h
            x1, y1, w1 = rate(t, psi)
            x2, y2, w2 = rate(t + h / 2, psi + w1 * h / 2)
            x3, y3, w3 = rate(t + h / 2, psi + w2 * h / 2)
            x4, y4, w4 = rate(t + h, psi + w3 * h)
            x += h / 6 * (x1 + 2 * x2 + 2 * x3 + x4)
            y += h / 6 * (y1 + 2 * y2 + 2 * y3 + y4)
            psi += h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
        return x, y, psi


def realised(before: EgoState, after: EgoState, duration_s: float, body: EgoVehicle) -> tuple[float, float]:
    """The a (m/s2) and delta (rad) that lead from one state to another within duration_s, for an ego that
    another driver than this plant moved. At a stand, delta is 0."""
    way = 0.5 * (before.v + after.v) * duration_s
    if way < CRAWL_M:
        return (after.v - before.v) / duration_s, 0.0
    bend = math.remainder(after.psi - before.psi, 2 * math.pi) / way
    slip = math.asin(min(max(bend * body.cg_to_rear, -1.0), 1.0))
    delta = math.atan(body.wheelbase / body.cg_to_rear * math.tan(slip))
    return (after.v - before.v) / duration_s, min(max(delta, -body.delta_max), body.delta_max)


def _lagged(target: float, start: float, lag: float, t: float) -> float:
    return target + (start - target) * math.exp(-t / lag)


def _speed(v0: float, a: float, a0: float, lag: float, t: float) -> float:
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
