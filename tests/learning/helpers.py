"""Shared by the tests of the learning core: small networks, random observations and batches."""

import numpy as np

from rudc.learning.batch import Batch
from rudc.learning.config import LearnerConfig, NetworkConfig, ObservationLayout

SMALL = NetworkConfig(hidden=24, embedding=8, waypoint_embedding=6, heads=2, hops=2)


def small_config(**changes: object) -> LearnerConfig:
    """Attention networks of a few units on the paper's observation with 4 conflict features."""
    values: dict[str, object] = {
        "layout": ObservationLayout(conflict=4),
        "policy": SMALL,
        "critic": SMALL,
        "members": 3,
        "quantiles": 8,
    }
    return LearnerConfig.model_validate(values | changes)


def toy_config(**changes: object) -> LearnerConfig:
    """Networks of 32 x 2 on two plain numbers, one action."""
    network = NetworkConfig(encoder="mlp", hidden=32)
    values: dict[str, object] = {
        "layout": ObservationLayout(ego=2, vehicles=0, waypoints=0, task=0),
        "actions": 1,
        "policy": network,
        "critic": network,
        "members": 3,
    }
    return LearnerConfig.model_validate(values | changes)


def observations(layout: ObservationLayout, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, size) random observations, some SVs absent."""
    flat = rng.normal(size=(count, layout.size)).astype(np.float32)
    rows = flat[:, layout.vehicles_at].reshape(count, layout.vehicles, layout.vehicle)
    rows[..., 0] = rng.random((count, layout.vehicles)) < 0.7
    rows *= rows[..., :1]
    flat[:, layout.vehicles_at] = rows.reshape(count, -1)
    return flat


def random_batch(config: LearnerConfig, count: int, seed: int = 0) -> Batch:
    """Transitions of no meaning."""
    rng = np.random.default_rng(seed)

    def floats(*shape: int) -> np.ndarray:
        return rng.normal(size=shape).astype(np.float32)

    return Batch(
        observation=observations(config.layout, count, rng),
        action=np.tanh(floats(count, config.actions)),
        nominal=np.tanh(floats(count, config.actions)),
        reward=10 * floats(count),
        discount=np.full(count, 0.97, np.float32),
        next_observation=observations(config.layout, count, rng),
        terminal=rng.random(count) < 0.2,
        mask=rng.random((count, config.members)) < 0.8,
    )
