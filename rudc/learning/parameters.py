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

from rudc.arrays import Arrays, Floats
from rudc.learning.config import (
    EnsembleConfig,
    LearnerConfig,
    NetworkConfig,
    ObservationLayout,
    Problem,
)

TRAINED_GAIN = 1 / math.sqrt(3)
"""standard deviation of a trained weight times sqrt(inputs): that of torch.nn.Linear; outputs start small"""
SCORE_BOUND = 30.0
"""largest attention score; exp of it is far from overflowing in float32"""
OUTPUT_GAIN = 0.1
"""factor on the initial weights of a policy's last map, so that it explores around zero with the configured
spread"""
PRIOR_GAIN = 1.5
"""as TRAINED_GAIN, for priors: GELU layers then keep the variance of their input, and priors vary over
states"""


def shapes(
    layout: ObservationLayout, network: NetworkConfig, actions: int, outputs: int
) -> dict[str, tuple[int, int]]:
    """(inputs, outputs) of each linear map of one network; `actions` is 0 for a policy."""
    hidden, width = network.hidden, network.embedding
    maps: dict[str, tuple[int, int]] = {}
    if network.encoder == "attention":
        if not (layout.vehicles and layout.waypoints):
            raise ValueError("encoder 'attention' needs vehicles and waypoints in the observation")
        maps["ego"] = (layout.ego + layout.task, width)
        for layer in range(network.vehicle_layers):
            maps[f"vehicle{layer}"] = (width if layer else layout.vehicle, width)
        for hop in range(network.hops):
            maps[f"look{hop}"] = (width, network.heads * width)
            maps[f"take{hop}"] = (network.heads * width, width)
        maps["waypoint"] = (layout.waypoint, network.waypoint_embedding)
        maps["importance"] = (layout.waypoints, network.waypoint_embedding)
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
    """Maps without bias: parts of a sum, scores, and those of rows whose first number, validity, is 1."""
    return name in ("action", "importance", "vehicle0") or name.startswith("look")


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


CRITIC, PRIOR, POLICY, COST, MULTIPLIER, RECOVERY, CHANGE = range(1, 8)
"""tags that keep the generators of the groups apart"""
TWINS = 2
"""critics where there is no ensemble"""


def critic_arrays(config: EnsembleConfig, problem: Problem) -> Arrays:
    """Initial weights of the trained networks o_n of an ensemble of quantile critics (see ensemble.py)."""
    return initial(_quantile_shapes(config, problem), config.members, (problem.seed, CRITIC))


def twin_arrays(config: LearnerConfig, problem: Problem, tag: int = CRITIC, outputs: int = 1) -> Arrays:
    """Initial weights of two critics of so many outputs each (see twins.py)."""
    maps = shapes(problem.layout, config.critic, problem.actions, outputs)
    return initial(maps, TWINS, (problem.seed, tag))


def prior_arrays(config: EnsembleConfig, problem: Problem) -> Arrays:
    """Weights of the frozen networks f_n, rebuilt from the seed; none if rho is 0."""
    if config.prior_factor == 0:
        return {}
    return initial(_quantile_shapes(config, problem), config.members, (problem.seed, PRIOR), PRIOR_GAIN)


def normalised(prior: Arrays, rms: Floats) -> Arrays:
    """The networks f / rms, by the weights of their last map; rms (N, 1, 1)."""
    return {**prior, **{name: prior[name] / rms for name in ("out.weight", "out.bias")}}


def frozen_arrays(config: LearnerConfig, problem: Problem, stored: Mapping[str, Floats]) -> Arrays:
    """What is frozen in training and therefore not stored, named `prior/...`: rebuilt from the seed, and
    normalised with what is stored (`normal/...`). Priors of older agents are not normalised. {} without
    priors.
    """
    if not isinstance(config, EnsembleConfig):
        return {}
    prior, normal = prior_arrays(config, problem), group(stored, "normal")
    return grouped(prior=normalised(prior, **normal) if prior and normal else prior)


def observer_arrays(network: NetworkConfig, problem: Problem, tag: int, outputs: int) -> Arrays:
    """Initial weights of a network of the observation alone, a stack of one, whose outputs start small."""
    arrays = initial(shapes(problem.layout, network, 0, outputs), 1, (problem.seed, tag))
    arrays["out.weight"] *= np.float32(OUTPUT_GAIN)
    arrays["out.bias"][:] = 0.0
    return arrays


def policy_arrays(config: LearnerConfig, problem: Problem, tag: int = POLICY) -> Arrays:
    """Initial weights of the policy, a stack of one."""
    arrays = observer_arrays(config.policy, problem, tag, 2 * problem.actions)
    arrays["out.bias"][..., problem.actions :] = config.initial_log_std
    return arrays


def _quantile_shapes(config: EnsembleConfig, problem: Problem) -> dict[str, tuple[int, int]]:
    return shapes(problem.layout, config.critic, problem.actions, config.quantiles)


def grouped(**groups: Mapping[str, Floats]) -> Arrays:
    """Arrays of several networks as one mapping, named `GROUP/NAME`."""
    return {f"{group}/{name}": value for group, arrays in groups.items() for name, value in arrays.items()}


def group(arrays: Mapping[str, Floats], name: str) -> Arrays:
    """The arrays of one network, by its `GROUP`; empty if there are none."""
    return {key.removeprefix(f"{name}/"): v for key, v in arrays.items() if key.startswith(f"{name}/")}


def fingerprint(arrays: Mapping[str, Floats]) -> str:
    """Short digest of weights, by which a rebuilt prior is recognised as the one trained with."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode() + np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()[:16]
