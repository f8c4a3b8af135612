"""Where a search looks next.

A point z (d,) has a number for each searched key; the key's value is the quantile Phi(z) of its
distribution, so that episodes as declared are z ~ p = N(0, I). A third of each batch is drawn
- as declared, from p;
- by CMA-ES (the library `cma`), which minimises the episode's least gap (m); violations rank below all gaps,
  the likelier ones lowest. It starts as p. Where it converges or has found a violation, it starts anew, far
  from all known violations;
- from a mixture of normal distributions that is fitted to the violations (`proposal.py`; the cross-entropy
  method). Until ENOUGH violations are known, CMA-ES has this third, too, and goes on where it violates.

With q the density of all parts of its batch together, each episode counts as

    w(z) = p(z) / q(z)  <=  3

episodes drawn as declared (the balance heuristic). Since q depends on earlier batches alone, the mean of
w [violation] is without bias for the rate in each batch. Weights from all batches at once (adaptive multiple
importance sampling) scatter less but are not: with five keys the rate came out at 0.6 of the true one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rudc.arrays import Array, Flags
from rudc.errors import InputError
from rudc.evaluation.search.proposal import Part, Proposal, as_declared, fitted
from rudc.hints import install_command

BATCH = 24
"""episodes that are proposed together, before their results are looked at"""
ENOUGH = 5
"""violations from which on a mixture is fitted to them"""
STARTS = 10
"""points drawn from p; CMA-ES starts anew at the one farthest from all violations"""
FAR_M = 100.0
"""m, gap of an episode that met nobody"""


class Batch(NamedTuple):
    """Points to be tried together."""

    z: Array
    """(n, d)"""
    weights: Array
    """(n,): density as declared over density as drawn"""
    fitted: bool
    """whether a third was drawn where violations are known"""


class Sampler:
    """Proposes batches of points and learns from how they ended; the same seed and answers give the same."""

    def __init__(self, keys: int, seed: int) -> None:
        """keys: d, at least one. Raises InputError where `cma` is not installed."""
        self._rng = np.random.default_rng((seed, keys))
        self._keys = keys
        self._known = np.empty((0, keys))
        """violations"""
        self._weights = np.empty(0)
        """weights of the violations"""
        self._cma_points = 0
        self._cma = self._started(np.zeros(keys), BATCH - _third(BATCH))

    def ask(self, count: int = BATCH) -> Batch:
        """The next points; `tell` must get their results, unless they are the last. Fewer than a batch are
        the batch's first ones, weighted by what these were drawn from: so a search of more episodes asks for
        the same points.
        """
        plain, rest = _third(BATCH), BATCH - _third(BATCH)
        parts = [as_declared(plain, self._keys)]
        self._cma_points = rest
        if self._enough:
            self._cma_points = rest // 2
            parts.append(fitted(rest - rest // 2, self._known, self._weights))
        spread = self._cma.sigma**2 * np.array(self._cma.C)
        parts.append(Proposal(self._cma_points, (Part(1.0, np.array(self._cma.mean), spread),)))
        z = np.concatenate([part.drawn(self._rng) for part in parts])[:count]
        left, density = count, np.zeros(count)
        for part in parts:
            taken = min(part.number, left)
            density += part._replace(number=taken).density(z)
            left -= taken
        return Batch(z, count / density, self._enough)

    def tell(self, batch: Batch, violated: Flags, gaps: Array) -> None:
        """How a whole batch ended: violated (n,), and least gaps (n,) in m, nan where nobody was met."""
        self._known = np.concatenate([self._known, batch.z[violated]])
        self._weights = np.concatenate([self._weights, batch.weights[violated]])
        ours = slice(len(violated) - self._cma_points, None)
        z = batch.z[ours]
        likelier = -1.0 / (1.0 + 0.5 * np.sum(z**2, axis=1))
        values = np.where(violated[ours], likelier, np.nan_to_num(gaps[ours], nan=FAR_M))
        self._cma.ask()  # its protocol; the points are ours, whose density is known
        self._cma.tell(list(z), values.tolist())
        reached = self._enough and (violated[ours].any() or len(z) != _third(BATCH))
        if reached or self._cma.stop():
            points = _third(BATCH) if self._enough else BATCH - _third(BATCH)
            self._cma = self._started(self._elsewhere(), points)

    def _elsewhere(self) -> Array:
        """(d,) of several points of p, the one farthest from all violations."""
        tried = self._rng.standard_normal((STARTS, self._keys))
        if not len(self._known):
            return tried[0]
        away = np.linalg.norm(tried[:, None] - self._known, axis=2)
        return tried[np.argmax(away.min(axis=1))]

    @property
    def _enough(self) -> bool:
        return len(self._known) >= ENOUGH

    def _started(self, mean: Array, points: int) -> Any:
        try:
            import cma
        except ImportError:
            raise InputError(
                f"searching needs cma (the extra `search`): {install_command('search')}"
            ) from None
        options = {
            "popsize": points,
            "seed": math.nan,
            "randn": lambda *shape: np.zeros(shape),
            "verbose": -9,
        }
        return cma.CMAEvolutionStrategy(mean, 1.0, options)


def _third(count: int) -> int:
    return math.ceil(count / 3)
