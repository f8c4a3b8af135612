"""Distortion risk measures of a return distribution given by fixed quantile midpoints.

Paper, Eq. (risk_sensitive_policy): a distortion zeta maps [0, 1] onto [0, 1], never falling, and the
distorted expectation of Z is

    Xi(Z) = int_0^1 F_Z^-1(tau) d zeta(tau)  ~  sum_i w_i Z_i,

Z_i at the midpoint (tau_i + tau_{i+1}) / 2 and tau_i = i / N_q.

The paper writes w_i = (tau_{i+1} - tau_i) zeta'(midpoint). Here zeta is integrated over the bin exactly,
w_i = zeta(tau_{i+1}) - zeta(tau_i): the weights then sum to one for every distortion and every N_q, also
where zeta' has a jump within a bin (CVaR) or is infinite at an end (Wang, CPW). Where zeta is linear within
each bin both are the same: CVaR at beta = 0.25 of 32 quantiles is the mean of the lowest 8.

    expectation  zeta(tau) = tau
    CVaR         zeta(tau) = min(tau / beta, 1)                                   Eq. (cvar)
    Wang         zeta(tau) = Phi(Phi^-1(tau) + eta), eta > 0 averse to risk
    CPW          zeta(tau) = tau^eta / (tau^eta + (1 - tau)^eta)^(1 / eta)        cumulative prospect weights
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from rudc.arrays import Array


@dataclass(frozen=True, slots=True)
class Distortion:
    """A distortion function."""

    zeta: Callable[[float], float]
    """maps [0, 1] onto [0, 1], never falling"""

    def weights(self, quantiles: int) -> Array:
        """Weight of each quantile midpoint in the distorted expectation, (quantiles,), summing to one."""
        return np.diff([self.zeta(i / quantiles) for i in range(quantiles + 1)])


def midpoints(quantiles: int) -> Array:
    """Quantile fractions (tau_i + tau_{i+1}) / 2, (quantiles,)."""
    return (np.arange(quantiles) + 0.5) / quantiles


def make_distortion(name: str, parameter: float | None = None) -> Distortion:
    """The distortion of that name; `parameter` is CVaR's beta or the eta of Wang and CPW. ValueError if
    wrong.
    """
    if name not in _MAKERS:
        raise ValueError(f"distortion {name!r} is not known; there are {', '.join(_MAKERS)}")
    maker, default, (low, high) = _MAKERS[name]
    value = default if parameter is None else parameter
    if not low < value <= high:
        raise ValueError(f"the parameter of {name} must lie in ({low}, {high}], not {value}")
    return Distortion(maker(value))


def _expectation(_: float) -> Callable[[float], float]:
    return lambda tau: tau


def _cvar(beta: float) -> Callable[[float], float]:
    return lambda tau: min(tau / beta, 1.0)


def _wang(eta: float) -> Callable[[float], float]:
    normal = NormalDist()

    def zeta(tau: float) -> float:
        return tau if tau in (0.0, 1.0) else normal.cdf(normal.inv_cdf(tau) + eta)

    return zeta


def _cpw(eta: float) -> Callable[[float], float]:
    def zeta(tau: float) -> float:
        return tau**eta / (tau**eta + (1.0 - tau) ** eta) ** (1.0 / eta)

    return zeta


_MAKERS: dict[str, tuple[Callable[[float], Callable[[float], float]], float, tuple[float, float]]] = {
    "expectation": (_expectation, 0.0, (-math.inf, math.inf)),
    "cvar": (_cvar, 0.25, (0.0, 1.0)),
    "wang": (_wang, 0.75, (-math.inf, math.inf)),
    "cpw": (_cpw, 0.71, (0.28, 1.0)),  # below about 0.28 it is not monotonous
}
"""maker, usual parameter, interval open at the left"""
