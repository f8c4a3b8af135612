"""How sure the critics are of what follows from an action: sigma_epi, sigma_ale, sigma_total, and their
percentiles.

Paper, Sec. "Ensemble Learning and Uncertainty Quantification": with Z_n the quantiles of member n and tail =
Z_n below its beta quantile,

    sigma_epi   = sqrt( Var_n( E[Z_n | tail] ) )       members disagree about the tail's mean, CVaR_beta
    sigma_ale   = sqrt( mean_n( Var[Z_n | tail] ) )    spread within the tail of each
    sigma_total = sqrt( sigma_epi^2 + sigma_ale^2 )    law of total variance, taken within the tail

Var_n is the variance of the N members themselves (division by N), as the law of total variance has it, and a
quantile counts with its share of the tail (CVaR's weight), so that beta need not be a multiple of 1 / N_q.
The tail is that of the sorted quantiles: where learnt quantiles are out of order, sorting gives the
distribution that they stand for. All are in units of reward.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rudc.arrays import Array, Arrays
from rudc.learning.distortion import make_distortion
from rudc.learning.kernels import tail_deviations

PERCENTILES = (95.0, 97.5)
"""percentiles of sigma_total that are called sigma_l and sigma_h"""


class Uncertainty(NamedTuple):
    """Standard deviations of the return in the lower tail, reward units; floats, or arrays of one shape."""

    epistemic: Array
    """disagreement of the members"""
    aleatoric: Array
    """spread within members"""
    total: Array
    """both"""


@lru_cache
def _tail(quantiles: int, beta: float) -> Array:
    """Weights of the lowest quantiles, of those that are in the tail."""
    weights = make_distortion("cvar", beta).weights(quantiles)
    return weights[: int(np.count_nonzero(weights > 1e-12))]


def uncertainty(quantiles: ArrayLike, beta: float) -> Uncertainty:
    """Uncertainty of returns with quantiles (N, ..., N_q), one set a member; result of shape (...)."""
    z = np.asarray(quantiles, dtype=float)
    shape = z.shape[1:-1]
    parts = tail_deviations(z.reshape(len(z), -1, z.shape[-1]), _tail(z.shape[-1], beta))
    return Uncertainty(*parts.reshape(3, *shape))


class RunningPercentiles:
    """Percentiles of the last `window` numbers of a stream: sigma_l and sigma_h (paper, slack delta(sigma)).

    It is a window, since the critics change as they learn and old sigmas no longer hold. The percentiles are
    exact, and nothing is drawn at random.
    """

    def __init__(self, window: int = 20_000) -> None:
        self._values = np.full(window, np.nan)
        self._seen = 0

    def __len__(self) -> int:
        return min(self._seen, self._values.size)

    def add(self, values: ArrayLike) -> None:
        """Take in one number or several, oldest first; what is not finite is left out."""
        new = np.atleast_1d(np.asarray(values, dtype=float))
        new = new[np.isfinite(new)]
        kept = new[-self._values.size :]
        start = self._seen + new.size - kept.size
        self._values[(start + np.arange(kept.size)) % self._values.size] = kept
        self._seen += new.size

    def values(self) -> tuple[float, ...]:
        """The PERCENTILES, linearly interpolated; nan while nothing was seen."""
        if not len(self):
            return tuple(float("nan") for _ in PERCENTILES)
        return tuple(float(v) for v in np.percentile(self._values[: len(self)], PERCENTILES))

    def state(self) -> Arrays:
        """What `load` takes to carry on exactly from here."""
        return {"values": self._values.copy(), "seen": np.array(self._seen)}

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Carry on from a saved state."""
        self._values = np.array(state["values"], dtype=float)
        self._seen = int(state["seen"])
