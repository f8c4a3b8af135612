"""Mixtures of normal distributions, from which points are drawn, and how one is fitted to violations."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from rudc.arrays import Array

DOUBT = 3
"""d + DOUBT is the number of violations that the declared covariance counts for in that of a group"""
MOST = 500
"""violations that a mixture is fitted to, evenly taken from all"""
MOST_LOG = 300.0
"""largest logarithm of a density over the declared one: beyond it, squares of weights would become 0"""


class Part(NamedTuple):
    """One normal distribution of a mixture."""

    share: float
    """share of the mixture's points that it gives"""
    mean: Array
    """(d,)"""
    spread: Array
    """(d, d), covariance"""


class Proposal(NamedTuple):
    """What a number of points are drawn from."""

    number: int
    parts: tuple[Part, ...]
    """shares sum to 1"""

    def drawn(self, rng: np.random.Generator) -> Array:
        """Points z (number, d)."""
        chosen = rng.choice(len(self.parts), size=self.number, p=[part.share for part in self.parts])
        z = rng.standard_normal((self.number, len(self.parts[0].mean)))
        for k, (_, mean, spread) in enumerate(self.parts):
            z[chosen == k] = mean + z[chosen == k] @ np.linalg.cholesky(spread).T
        return z

    def density(self, z: Array) -> Array:
        """At points z (n, d): number times the mixture's density, over the declared density N(0, I)."""
        found = np.zeros(len(z))
        for share, mean, spread in self.parts:
            factor = np.linalg.cholesky(spread)
            away = np.linalg.solve(factor, (z - mean).T)
            log_ratio = 0.5 * (np.sum(z**2, axis=1) - np.sum(away**2, axis=0))
            found += share * np.exp(np.minimum(log_ratio - np.sum(np.log(np.diag(factor))), MOST_LOG))
        return self.number * found


def as_declared(count: int, keys: int) -> Proposal:
    """N(0, I) of `keys` dimensions."""
    return Proposal(count, (Part(1.0, np.zeros(keys), np.eye(keys)),))


def fitted(count: int, points: Array, weights: Array) -> Proposal:
    """A mixture with two normal distributions for each group of violations: points (n, d), n >= 1, weights
    (n,). One has the group's mean and covariance; the other its mean and I, so that no violation beside the
    known ones is drawn much more seldom than it is declared.

    Groups are as far apart as two points of N(0, I) are in the mean square, sqrt(2 d) (single linkage). Means
    and covariances count each violation by its weight, and covariances are shrunk towards I, which counts as
    much as d + DOUBT violations. Half of the points go to groups by weight, half to all alike, so that rare
    ones are seen, too.
    """
    step = math.ceil(len(points) / MOST)
    points, weights = points[::step], weights[::step]
    groups = np.ones(1, int)
    if len(points) > 1:
        groups = fcluster(linkage(points, "single"), math.sqrt(2.0 * points.shape[1]), "distance")
    members = [groups == group for group in np.unique(groups)]
    parts: list[Part] = []
    for those in members:
        share = 0.5 * float(weights[those].sum() / weights.sum()) + 0.5 / len(members)
        mean, spread = _moments(points[those], weights[those])
        parts += [Part(0.5 * share, mean, spread), Part(0.5 * share, mean, np.eye(len(mean)))]
    return Proposal(count, tuple(parts))


def _moments(points: Array, weights: Array) -> tuple[Array, Array]:
    """Mean and covariance of one group."""
    share = weights / weights.sum()
    mean = share @ points
    apart = points - mean
    keys = points.shape[1]
    effective, doubt = 1.0 / float(np.sum(share**2)), keys + DOUBT
    spread = effective * (share[:, None] * apart).T @ apart + doubt * np.eye(keys)
    return mean, spread / (effective + doubt)
