"""Weights of a stack of networks of one architecture: shapes, initial values, names. Needs numpy only.

A stack of N networks keeps each weight as one array with the member as leading axis, `NAME.weight` (N,
inputs, outputs) and `NAME.bias` (N, 1, outputs), so that a layer of all members is one batched product. What
each weight is for stands in networks.py. Each member draws from a generator of its own, default_rng([seed,
*salt, member]): its weights depend neither on how many members there are nor on the machine, and a frozen
prior is rebuilt from its seed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rudc.agents.learning.config import NetworkConfig, ObservationLayout

Floats = NDArray[np.float32]
Arrays = dict[str, Floats]

TRAINED_GAIN = 1 / math.sqrt(3)
"""standard deviation of a trained weight times sqrt(inputs): that of torch.nn.Linear; outputs start near zero
"""
PRIOR_GAIN = 1.5
"""the same for priors: GELU layers then keep the variance of their input, and priors vary over states"""


def shapes(
    layout: ObservationLayout, network: NetworkConfig, actions: int, outputs: int
) -> dict[str, tuple[int, int]]:
    """(inputs, outputs) of each linear map of one network; `actions` is 0 for a policy."""
    hidden, width = network.hidden, network.embedding
    maps: dict[str, tuple[int, int]] = {}
    if network.encoder == "attention":
        maps["ego"] = (layout.ego + layout.task, width)
        for layer in range(network.vehicle_layers):
            maps[f"vehicle{layer}"] = (width if layer else layout.vehicle, width)
        for hop in range(network.hops):
            maps[f"look{hop}"] = (width, network.heads * width)
            maps[f"take{hop}"] = (network.heads * width, width)
        maps["waypoint"] = (layout.waypoint, network.waypoint_embedding)
        maps["attention_to_waypoints"] = (1, layout.waypoints)
        if layout.conflict:
            maps["conflict"] = (layout.conflict, width)
        maps["fuse"] = (width * (2 if layout.conflict else 1) + network.waypoint_embedding, hidden)
    else:
        maps["fuse"] = (layout.size, hidden)
    if actions:
        maps["action"] = (actions, hidden)
    maps["hidden"] = (hidden, hidden)
    maps["out"] = (hidden, outputs)
    return maps


def without_bias(name: str) -> bool:
    """Maps that need no bias: part of another sum, a score, or of rows whose first number, validity, is always 1."""
    return name in ("action", "attention_to_waypoints", "vehicle0") or name.startswith("look")


def initial(
    maps: Mapping[str, tuple[int, int]], members: int, seed: tuple[int, ...], gain: float = TRAINED_GAIN
) -> Arrays:
    """Initial weights of `members` networks, uniform with standard deviation gain / sqrt(inputs)."""
    parts = [_one(maps, np.random.default_rng([*seed, member]), gain) for member in range(members)]
    return {name: np.stack([part[name] for part in parts]) for name in parts[0]}


def _one(maps: Mapping[str, tuple[int, int]], rng: np.random.Generator, gain: float) -> Arrays:
    arrays: Arrays = {}
    for name, (inputs, outputs) in maps.items():
        bound = gain * math.sqrt(3 / inputs)
        arrays[f"{name}.weight"] = _uniform(rng, bound, (inputs, outputs))
        if not without_bias(name):
            arrays[f"{name}.bias"] = _uniform(rng, bound, (1, outputs))
    return arrays


def _uniform(rng: np.random.Generator, bound: float, shape: tuple[int, int]) -> Floats:
    return ((2 * rng.random(shape) - 1) * bound).astype(np.float32)


def waypoint_positions(waypoints: int, width: int) -> Floats:
    """Sinusoidal positional encoding of the waypoints' order, (waypoints, width)."""
    position = np.arange(waypoints)[:, None]
    rate = np.exp(-math.log(100.0) * (np.arange(width) // 2 * 2) / width)
    angle = position * rate
    return np.where(np.arange(width) % 2 == 0, np.sin(angle), np.cos(angle)).astype(np.float32)


def fingerprint(arrays: Mapping[str, Floats]) -> str:
    """Short digest of weights, by which a rebuilt prior is recognised as the one trained with."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode() + np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()[:16]
