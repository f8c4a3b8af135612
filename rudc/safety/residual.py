"""What the filter's one-step prediction of h lacks, as a small learnt network expects it.

Paper, Sec. "Uncertainty-embedded Constraints": h(x_next) = h + dt h' + dt^2/2 h'' + w, where w is due to
what the filter's model leaves out: slip, actuators, vehicles that brake, accelerate or turn, the rest of the
Taylor series. f_c with c = vehicle or road predicts w from xi: the normalised proposed action, the state of
the ego and of the constraint. Both are networks of two hidden layers,

    w = scale (gelu(gelu((xi - mean) / spread W1 + b1) W2 + b2) W3 + b3)

xi is first clipped to the range that it was fitted on, [low, high]: beyond it a network says anything. A
predictor that has only seen cars takes a truck, or a closed lane, for a car; left to extrapolate from their
sizes it cancelled the filter's rows about them.

One predictor serves TTCBF and ECBF: both predict the same h by the same model and need the same w, in m2 per
step; rows.py derives where it enters ECBF's row. The buffer (`Constraints.margin`) is part of xi, so that it
also serves whatever d_safe.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file

from rudc.arrays import Array, Arrays, Index
from rudc.data import data_folder
from rudc.errors import AgentError
from rudc.network.paths import SPACING
from rudc.safety.barrier import Constraints, Terms
from rudc.world.scene import Scene

HEADS = ("vehicle", "road")
SHIPPED = "results/residual"
"""where the predictor that comes with RUDC lies"""
FILE = "predictor.safetensors"
STEP = 0.1
"""s, how long an action is held"""
VEHICLE = (
    "acceleration / 6",
    "tan(steering)",
    "speed / 10",
    "realised acceleration / 6",
    "tan(realised steering)",
    "ahead / 20",
    "to the left / 20",
    "distance / 20",
    "cos(relative heading)",
    "sin(relative heading)",
    "its speed ahead / 10",
    "its speed to the left / 10",
    "its acceleration / 6",
    "its yaw rate",
    "its half length / 5",
    "its half width / 5",
    "buffer",
)
"""xi of vehicles: SI units, in the ego's frame, divided as stated"""
ROAD = (
    "acceleration / 6",
    "tan(steering)",
    "speed / 10",
    "realised acceleration / 6",
    "tan(realised steering)",
    "ahead / 20",
    "to the left / 20",
    "distance / 20",
    "reference point",
    "buffer",
    "path's curvature * 10",
    "distance one step straight on / 20",
)
"""xi of road-edge points; the last one tells where the edge leads, which the row takes for straight"""


def features(scene: Scene, constraints: Constraints, u_rl: Array) -> tuple[Array, Array]:
    """xi of the vehicles (n, 17) and of the road-edge points (K - n, 12), for a proposed action `u_rl` (2,):
    acceleration m/s2, front-wheel angle rad.
    """
    ego, n, k = scene.ego, constraints.vehicles, constraints.count
    a = max(float(u_rl[0]), -ego.v / STEP)  # no driving backwards, as in the filter
    heading = complex(math.cos(ego.psi), math.sin(ego.psi))
    own = (a / 6, math.tan(u_rl[1]), ego.v / 10, ego.acceleration / 6, math.tan(ego.steering))
    away = (constraints.position - constraints.offset * heading - complex(ego.x, ego.y)) * heading.conjugate()
    vehicles, road = np.empty((n, len(VEHICLE))), np.empty((k - n, len(ROAD)))
    for xi, part in ((vehicles, away[:n]), (road, away[n:])):
        xi[:, :5] = own
        xi[:, 5], xi[:, 6], xi[:, 7] = part.real / 20, part.imag / 20, np.abs(part) / 20
    if n:
        turned, drift = constraints.direction[:n], constraints.velocity[:n]
        relative, moving = turned * heading.conjugate(), drift * heading.conjugate()
        vehicles[:, 8], vehicles[:, 9] = relative.real, relative.imag
        vehicles[:, 10], vehicles[:, 11] = moving.real / 10, moving.imag / 10
        vehicles[:, 12] = scene.acceleration[constraints.others] / 6
        vehicles[:, 13] = _yaw_rates(scene, constraints.others)
        short, stretch = constraints.short[1, :n], constraints.stretch[1, :n]
        vehicles[:, 14], vehicles[:, 15] = np.sqrt(short + stretch) / 5, np.sqrt(short) / 5
        vehicles[:, 16] = constraints.margin[:n]
    if k > n:
        path = scene.route.path
        at = min(max(int(scene.ego_s / SPACING), 0), len(path.curvature) - 1)
        road[:, 8], road[:, 9] = constraints.offset[n:], constraints.margin[n:]
        road[:, 10] = 10 * path.curvature[at]
        if constraints.road is not None:
            way = ego.v * STEP
            there = complex(ego.x, ego.y) + way * heading
            road[:, 11] = np.abs(constraints.road.away(there, heading, scene.ego_s + way)) / 20
    return vehicles, road


def predicted_change(terms: Terms, a: float, z: float) -> Array:
    """(K,) m2, dt h' + dt^2/2 h'' at acceleration `a` m/s2 and z = tan of the steering angle."""
    first = terms.lf + terms.lg * z
    second = terms.lf2 + terms.lglf_a * a + (terms.lglf_z + terms.lflg + terms.az * a + terms.zz * z) * z
    return STEP * first + 0.5 * STEP * STEP * second


def _yaw_rates(scene: Scene, others: Index) -> Array:
    """(n,) rad/s of vehicles that follow their paths at their speeds; 0 for those that have none."""
    paths, rows = scene.network.paths, scene.path[others]
    here = np.clip(scene.path_s[others] / SPACING, 1, paths.heading.shape[1] - 2).astype(np.int64)
    known = np.maximum(rows, 0)
    bend = (paths.heading[known, here + 1] - paths.heading[known, here - 1]) / (2 * SPACING)
    speed = np.hypot(scene.velocity[others, 0], scene.velocity[others, 1])
    return np.where(rows >= 0, bend * speed, 0.0)


class ResidualPredictor:
    """f_vehicle and f_road."""

    def __init__(self, arrays: Mapping[str, NDArray]) -> None:
        """`arrays`: for each head `HEAD/mean`, `/spread`, `/low`, `/high`, `/scale`, and `/w1`, `/b1` to
        `/w3`, `/b3`. Raises AgentError if they do not fit.
        """
        self.arrays: Arrays = {name: np.asarray(value, dtype=np.float32) for name, value in arrays.items()}
        try:
            self._heads = [_Head(self.arrays, head) for head in HEADS]
        except KeyError as error:
            raise AgentError(f"the residual predictor lacks {error}") from None
        for head, named in zip(self._heads, (VEHICLE, ROAD), strict=True):
            if head.inputs != len(named):
                raise AgentError(f"the residual predictor takes {head.inputs} features, not {len(named)}")

    def __call__(self, scene: Scene, constraints: Constraints, u_rl: Array) -> Array:
        """(K,) m2 per step, w of all constraints for the proposed action (2,), m/s2 and rad."""
        parts = features(scene, constraints, u_rl)
        return np.concatenate([head(xi) for head, xi in zip(self._heads, parts, strict=True)])

    def of(self, head: str, xi: Array) -> Array:
        """(n,) m2 per step, w from features (n, F) of one head."""
        return self._heads[HEADS.index(head)](xi)


class _Head:
    """One network; the inputs' scaling is part of its first layer."""

    def __init__(self, arrays: Mapping[str, NDArray], head: str) -> None:
        mean, spread = arrays[f"{head}/mean"], arrays[f"{head}/spread"]
        first = arrays[f"{head}/w1"] / spread[:, None]
        self.inputs = len(mean)
        self._low, self._high = arrays[f"{head}/low"], arrays[f"{head}/high"]
        self._layers: list[tuple[NDArray, NDArray]] = [
            (first, arrays[f"{head}/b1"] - mean @ first),
            (arrays[f"{head}/w2"], arrays[f"{head}/b2"]),
        ]
        scale = np.float32(arrays[f"{head}/scale"])
        self._last = arrays[f"{head}/w3"][:, 0] * scale, np.float32(arrays[f"{head}/b3"][0]) * scale

    def __call__(self, xi: Array) -> Array:
        x: NDArray = np.minimum(np.maximum(xi.astype(np.float32), self._low), self._high)
        for weight, bias in self._layers:
            x = _gelu(x @ weight + bias)
        tail, offset = self._last
        return (x @ tail + offset).astype(np.float64)


def _gelu(x: NDArray) -> NDArray:
    """GELU with the tanh approximation."""
    inner = np.float32(0.7978845608) * (x + np.float32(0.044715) * x * x * x)
    return np.float32(0.5) * x * (np.float32(1) + np.tanh(inner))


def load_predictor(path: Path) -> ResidualPredictor:
    """A predictor from its file, or from the folder it is in. Raises AgentError."""
    file = path / FILE if path.is_dir() else path
    try:
        return ResidualPredictor(load_file(file))
    except FileNotFoundError:
        raise AgentError(f"no residual predictor in {path}: `rudc residual fit` makes one") from None
    except (OSError, SafetensorError) as error:
        raise AgentError(f"{file} is no residual predictor: {error}") from None


@lru_cache(maxsize=1)
def shipped_predictor() -> ResidualPredictor:
    """The one that comes with RUDC."""
    return load_predictor(data_folder(SHIPPED))
