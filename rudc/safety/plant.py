"""How the ego's car carries out commands: dead time, lag and friction, identified while it drives.

A bank of M models of the plant (the car with its actuators, rudc/world/ego.py), each with a dead time d, a
lag T and a coefficient of friction mu, predicts one decision of dt s: from the acceleration and front-wheel
angle that were read before it, and the commands that were given, each has an acceleration a_m and an angle
delta_m. They are compared with those of the real car,

    J_m <- FORGET^(dt / DECISION_S) J_m + min((a - a_m)^2 / A^2, CUT) + min((delta - delta_m)^2 / D^2, CUT)

(the acceleration only while the car drives faster than STANDING and slower than its top speed), and the
estimate is the model with the least J. An ordinary car (no dead time, no lag, a dry road) stays the estimate
until another model is better by SURE, so that there are no false alarms. Models that the drive so far does
not tell apart have the same J; of these the one nearest to an ordinary car is taken, so that nothing is
claimed that was not seen. Friction shows only where a command asks for more than the road gives, which is why
the agents now and then brake fully for a moment (rudc/agents/probe.py). In bends a friction stands for those
between it and the next lower one, too (`weigh_bank`), if it is one that only bends show, or if the road is
known to limit: else a friction between two of the bank's would look like a lag, with which the wheels stay
where they are as well.

The paper leaves this to future work (Sec. "Conclusion": input-constrained barrier functions).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Index
from rudc.safety.plant_kernels import weigh_bank
from rudc.vehicle import Actuation, EgoVehicle
from rudc.world.ego import DRY, GRAVITY, grip_of, within_limits
from rudc.world.scene import EgoState

DECISION_S = 0.1
"""s between two decisions (the paper: 10 Hz), as long as no two have been seen"""
SUBSTEP_S = 0.05
"""s, the step with which the models are driven, or the shortest above it that divides a decision evenly, or a
decision if that is shorter. Dead times are multiples of the step, of several steps if it is shorter than this
"""
ROUNDED = 1e-6
"""a number of steps that is this much below a whole one was rounded"""
LONGEST_S = 2.0
"""s, longest dead time whose commands are remembered; scenarios allow no longer one"""


class Part(NamedTuple):
    """A part of the bank: the models of all combinations."""

    delays: Index
    """(D,) dead times, in sub-steps of SUBSTEP_S or more"""
    lags: Array
    """(L,) s"""
    frictions: Array
    """(F,) coefficients of friction; inf for a dry road"""


BANK = (
    Part(
        np.arange(21),
        np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.6, 2.2, 3.0]),
        np.array([
            np.inf, 0.82, 0.75, 0.68, 0.62, 0.57, 0.52, 0.46, 0.4, 0.35, 0.3, 0.26, 0.23, 0.2, 0.17, 0.15,
            0.13, 0.11, 0.09, 0.07, 0.05, 0.035,
        ]),
    ),
    Part(
        np.arange(21, 41),
        np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.8, 1.5]),
        np.array([np.inf, 0.5, 0.3, 0.18, 0.1]),
    ),
)  # fmt: skip
"""the models: of long dead times, which are rare, only with a few lags and frictions"""
_SIZES = np.array([[len(each) for each in part] for part in BANK])
"""(P, 3) how many dead times, lags and frictions each part has"""
_DELAYS, _LAGS, _FRICTIONS = (np.concatenate(each) for each in zip(*BANK, strict=True))
"""those of all parts, one after the other"""
SLIPPERIEST = 0.6
"""of the least friction, the share down to which it stands for lower ones"""
_PROMPT = int(np.count_nonzero(BANK[0].lags <= 0.15))
"""how many of the lags are so short that a friction with them stands for lower ones, too"""
_LIMITS = np.minimum(_FRICTIONS, DRY) * GRAVITY
"""m/s2, what the frictions give"""
ACCELERATION_STD, STEERING_STD = 0.25, 0.005
"""m/s2, rad: A and D, sizes of errors of the readings that say nothing about the car"""
CUT = 16.0
"""largest term of one reading, so that what one outlier says is made good by the next few"""
FORGET = 0.97
"""share of J that is left after DECISION_S: about three seconds of memory"""
WORST = 24.0
"""largest difference in J that is kept, so that a change of the car is noticed after three readings"""
SURE = 12.0
"""difference in J by which another model must be better to replace an ordinary car"""
BETTER = 4.0
"""difference in J by which another model must be better to replace an unusual car"""
SAME = 1.0
"""difference in J below which two models are not told apart"""
STANDING = 0.3
"""m/s, below which acceleration says nothing about the brakes, since a car that stands does not brake. Lower
than the scene's STANDING, so that the last decimetres of a braking count too
"""


@dataclass(frozen=True, slots=True)
class PlantEstimate:
    """What is known of the ego's car."""

    actuation: Actuation
    """dead time, lag and friction, as the plant has them"""
    unusual: bool
    """whether it differs from an ordinary car"""

    @property
    def grip(self) -> float:
        """m/s2, largest acceleration that the road gives."""
        return grip_of(self.actuation)


ORDINARY = PlantEstimate(Actuation(), unusual=False)
"""a car that carries out each command at once, on a dry road"""


class PlantMonitor:
    """Identifies the plant from one decision of an episode to the next, at first as an ordinary car."""

    def __init__(self, vehicle: EgoVehicle) -> None:
        self._vehicle = vehicle
        cubes = [np.meshgrid(*part, indexing="ij") for part in BANK]
        self._delay, self._lag, self._friction = (
            np.concatenate([cube.ravel() for cube in each]) for each in zip(*cubes, strict=True)
        )
        """(M,) dead times (in units as the bank's), s and coefficients of friction of the models"""
        self._plainness = self._delay * 1.0 + self._lag / 0.05 + 5.0 / self._friction
        self._nominal = int(np.argmin(self._plainness))
        full, limit = -vehicle.a_min, _LIMITS[: _SIZES[0, 2]]
        lower = np.append(limit[1:], SLIPPERIEST * limit[-1])
        only_bends = np.maximum(lower, np.minimum(full, limit))
        self._between = np.zeros((2, len(_LIMITS)))
        self._between[:, : len(limit)] = 0.5 - 0.5 * np.stack([only_bends, lower]) / limit
        """half the distance from each friction to the next lower one, as a share; 0 for long dead times, with
        few frictions. As long as the road is not known to limit (first row), at most to what full braking
        asks for: below that braking tells"""
        self._take_steps_of(SUBSTEP_S)
        self._timed = False
        """whether the time between two decisions is known"""
        self._cost = np.zeros(len(self._delay))
        """(M,) their J"""
        self._before: EgoState | None = None
        self._believed = self._nominal
        self.estimate = ORDINARY

    def update(
        self, ego: EgoState, last_u: Array | tuple[float, float], passed_s: float = DECISION_S
    ) -> PlantEstimate:
        """The new estimate, after the command `last_u` (2,), m/s2 and rad, was given for a decision of
        `passed_s` s and has led to the state `ego`. In the first call only `ego` is used.
        """
        if self._before is not None:
            if not self._timed:
                self._timed = True
                self._take_steps_of(passed_s / max(int(passed_s / SUBSTEP_S + ROUNDED), 1))
            self._compare(self._before, float(last_u[0]), float(last_u[1]), ego, passed_s)
            self.estimate = self._best()
        self._before = ego
        return self.estimate

    def _take_steps_of(self, substep_s: float) -> None:
        """From now on drive the models with steps of `substep_s` s; no command is on its way."""
        self.substep_s = substep_s
        """s, the step with which the models are driven"""
        self._keep = np.exp(-substep_s / np.maximum(_LAGS, 1e-9))
        """share of the difference from a command that is left after a step"""
        self._apart = max(math.ceil(SUBSTEP_S / substep_s - ROUNDED), 1)
        """sub-steps from one of the bank's dead times to the next"""
        self._delays = self._apart * _DELAYS
        """sub-steps, the dead times of all parts of the bank"""
        self._given: Array = np.zeros((max(int(self._delays[-1]), math.ceil(LONGEST_S / substep_s)), 2))
        """m/s2, rad, commands of the last sub-steps, newest first"""

    def _compare(self, before: EgoState, a: float, delta: float, after: EgoState, passed_s: float) -> None:
        """Drive all models with the command for one decision, from the state that was read before it, and
        compare them with the state that was read after it.
        """
        body, substeps = self._vehicle, max(round(passed_s / self.substep_s), 1)
        missing = int(self._delays[-1]) + substeps - len(self._given)
        if missing > 0:
            self._given = np.append(self._given, np.zeros((missing, 2)), axis=0)
        limited = not math.isinf(self._friction[self._believed])
        counts, forget = float(STANDING < after.v < body.v_max - 0.1), FORGET ** (passed_s / DECISION_S)
        weigh_bank(
            self._cost, self._given, _SIZES, self._delays, self._keep, _LIMITS, self._between[int(limited)],
            _PROMPT, complex(*within_limits(body, a, delta)), complex(before.acceleration, before.steering),
            complex(after.acceleration, after.steering), complex(ACCELERATION_STD, STEERING_STD), substeps,
            before.v, after.v, body.cg_to_rear, body.cg_to_rear / body.wheelbase, counts, forget, CUT, WORST,
        )  # fmt: skip

    def _best(self) -> PlantEstimate:
        if self._cost.item(self._believed) < (SURE if self._believed == self._nominal else BETTER):
            return self.estimate
        alike = np.flatnonzero(self._cost < SAME)  # the least is 0
        i = self._believed = int(alike[self._plainness[alike].argmin()])
        if i == self._nominal:
            return ORDINARY
        mu = None if math.isinf(self._friction[i]) else float(self._friction[i])
        delay_s = float(self._apart * self._delay[i] * self.substep_s)
        return PlantEstimate(Actuation(delay_s, float(self._lag[i]), mu), unusual=True)

    def pending(self, delay_s: float) -> list[tuple[float, float]]:
        """Commands (m/s2, rad) of the last `delay_s` s, LONGEST_S at most, oldest first, one for each
        `substep_s`.
        """
        late = min(round(delay_s / self.substep_s), len(self._given))
        return [(a, delta) for a, delta in self._given[:late][::-1].tolist()]
