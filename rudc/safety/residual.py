"""The residual w: the error of the filter's one-step prediction of h, as a small learnt network predicts it.

Paper, Sec. "Uncertainty-embedded Constraints": h(x_next) = h + dt h' + dt^2/2 h'' + w, where w is due to
what the filter's model leaves out: slip, actuators, vehicles that brake, accelerate or turn, the rest of the
Taylor series. f_c with c = vehicle or road predicts w from features xi: the normalised proposed action, the
state of the ego and that of the constraint (`Barrier.inputs`). Both are networks with two hidden layers,

    w = scale (gelu(gelu((xi - mean) / spread W1 + b1) W2 + b2) W3 + b3)

xi is first clipped to the range that the network was fitted on, [low, high], since its output outside that
range is arbitrary. So a predictor that was fitted on cars treats a truck, or a closed lane, like a car; when
it was left to extrapolate from their sizes, it cancelled the filter's rows towards them.

There is one predictor for each kind of action, since the effect of slip and actuators on a proposal depends
on how proposals steer. Near standstill, w is reduced in proportion to the ego's speed below FADING: an ego
that stands moves as the model says, and an error of 0.01 m2 would be enough to keep it from ever starting.

A predictor fitted on dry roads assumes that the road gives the acceleration that is asked for. On ice it is
right as long as that is so, and worse than no predictor where far more is asked for. So w is reduced as a
proposal asks for more: from HOLDS times the known limit of the road on, to 0 at GIVES_OUT times that
limit. The known limit is the hardest braking of the scene's vehicle: an outlook (rudc/agents/outlook.py)
sets it from its estimate of the grip, or from the truth. Without an outlook the limit is unknown, and w
counts in full.

One predictor serves TTCBF and ECBF: both predict the same h by the same model and need the same w, in m2 per
step; rows.py derives where it enters ECBF's row. The buffer (`Bodies.margin`) is part of xi, so that one
predictor serves every d_safe.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file

from rudc.arrays import Array, Arrays
from rudc.data import data_folder
from rudc.errors import AgentError
from rudc.imports import is_own
from rudc.safety.barrier import COMMON, STEP, Terms
from rudc.safety.barriers import BARRIERS
from rudc.safety.constraints import Constraints
from rudc.safety.residual_kernels import common_features, network
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene

SHIPPED = "results/residual"
"""folder of the predictors that come with RUDC"""
SUFFIX = ".safetensors"
"""end of a predictor's file name, after the kind of action that it was fitted on"""
SPEED = COMMON.index("speed / 10")
FADING = 1.0
"""m/s, speed of the ego below which w is reduced in proportion to the speed"""
HOLDS, GIVES_OUT = 1.5, 2.5
"""ratios of the acceleration asked for to what the road is known to give: w counts in full up to the
first, and not at all from the second on. At mu of 0.2, 0.35 and 0.65, w improved the prediction up to 1.6
and made it worse beyond 2.5
"""


def heads() -> dict[str, tuple[str, ...]]:
    """Name of each barrier that has a network of its own, its head -> names of its features xi."""
    return {name: COMMON + barrier.inputs for name, barrier in BARRIERS.items() if barrier.inputs}


def features(scene: Scene, constraints: Constraints, u_rl: Array) -> dict[str, Array]:
    """Name of each barrier with a head -> features xi (k, F) of its k constraints, for a proposed action
    `u_rl` (2,): acceleration m/s2, front-wheel angle rad.
    """
    ego, to = scene.ego, constraints.bodies
    a = max(float(u_rl[0]), -ego.v / STEP)  # no driving backwards, as in the filter
    own = (a / 6, math.tan(u_rl[1]), ego.v / 10, ego.acceleration / 6, math.tan(ego.steering))
    here = complex(ego.x, ego.y)
    found: dict[str, Array] = {}
    for barrier, seen, rows in constraints.parts:
        if not barrier.inputs:
            continue
        inputs = len(COMMON) + len(barrier.inputs)
        if not seen.names:
            found[barrier.name] = np.empty((0, inputs))
            continue
        part = to.part(rows)
        xi = found[barrier.name] = common_features(own, part.position, part.offset, here, ego.psi, inputs)
        barrier.features(scene, seen, part, xi)
    return found


def predicted_change(terms: Terms, a: float, z: float) -> Array:
    """(K,) m2, dt h' + dt^2/2 h'' at acceleration `a` m/s2 and z = tan(front-wheel angle)."""
    first = terms.lf + terms.lg * z + (0.0 if terms.lg_a is None else terms.lg_a * a)
    second = terms.lf2 + terms.lglf_a * a + (terms.lglf_z + terms.lflg + terms.az * a + terms.zz * z) * z
    return STEP * first + 0.5 * STEP * STEP * second


def trust(vehicle: EgoVehicle, v: float, u: Array, dry: EgoVehicle) -> float:
    """Factor on w, from 0 to 1, for a proposal u (2,), m/s2 and rad, at v m/s; `vehicle` is the scene's,
    `dry` the same on a dry road.
    """
    limit = -vehicle.a_min
    if limit >= -dry.a_min:
        return 1.0
    slip = math.atan(vehicle.cg_to_rear / vehicle.wheelbase * math.tan(u[1]))
    lateral = v * v * math.sin(slip) / vehicle.cg_to_rear
    asked = math.hypot(max(float(u[0]), -v / STEP), lateral) / max(limit, 1e-6)
    return min(max((GIVES_OUT - asked) / (GIVES_OUT - HOLDS), 0.0), 1.0)


class ResidualPredictor:
    """The networks (heads) f_vehicle and f_road, and those of further barriers with inputs that its arrays
    have. `rudc residual fit` makes the first two; w = 0 for barriers without a head.
    """

    def __init__(self, arrays: Mapping[str, NDArray]) -> None:
        """`arrays`: for each head `HEAD/mean`, `/spread`, `/low`, `/high`, `/scale`, and `/w1`, `/b1` to
        `/w3`, `/b3`. Raises AgentError if they do not fit.
        """
        self.arrays: Arrays = {name: np.asarray(value, dtype=np.float32) for name, value in arrays.items()}
        self._heads: dict[str, _Head] = {}
        for name, inputs in heads().items():
            demanded = BARRIERS[name].at_work and not is_own(BARRIERS[name])
            if demanded or f"{name}/mean" in self.arrays:
                self._heads[name] = self._head(name, len(inputs))

    def _head(self, name: str, inputs: int) -> _Head:
        try:
            head = _Head(self.arrays, name)
        except KeyError as error:
            raise AgentError(f"the residual predictor lacks {error}") from None
        if head.inputs != inputs:
            raise AgentError(f"the residual predictor takes {head.inputs} features, not {inputs}")
        return head

    def __call__(self, scene: Scene, constraints: Constraints, u_rl: Array) -> Array:
        """(K,) m2 per step, w of all constraints for the proposed action `u_rl` (2,), m/s2 and rad; 0 for
        those of barriers without a head.
        """
        w = np.zeros(constraints.count)
        counts = trust(scene.vehicle, scene.ego.v, u_rl, scene.network.vehicle)
        if counts == 0.0:
            return w
        xi = features(scene, constraints, u_rl)
        for barrier, _, rows in constraints.parts:
            if barrier.name in self._heads and len(xi[barrier.name]):
                w[rows] = self.of(barrier.name, xi[barrier.name])
        return counts * w

    def of(self, head: str, xi: Array) -> Array:
        """(n,) m2 per step, w from features (n, F) of one head."""
        return self._heads[head](xi)


_PARTS = ("mean", "spread", "low", "high", "scale", "w1", "b1", "w2", "b2", "w3", "b3")
"""arrays of a head"""


class _Head:
    """The network of one barrier; the scaling of its inputs is part of its first layer."""

    def __init__(self, arrays: Mapping[str, NDArray], head: str) -> None:
        """Raises KeyError if an array is missing, AgentError if one does not fit."""
        own = {name: arrays[f"{head}/{name}"] for name in _PARTS}
        inputs, width, last = own["mean"].size, own["w2"].shape[:1], own["b2"].shape
        wanted = {
            **dict.fromkeys(("mean", "spread", "low", "high"), (inputs,)),
            "w1": (inputs, *width), "b1": width, "w2": (*width, *last), "b2": last, "w3": (*last, 1),
            "b3": (1,),
        }  # fmt: skip
        for name, shape in wanted.items():
            array = own[name]
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise AgentError(f"the residual predictor's {head}/{name} does not fit, or is not finite")
        if own["scale"].size != 1 or not np.all(own["spread"] > 0):
            raise AgentError(f"the residual predictor's scales of {head} are not positive numbers")
        first = own["w1"] / own["spread"][:, None]
        self.inputs = inputs
        scale = np.float32(own["scale"].item())
        layers = (
            own["low"], own["high"], first, own["b1"] - own["mean"] @ first,
            own["w2"], own["b2"], own["w3"][:, 0] * scale,
        )  # fmt: skip
        self._arrays = *map(np.ascontiguousarray, layers), np.float32(own["b3"][0]) * scale

    def __call__(self, xi: Array) -> Array:
        return network(xi, *self._arrays, SPEED, 10 / FADING)


def load_predictor(path: Path) -> ResidualPredictor:
    """A predictor from its file. Raises AgentError."""
    try:
        return ResidualPredictor(load_file(path))
    except FileNotFoundError:
        raise AgentError(f"no residual predictor in {path}: `rudc residual fit` makes one") from None
    except (OSError, SafetensorError) as error:
        raise AgentError(f"{path} is no residual predictor: {error}") from None


@cache
def shipped_predictor(action: str = "adjustment") -> ResidualPredictor:
    """The predictor that comes with RUDC for a kind of action; that of `adjustment` for kinds without one."""
    own = data_folder(SHIPPED) / f"{action}{SUFFIX}"
    return load_predictor(own if own.is_file() else own.with_name(f"adjustment{SUFFIX}"))
