"""Learning the residual predictor, and measuring it (paper, Tab. "Hyper-Parameters", Appx. "Validation").

Huber loss by Adam of (prediction - w) / unit, with

    unit = std(w)                        road edges
    unit = |r| median(|w| / |r|)         vehicles, r from the ego to the vehicle

h is a squared distance: an error of a vehicle's position counts 2 |r| times as many m2, but rows are active
where |r| is small. Beside a standing car, an error of 0.01 m2 is enough to hold a standing ego for good. And
nobody can foresee that one of SUMO's vehicles changes lanes within a step, which can change h by 100 m2;
squared errors of that size would hide all others, hence the Huber loss. Every tenth episode is held out as a
whole, since samples of one episode resemble each other. The scores say how well the change of h itself is
predicted, by the model alone and with the predictor, and how much of w is explained.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rudc.arrays import Arrays, Flags, Floats
from rudc.errors import InputError
from rudc.learning.threads import torch_threads
from rudc.safety.residual import ResidualPredictor, heads
from rudc.training.residual_data import Dataset, Samples
from rudc.world.scene import STANDING

HIDDEN = 64
EPOCHS, BATCH, RATE = 300, 4096, 3e-4
HOLD_OUT = 10
"""one episode in so many is held out"""
NEAREST = 1.0
"""m, smaller distances count as this when errors are weighed"""
BEYOND = 0.1
"""share of each feature's range in the samples by which it may lie outside before it is clipped"""


class Score(NamedTuple):
    """How well a change of h over one step is predicted, on held-out samples."""

    r2: float
    """share of the change's variance that is explained"""
    mae: float
    """m2"""
    rmse: float
    """m2"""


class Evaluation(NamedTuple):
    """Scores of one head, on all samples or some."""

    about: str
    """a head, or which of its samples"""
    samples: int
    model: Score
    """the filter's model alone, w = 0"""
    predictor: Score
    """with the predictor"""
    explained: float
    """share of the variance of w that the predictor explains"""


def held_out(dataset: Dataset, head: str, *, rest: bool = False) -> Samples:
    """A head's samples of held-out episodes, or the others. Raises InputError where there are none to speak
    of.
    """
    samples = dataset[head]
    chosen = _chosen(samples, (samples.episode % HOLD_OUT == 0) != rest)
    if len(chosen.w) < 2:  # a single sample has no spread
        part = "learnt from" if rest else "held out"
        raise InputError(
            f"too few samples: of the {len(samples.w)} of head {head!r}, {len(chosen.w)} are of episodes "
            f"that are {part} (every {HOLD_OUT}th is held out); collect more: rudc residual "
            "collect --samples N"
        )
    return chosen


def standing(vehicles: Samples) -> Samples:
    """Those of vehicles that stand near an ego that stands, within 10 m."""
    drift = np.hypot(
        _feature(vehicles, "its speed ahead / 10"), _feature(vehicles, "its speed to the left / 10")
    )
    slow = np.maximum(_feature(vehicles, "speed / 10"), drift) < STANDING / 10
    return _chosen(vehicles, slow & (_distance(vehicles) < 10))


def _feature(vehicles: Samples, name: str) -> Floats:
    """(M,) one of a vehicle's features."""
    return vehicles.xi[:, heads()["vehicle"].index(name)]


def _distance(vehicles: Samples) -> Floats:
    """(M,) m, |r| from the ego."""
    return 20 * _feature(vehicles, "distance / 20")


def _chosen(samples: Samples, which: Flags) -> Samples:
    return Samples(samples.xi[which], samples.change[which], samples.w[which], samples.episode[which])


def fit(
    dataset: Dataset,
    seed: int,
    epochs: int = EPOCHS,
    progress: Callable[[str, int, float], None] | None = None,
) -> ResidualPredictor:
    """Learn both heads. `progress` is told head, epoch and loss. Raises InputError for samples of so few
    episodes that none are left to learn from, or to be held out.
    """
    for head in dataset:
        held_out(dataset, head)
    parts = [(head, held_out(dataset, head, rest=True)) for head in dataset]
    arrays: Arrays = {}
    with torch_threads(1):  # for layers this small, more gain nothing
        for number, (head, samples) in enumerate(parts):
            arrays |= _fit(samples, head, (seed, number), epochs, progress)
    return ResidualPredictor(arrays)


def evaluate(dataset: Dataset, predictor: ResidualPredictor, *, only_held_out: bool) -> list[Evaluation]:
    """Scores of both heads, on the held-out episodes or on all; then of standing vehicles near a standing
    ego, if any. Raises InputError where too few are held out.
    """
    parts = [(head, head, held_out(dataset, head) if only_held_out else dataset[head]) for head in dataset]
    still = standing(parts[0][2])
    if len(still.w) > 1:
        parts.append(("vehicle, both standing", "vehicle", still))
    return [
        _measure(about, samples, predictor.of(head, samples.xi.astype(np.float64)))
        for about, head, samples in parts
    ]


def _measure(about: str, samples: Samples, expected: NDArray) -> Evaluation:
    """`expected`: (M,) m2, the w that was predicted."""
    w = samples.w.astype(np.float64)
    model, predictor = _score(samples.change, w), _score(samples.change, w - expected)
    return Evaluation(about, len(w), model, predictor, _explained(w - expected, w))


def _score(change: NDArray, error: NDArray) -> Score:
    explained = _explained(error, change.astype(np.float64))
    return Score(explained, float(np.mean(np.abs(error))), float(np.sqrt(np.mean(error**2))))


def _explained(error: NDArray, of: NDArray) -> float:
    """R2: 1 - (sum of squares of `error`) / (sum of squares of `of` about its mean), both (M,); nan where all
    of `of` are equal.
    """
    spread = float(np.sum((of - of.mean()) ** 2))
    return 1.0 - float(np.sum(error**2)) / spread if spread else math.nan


def _fit(
    samples: Samples,
    head: str,
    seed: tuple[int, int],
    epochs: int,
    progress: Callable[[str, int, float], None] | None,
) -> Arrays:
    rng = np.random.default_rng((*seed, 78))
    mean, spread = samples.xi.mean(axis=0), np.maximum(samples.xi.std(axis=0), 1e-3)
    unit = np.maximum(_unit(samples, head), 1e-9)
    scale = unit.mean()
    x = torch.from_numpy((samples.xi - mean) / spread)
    y, weight = torch.from_numpy(samples.w / unit), torch.from_numpy(scale / unit)
    weights = _initial(x.shape[1], rng)
    adam = torch.optim.Adam(weights.values(), lr=RATE)
    for epoch in range(epochs):
        order, total = torch.from_numpy(rng.permutation(len(y))), 0.0
        for rows in order.split(BATCH):
            loss = torch.nn.functional.huber_loss(_predict(weights, x[rows]) * weight[rows], y[rows])
            adam.zero_grad()
            loss.backward()
            adam.step()
            total += float(loss.detach()) * len(rows)
        if progress is not None:
            progress(head, epoch + 1, total / len(y))
    learnt = {name: weight.detach().numpy().copy() for name, weight in weights.items()}
    learnt |= {"mean": mean, "spread": spread, "scale": np.array(scale)}
    low, high = samples.xi.min(axis=0), samples.xi.max(axis=0)
    learnt |= {"low": low - BEYOND * (high - low), "high": high + BEYOND * (high - low)}
    return {f"{head}/{name}": value.astype(np.float32) for name, value in learnt.items()}


def _unit(samples: Samples, head: str) -> NDArray:
    """(M,) m2, the error that counts as 1 for each sample."""
    if head == "road":
        return np.full(len(samples.w), samples.w.std())
    distance = np.maximum(_distance(samples), NEAREST)
    return distance * np.median(np.abs(samples.w) / distance)


def _initial(inputs: int, rng: np.random.Generator) -> dict[str, Tensor]:
    widths, weights = (inputs, HIDDEN, HIDDEN, 1), {}
    for layer in (1, 2, 3):
        bound = 1.0 / np.sqrt(widths[layer - 1])
        shape = widths[layer - 1], widths[layer]
        for name, drawn in (
            ("w", rng.uniform(-bound, bound, shape)),
            ("b", rng.uniform(-bound, bound, shape[1])),
        ):
            weights[f"{name}{layer}"] = torch.from_numpy(drawn.astype(np.float32)).requires_grad_()
    return weights


def _predict(weights: dict[str, Tensor], x: Tensor) -> Tensor:
    for layer in (1, 2):
        x = torch.nn.functional.gelu(x @ weights[f"w{layer}"] + weights[f"b{layer}"], approximate="tanh")
    return (x @ weights["w3"] + weights["b3"])[:, 0]
