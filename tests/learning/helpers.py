"""Shared by the tests of the learning core: small networks, random observations and batches."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch

from rudc.learning.batch import Batch
from rudc.learning.config import EnsembleConfig, NetworkConfig, ObservationLayout, Problem

SMALL = NetworkConfig(hidden=24, embedding=8, waypoint_embedding=6, heads=2, hops=2)


SMALL_MLP = NetworkConfig(encoder="mlp", hidden=24)
CPU = torch.device("cpu")


class Case(NamedTuple):
    """A learner's settings, and what it is given."""

    config: EnsembleConfig
    problem: Problem


def small_case(
    layout: ObservationLayout | None = None,
    actions: int = 2,
    seed: int = 0,
    updates: int = 100_000,
    **changes: object,
) -> Case:
    """Attention networks of a few units on the paper's observation with 4 conflict features."""
    values: dict[str, object] = {"policy": SMALL, "critic": SMALL, "members": 3, "quantiles": 8}
    problem = Problem(layout or ObservationLayout(conflict=4), actions, seed, updates)
    return Case(EnsembleConfig.model_validate(values | changes), problem)


TOY = Problem(ObservationLayout(ego=2, vehicles=0, waypoints=0, task=0), actions=1)
"""two plain numbers, one action"""


def toy_case(updates: int = 100_000, **changes: object) -> Case:
    """Networks of 32 x 2 on it."""
    network = NetworkConfig(encoder="mlp", hidden=32)
    values: dict[str, object] = {"policy": network, "critic": network, "members": 3}
    return Case(EnsembleConfig.model_validate(values | changes), replace(TOY, updates=updates))


def quick_case(**changes: object) -> Case:
    """The size that trains on one core: three critics of 128 x 2 on all features."""
    network = NetworkConfig(encoder="mlp", hidden=128)
    values: dict[str, object] = {"policy": network, "critic": network, "members": 3, "batch_size": 128}
    return Case(EnsembleConfig.model_validate(values | changes), Problem(ObservationLayout(conflict=41)))


def observations(layout: ObservationLayout, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, size) random observations, some SVs absent."""
    flat = rng.normal(size=(count, layout.size)).astype(np.float32)
    rows = flat[:, layout.vehicles_at].reshape(count, layout.vehicles, layout.vehicle)
    rows[..., 0] = rng.random((count, layout.vehicles)) < 0.7
    rows *= rows[..., :1]
    flat[:, layout.vehicles_at] = rows.reshape(count, -1)
    return flat


def random_batch(case: Case, count: int, seed: int = 0) -> Batch:
    """Transitions of no meaning."""
    rng, problem = np.random.default_rng(seed), case.problem

    def floats(*shape: int) -> np.ndarray:
        return rng.normal(size=shape).astype(np.float32)

    return Batch(
        observation=observations(problem.layout, count, rng),
        executed=np.tanh(floats(count, problem.actions)),
        proposed=np.tanh(floats(count, problem.actions)),
        reward=10 * floats(count),
        cost=np.abs(floats(count)),
        discount=np.full(count, 0.97, np.float32),
        next_observation=observations(problem.layout, count, rng),
        terminal=rng.random(count) < 0.2,
        mask=rng.random((count, getattr(case.config, "members", 0))) < 0.8,
    )
