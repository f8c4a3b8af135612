"""Smooths what noisy sensors show of the others.

How noisy the sensors are is estimated from the part of a change between two decisions, dt s apart, that
motion does not explain (p position, v velocity or its size, a acceleration, psi heading; ' marks the
later one):

    place    |p' - p - dt (v + v') / 2|      each coordinate
    speed    |v' - v - dt a'|
    heading  |psi' - psi - (course' - course)|

The last KEPT differences of the LISTENED nearest others are kept. Their median, divided by sqrt(2) NORMAL, is
the standard deviation of Gaussian errors that would cause such differences; a few others that jump or swerve
hardly change it. Where it is below LEAST, the sensors count as free of noise, and the scene is not changed.

Above LEAST, each other is tracked by three Kalman filters: for its position and speed along its direction of
motion (course), for its position across it, and for its heading. Between two decisions the position changes
with the speed, the speed with the acceleration that is seen, and the heading with the course; UNKNOWN, ASIDE
and TURNING are the standard deviations of the errors of this model. Somebody who is seen farther than JUMP
from where it was expected is tracked anew.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from rudc.agents.kernels import listen, sighted
from rudc.arrays import Array, Index
from rudc.world.scene import Scene

LISTENED, KEPT, FEWEST = 4, 120, 12
"""numbers of others whose differences are used, of differences that are kept, and of differences that are
needed for an estimate"""
NORMAL = 0.6745
"""median of |x| for a standard normal x"""
DIFFERING = NORMAL * math.sqrt(2.0)
"""median of |x - y| for two independent standard normal x and y"""
LEAST = 0.06, 0.06, 0.02
"""m, m/s and rad, standard deviations below which sensors count as without noise"""
_LEAST: Array = DIFFERING * np.array(LEAST)
"""medians of the differences that errors of LEAST cause"""
UNKNOWN, ASIDE, TURNING = 1.0, 0.5, 0.1
"""m/s2, m/s and rad/s, standard deviations of accelerations, lateral motion and turning that are not seen"""
JUMP = 5.0
"""standard deviations: somebody who is seen farther than this from what is expected is tracked anew"""
LOST_S = 1.0
"""s, after which somebody who was not seen is forgotten"""
_SAME: Index = np.arange(LISTENED)
"""rows of the nearest others one decision ago, if they are the same"""
EXACT = 1e-4
"""m, m/s and rad, the least standard deviation that a filter assumes"""


@dataclass(slots=True)
class _Other:
    """The last sighting of another; where sensors are noisy, the filters' estimate of it."""

    time_s: float
    place: complex
    """m"""
    speed: float
    """m/s, negative backwards"""
    course: complex
    """direction of motion"""
    heading: float
    """rad"""


@dataclass(slots=True)
class _Spread:
    """Variances of the filters' estimate of another."""

    along: float
    """m2"""
    both: float
    """m2/s, covariance of place and speed"""
    speed: float
    """m2/s2"""
    across: float
    """m2"""
    heading: float
    """rad2"""


class Smoothing:
    """Smooths the scenes of one episode."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._seen: Array = np.zeros((0, 6))
        """the nearest others one decision ago, as `sighted` returns them"""
        self._known: dict[str, tuple[_Other, _Spread]] = {}
        self._time_s = -math.inf
        self._kept: Array = np.zeros((3, KEPT))
        """differences of places, speeds and headings"""
        self._counts: Index = np.zeros((3, 2), dtype=np.int64)
        """for each row of `_kept`: how many differences were ever kept, and how many of those now kept exceed
        `_LEAST`"""
        self.noise: tuple[float, ...] = 0.0, 0.0, 0.0
        """m, m/s, rad: standard deviations of the errors of places, speeds and headings, 0 for none"""

    def see(self, scene: Scene) -> Scene:
        """The scene with the others as estimated, or the scene itself where sensors have no noise; call
        it once for each decision.
        """
        dt, self._time_s = scene.time_s - self._time_s, scene.time_s
        if dt <= 0.0:
            return scene
        self._listen(scene, dt)
        if not any(self.noise):
            self._known.clear()
            return scene
        return self._smoothed(scene)

    def _listen(self, scene: Scene, dt: float) -> None:
        """Keep what motion does not explain since the last decision, and estimate the noise from it."""
        before, names = self._names, scene.ids[:LISTENED]
        rows = _SAME
        if names != before:
            rows = np.array([before.index(name) if name in before else -1 for name in names], dtype=np.int64)
        self._seen = listen(
            scene.position, scene.velocity, scene.heading, scene.acceleration, LISTENED, EXACT,
            self._seen, rows, dt, _LEAST, self._kept, self._counts,
        )  # fmt: skip
        self._names = names
        self.noise = tuple(
            self._noise(kind, min(number, KEPT)) if 2 * above >= min(number, KEPT) >= FEWEST else 0.0
            for kind, (number, above) in enumerate(self._counts.tolist())
        )

    def _noise(self, kind: int, count: int) -> float:
        """Standard deviation of the errors of a `kind` (position, speed or heading) that causes the median of
        its `count` differences.
        """
        return sorted(self._kept[kind, :count].tolist())[count // 2] / DIFFERING

    def _smoothed(self, scene: Scene) -> Scene:
        place, speed, heading = (max(std, EXACT) ** 2 for std in self.noise)
        self._known = {n: k for n, k in self._known.items() if scene.time_s - k[0].time_s <= LOST_S}
        shown = [
            self._follow(name, seen, a, place, speed, heading)
            for name, seen, a in zip(scene.ids, _sightings(scene), scene.acceleration.tolist(), strict=True)
        ]
        position = np.array([(one.place.real, one.place.imag) for one in shown]).reshape(-1, 2)
        velocity = np.array([(v.real, v.imag) for v in (one.speed * one.course for one in shown)])
        headings = np.array([one.heading for one in shown])
        shift = position - scene.position
        along = shift[:, 0] * np.cos(headings) + shift[:, 1] * np.sin(headings)
        return replace(
            scene,
            position=position,
            velocity=velocity.reshape(-1, 2),
            heading=headings,
            path_s=scene.path_s + along,
        )

    def _follow(
        self, name: str, seen: _Other, acceleration: float, place: float, speed: float, heading: float
    ) -> _Other:
        """The new estimate of another, which is `seen` with errors of these variances (m2, m2/s2, rad2)."""
        known = self._known.get(name)
        if (
            known is None
            or not _move(*known, seen, acceleration)
            or not _correct(*known, seen, place, speed, heading)
        ):
            known = replace(seen), _Spread(place, 0.0, speed, place, heading)
        self._known[name] = known
        return known[0]


def _sightings(scene: Scene) -> list[_Other]:
    """The others as the sensors show them."""
    rows = sighted(scene.position, scene.velocity, scene.heading, scene.count, EXACT).tolist()
    return [
        _Other(scene.time_s, complex(x, y), speed, complex(cos, sin), heading)
        for x, y, speed, cos, sin, heading in rows
    ]


def _move(one: _Other, spread: _Spread, seen: _Other, acceleration: float) -> bool:
    """Predict the estimate `one` for the time at which it is `seen`; False if it has turned round."""
    dt = seen.time_s - one.time_s
    middle = one.course + seen.course
    if abs(middle) < 1.0:
        return False
    way = one.speed * dt + 0.5 * acceleration * dt * dt
    one.place += way * middle / abs(middle)
    one.speed += acceleration * dt
    one.heading += _bend(one.course, seen.course)
    one.course, one.time_s = seen.course, seen.time_s
    kick = UNKNOWN * dt
    spread.along += dt * (2.0 * spread.both + dt * spread.speed) + (0.5 * kick * dt) ** 2
    spread.both += dt * spread.speed + 0.5 * kick * kick * dt
    spread.speed += kick * kick
    spread.across += (ASIDE * dt) ** 2
    spread.heading += (TURNING * dt) ** 2
    return True


def _correct(one: _Other, spread: _Spread, seen: _Other, place: float, speed: float, heading: float) -> bool:
    """Correct the estimate `one` with what is `seen` with errors of these variances (m2, m2/s2, rad2);
    False if that differs by more than JUMP.
    """
    off = (seen.place - one.place) * one.course.conjugate()
    total = spread.across + place
    if max(off.real**2 / (spread.along + place), off.imag**2 / total) > JUMP * JUMP:
        return False
    share = spread.across / total
    one.place += 1j * share * off.imag * one.course
    spread.across *= 1.0 - share
    turned = _turn(seen.heading - one.heading)
    total = spread.heading + heading
    if turned * turned > JUMP * JUMP * total:
        return False
    share = spread.heading / total
    one.heading += share * turned
    spread.heading *= 1.0 - share
    ahead, total = off.real, spread.along + place
    near, fast = spread.along / total, spread.both / total
    one.place += near * ahead * one.course
    one.speed += fast * ahead
    spread.speed -= fast * spread.both
    spread.along, spread.both = (1.0 - near) * spread.along, (1.0 - near) * spread.both
    faster, total = seen.speed - one.speed, spread.speed + speed
    if faster * faster > JUMP * JUMP * total:
        return False
    near, fast = spread.both / total, spread.speed / total
    one.place += near * faster * one.course
    one.speed += fast * faster
    spread.along -= near * spread.both
    spread.both, spread.speed = (1.0 - fast) * spread.both, (1.0 - fast) * spread.speed
    return True


def _bend(before: complex, after: complex) -> float:
    """rad from one direction to another."""
    return cmath.phase(after * before.conjugate())


def _turn(angle: float) -> float:
    """rad, the same angle within [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)
