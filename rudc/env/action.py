"""Kinds of action: what an action (x, y) in [-1, 1]^2 means. Each kind has its own settings, space and
inverse.

    direct       -1 and 1 are the vehicle's limits on both axes: a from a_min to a_max, delta_f from
                 -delta_max to delta_max. As a_min is larger in size than a_max, x = 0 is a light braking of
                 (a_min + a_max) / 2
    adjustment   acceleration: a_max x for x >= 0, -a_min x below, so that 0 coasts; steering: that of a
                 driver who follows the path (rudc/env/tracking.py) + adjustment y

The first is the paper's. The second (ours) leaves the hard part to learning, namely when to go, and lets the
policy deviate from the path where that helps. The environment, RUDC's agents, their training and the samples
for the residual predictor all use these kinds. To add one, write a class and an entry in `ACTIONS`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces
from pydantic import BeforeValidator, Field, SerializeAsAny

from rudc.arrays import Array, Floats
from rudc.env.tracking import steering
from rudc.imports import ask_own, is_own, refused, shortened
from rudc.kinds import of_kind, read_kind
from rudc.settings import Settings
from rudc.world.scene import Scene

Action = Array | Floats


class ActionKind(Settings):
    """Base of all kinds of action; subclasses have `kind`, their name in `ACTIONS`, and settings."""

    follows_path: ClassVar[bool] = False
    """whether 0 on the second axis steers along the path"""

    @property
    def name(self) -> str:
        """The name of its kind in `ACTIONS` and in settings."""
        return type(self).model_fields["kind"].default

    def space(self) -> spaces.Box:
        """The action space of the environment."""
        return spaces.Box(-1.0, 1.0, (2,), np.float32)

    @abstractmethod
    def physical(self, action: Action, scene: Scene) -> Array:
        """(2,) acceleration m/s2 and front-wheel angle rad that an `action` (2,) stands for in this scene.
        The action is first cut to the space; the result is within the vehicle's limits.
        """

    @abstractmethod
    def normalised(self, u: Array, scene: Scene) -> Array:
        """(2,) the action that stands for u (2,), m/s2 and rad, or for the nearest u that an action can
        reach.
        """

    def u_of(self, action: Action, scene: Scene) -> Array:
        """What `physical` returns. Raises PartFailedError if a kind that is not RUDC's returns anything
        but two finite numbers.
        """
        if not is_own(self):
            return self.physical(action, scene)
        return self._looked_at("physical", scene, lambda: self.physical(action, scene))

    def action_of(self, u: Array, scene: Scene) -> Array:
        """What `normalised` returns, checked in the same way."""
        if not is_own(self):
            return self.normalised(u, scene)
        return self._looked_at("normalised", scene, lambda: self.normalised(u, scene))

    def _looked_at(self, method: str, scene: Scene, call: Callable[[], Any]) -> Array:
        who = f"action kind {self.name}"
        answer = ask_own(who, scene.time_s, method, call)
        numbers = two_numbers(answer)
        if numbers is None:
            raise refused(who, scene.time_s, method, shortened(answer), "two finite numbers")
        return numbers


class Direct(ActionKind):
    """-1 and 1 are the vehicle's limits (paper, Sec. "Observation and Action Spaces")."""

    kind: Literal["direct"] = "direct"

    def physical(self, action: Action, scene: Scene) -> Array:
        """See `ActionKind`."""
        body, (a, delta) = scene.vehicle, _cut(action)
        middle, half = 0.5 * (body.a_max + body.a_min), 0.5 * (body.a_max - body.a_min)
        return np.array([middle + half * a, body.delta_max * delta])

    def normalised(self, u: Array, scene: Scene) -> Array:
        """See `ActionKind`."""
        body = scene.vehicle
        middle, half = 0.5 * (body.a_max + body.a_min), 0.5 * (body.a_max - body.a_min)
        return np.array(_cut(((float(u[0]) - middle) / half, float(u[1]) / body.delta_max)))


class Adjustment(ActionKind):
    """The action is relative to a driver who coasts along the path."""

    follows_path: ClassVar[bool] = True
    kind: Literal["adjustment"] = "adjustment"
    adjustment: float = Field(default=0.1, ge=1e-3, le=1.5)
    """rad, largest change of the path follower's steering"""

    def physical(self, action: Action, scene: Scene) -> Array:
        """See `ActionKind`."""
        body, (x, y) = scene.vehicle, _cut(action)
        delta = steering(scene) + self.adjustment * y
        delta = min(max(delta, -body.delta_max), body.delta_max)
        return np.array([(body.a_max if x >= 0 else -body.a_min) * x, delta])

    def normalised(self, u: Array, scene: Scene) -> Array:
        """See `ActionKind`."""
        body, a = scene.vehicle, float(u[0])
        x = a / (body.a_max if a >= 0 else -body.a_min)
        return np.array(_cut((x, (float(u[1]) - steering(scene)) / self.adjustment)))


def numbers_of(answer: Any) -> Array:
    """An answer of code that is not RUDC's, as an array. Raises TypeError for anything but real numbers, also
    for texts that NumPy would read as numbers.
    """
    try:
        given = np.asarray(answer)
        if given.dtype.kind not in "biuf" and any(isinstance(part, str | bytes) for part in given.flat):
            raise TypeError("a text is no number")
        if given.dtype.kind == "c":
            raise TypeError("a complex number is no number of these")
        return given.astype(np.float64, copy=False)
    except Exception as error:  # whatever an unknown class raises when it is converted to an array
        raise TypeError(str(error)) from error


def two_numbers(answer: Any) -> Array | None:
    """(2,) an action that code which is not RUDC's answers; None if it is anything but two finite numbers."""
    if type(answer) is np.ndarray and answer.shape == (2,) and answer.dtype == np.float64:
        numbers = answer  # the usual case
    else:
        try:
            numbers = numbers_of(answer)
        except TypeError:
            return None
    return numbers if numbers.shape == (2,) and all(map(math.isfinite, numbers.tolist())) else None


ACTIONS: dict[str, type[ActionKind]] = {"direct": Direct, "adjustment": Adjustment}
"""name of a kind -> its class"""


def read_action(value: str | Mapping[str, Any] | ActionKind) -> ActionKind:
    """The kind of action that a name, or a mapping of `kind` and settings, stands for. Raises InputError."""
    return read_kind(value, ACTIONS, ActionKind, "action")


ActionSettings = Annotated[
    SerializeAsAny[ActionKind], BeforeValidator(lambda value: of_kind(value, ACTIONS, ActionKind))
]
"""type of a field for any kind of action; it takes a name or a mapping, too"""


def _cut(action: Action | tuple[float, float]) -> tuple[float, float]:
    x, y = float(action[0]), float(action[1])
    return min(max(x, -1.0), 1.0), min(max(y, -1.0), 1.0)
