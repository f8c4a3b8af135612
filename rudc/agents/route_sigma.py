"""sigma by route: how unsure the critics are, compared with what is usual where the ego is on its route.

Most of sigma says how much the return still varies from here on. That depends on the place on the route
and is the same at every visit, whatever happens there (results/README.md). What is left when this part is
taken out says more about the situation. With x the place,

    log sigma    = f(x) + e       f is fitted to the decisions of the final policy in distribution
    sigma(route) = sigma exp(mean f - f(x))

sigma(route) is the sigma that the decision would have at an average place. It is still in reward units;
sigma_l and sigma_h are the percentiles of sigma(route) itself. f is linear between knots,

    f(x) = stop[task, priority](way of the front bumper to the stop line) + go(way to the destination)

and fitted by ridge regression: a part that all tasks and priorities share, and a deviation for each,
which has a larger price. Beyond the outer knots f is constant. sigma_epi, sigma_ale and sigma_total have
an f each. Percentiles are taken out of sample: for each fifth of the episodes, f is fitted to the other
episodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rudc.agents.kernels import two_way
from rudc.arrays import Array, Arrays, Index
from rudc.errors import AgentError
from rudc.learning.parameters import group
from rudc.learning.uncertainty import PERCENTILES, Uncertainty
from rudc.world.scene import Scene

ROUTE = "route"
"""beginning of the names of these arrays in a checkpoint"""
STOP = np.array([-40, -30, -25, -20, -15, -10, -5, 0, 5, 10, 15, 20, 25, 30, 40], dtype=float)
"""m before the stop line (negative: beyond it), knots"""
GO = np.array([0, 5, 10, 15, 20, 30, 40, 60, 80], dtype=float)
"""m to the destination, knots"""
TASKS, PRIORITIES = 3, 2
SHARED_PRICE, OWN_PRICE = 1.0, 20.0
"""prices of the ridge, in decisions: for the shared part, and for the deviations of a task or a priority"""
FOLDS = 5
LEAST = 1e-9
"""reward units; a smaller sigma counts as this, since it has no useful logarithm"""


class Place(NamedTuple):
    """Where the ego is on its route; floats, or arrays of one shape."""

    stop: Array | float
    """m from the front bumper to the stop line, negative beyond it"""
    go: Array | float
    """m to the destination"""
    task: Index | int
    """0 left, 1 straight, 2 right"""
    major: Index | int
    """1 on an arm with priority, else 0"""


class Heard(NamedTuple):
    """What an agent stated in the n decisions of an episode."""

    places: Array
    """(n, 4) `Place`, a row each"""
    sigmas: Array
    """(n, 3) sigma_epi, sigma_ale, sigma_total, reward units"""
    succeeded: bool = True
    """whether the episode ended in success"""


def place_of(scene: Scene) -> Place:
    """The place of the scene's ego."""
    route = scene.route
    return Place(route.stop_line_s - scene.front_s, scene.goal_s - scene.ego_s, route.task, int(route.major))


class RouteSigma:
    """The fitted functions f, and sigma by route."""

    def __init__(self, arrays: Mapping[str, NDArray]) -> None:
        """`arrays`: as `fit` returns them. Raises AgentError if their names or shapes differ from that."""
        wanted = {"stop": (3, TASKS, PRIORITIES, len(STOP)), "go": (3, len(GO)), "percentiles": (2,)}
        found = {name: np.asarray(value).shape for name, value in arrays.items()}
        if found != wanted:
            raise AgentError(f"what is usual along the route is stored as {found}, not as {wanted}")
        self._stop, self._go = (np.asarray(arrays[name], dtype=float) for name in ("stop", "go"))
        low, high = (float(v) for v in arrays["percentiles"])
        self.percentiles = (low, high)
        """sigma_l and sigma_h of sigma(route), reward units"""

    @classmethod
    def among(cls, arrays: Mapping[str, NDArray]) -> RouteSigma | None:
        """The fitted functions in a checkpoint's arrays; None if they were never fitted."""
        own = group(arrays, ROUTE)
        return cls(own) if own else None

    def excess(self, place: Place) -> tuple[float, float, float]:
        """(3,) f - mean f at a place, for the logarithms of sigma_epi, sigma_ale and sigma_total."""
        stop, go, task, major = place
        return two_way(float(stop), float(go), STOP, self._stop[:, task, major], GO, self._go)

    def of(self, scene: Scene, unsure: Uncertainty) -> Uncertainty:
        """The uncertainty `unsure` that was stated in a scene, by route; reward units."""
        epistemic, aleatoric, total = self.excess(place_of(scene))
        return Uncertainty(
            unsure.epistemic * math.exp(-epistemic),
            unsure.aleatoric * math.exp(-aleatoric),
            unsure.total * math.exp(-total),
        )

    def of_heard(self, heard: Heard) -> Array:
        """(n, 3) sigma_epi, sigma_ale and sigma_total by route for the decisions of an episode, reward
        units.
        """
        places = (Place(stop, go, int(task), int(major)) for stop, go, task, major in heard.places.tolist())
        return heard.sigmas * np.exp(-np.array([self.excess(place) for place in places]).reshape(-1, 3))


def fit(episodes: Sequence[Heard]) -> Arrays:
    """Arrays (float32) of a `RouteSigma` that is fitted to these episodes."""
    everything = _fitted(episodes)
    low, high = np.percentile(out_of_sample(episodes)[:, 2], PERCENTILES)
    return {
        name: value.astype(np.float32)
        for name, value in {**everything, "percentiles": np.array([low, high])}.items()
    }


def out_of_sample(episodes: Sequence[Heard]) -> Array:
    """(n, 3) sigma(route) of all decisions of the episodes; for each fifth of the episodes, f is fitted
    to the others. A single episode is fitted to itself.
    """
    if len(episodes) < 2:
        return np.concatenate([_made(_fitted(episodes)).of_heard(heard) for heard in episodes])
    found: list[Array] = [np.zeros((0, 3))] * len(episodes)
    for fold in range(min(FOLDS, len(episodes))):
        others = [heard for k, heard in enumerate(episodes) if k % FOLDS != fold]
        fitted = _made(_fitted(others))
        for k in range(fold, len(episodes), FOLDS):
            found[k] = fitted.of_heard(episodes[k])
    return np.concatenate(found)


def explained(episodes: Sequence[Heard]) -> float:
    """Share of the variance of log sigma_total that f explains, out of sample."""
    total = _log(np.concatenate([heard.sigmas for heard in episodes])[:, 2])
    return 1.0 - float(np.var(_log(out_of_sample(episodes)[:, 2])) / max(np.var(total), LEAST))


def _made(arrays: Arrays) -> RouteSigma:
    return RouteSigma({**arrays, "percentiles": np.zeros(2)})


def _fitted(episodes: Sequence[Heard]) -> Arrays:
    """Values of f - mean f at the knots, by ridge regression."""
    places = np.concatenate([heard.places for heard in episodes])
    y = _log(np.concatenate([heard.sigmas for heard in episodes]))
    stop, go = _hats(places[:, 0], STOP), _hats(places[:, 1], GO)
    own = [places[:, 2] == task for task in range(TASKS)] + [places[:, 3] == one for one in range(PRIORITIES)]
    x = np.hstack([stop, go, *(stop * flags[:, None] for flags in own)])
    prices = np.full(x.shape[1], OWN_PRICE)
    prices[: len(STOP) + len(GO)] = SHARED_PRICE
    weights = np.linalg.solve(x.T @ x + np.diag(prices), x.T @ (y - y.mean(axis=0))).T
    ends = np.cumsum([len(STOP), len(GO), *([len(STOP)] * (TASKS + PRIORITIES - 1))])
    shared, far, *deviations = np.split(weights, ends, axis=1)
    by_task, by_priority = np.stack(deviations[:TASKS], 1), np.stack(deviations[TASKS:], 1)
    values = shared[:, None, None] + by_task[:, :, None] + by_priority[:, None]
    return {"stop": values, "go": far}


def _hats(x: Array, knots: Array) -> Array:
    """(n, K) weights of the K knots for linear interpolation at x (n,), constant beyond the outer ones."""
    x = np.clip(x, knots[0], knots[-1])
    right = np.clip(np.searchsorted(knots, x), 1, len(knots) - 1)
    share = (x - knots[right - 1]) / (knots[right] - knots[right - 1])
    hats = np.zeros((len(x), len(knots)))
    rows = np.arange(len(x))
    hats[rows, right - 1], hats[rows, right] = 1.0 - share, share
    return hats


def _log(sigmas: Array) -> Array:
    return np.log(np.maximum(sigmas, LEAST))
