"""Where violations lie, as a rule that can be read: an interval for some of the searched keys.

Of all boxes, the one with the greatest  R C  is looked for: R the violation rate in it under the declared
distribution, C the share of all violations that lie in it (both by importance weights). Bounds are moved
greedily to values between neighbouring episodes, then dropped where that costs less than KEEP (PRIM,
Friedman and Fisher, Statistics and Computing 9, 1999, with another measure).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Flags

CUTS = 24
"""ends tried for each key and side"""
KEEP = 0.95
"""share of R C that the box must keep without a bound for the bound to be dropped"""


class Region(NamedTuple):
    """A box of searched keys."""

    bounds: Mapping[str, tuple[float, float]]
    """key -> least and greatest value, infinite where there is no bound; keys without any are absent"""
    violations: int
    """violations that lie in it"""
    episodes: int
    """episodes that lie in it"""
    of: int
    """violations in all"""

    def __str__(self) -> str:
        """As `ego.speed >= 9.1 and 0.2 <= events.0.friction <= 0.3`."""
        return " and ".join(_words(key, *ends) for key, ends in self.bounds.items()) or "everywhere"


def likeliest_region(keys: Sequence[str], values: Array, violated: Flags, weights: Array) -> Region:
    """The box where violations are likeliest. values (n, d) of the searched keys, violated and weights (n,);
    at least one violation."""
    box = np.array([[-math.inf, math.inf]] * len(keys))
    found = _score(box, values, violated, weights)
    while True:
        tried = [
            _moved(box, k, side, cut)
            for k in range(len(keys)) for side in (0, 1) for cut in _cuts(values[:, k], violated, side)
        ]  # fmt: skip
        scores = [_score(one, values, violated, weights) for one in tried]
        best = int(np.argmax(scores))
        if scores[best] <= found * (1.0 + 1e-9):
            break
        box, found = tried[best], scores[best]
    for k in range(len(keys)):
        for side in (0, 1):
            wider = _moved(box, k, side, (-math.inf, math.inf)[side])
            if (score := _score(wider, values, violated, weights)) >= KEEP * found:
                box, found = wider, max(score, found)
    inside = _inside(box, values)
    bounds = {
        key: (float(a), float(b))
        for key, (a, b) in zip(keys, box, strict=True)
        if a > -math.inf or b < math.inf
    }
    return Region(bounds, int(np.sum(violated & inside)), int(np.sum(inside)), int(np.sum(violated)))


def _inside(box: Array, values: Array) -> Flags:
    return np.all((values >= box[:, 0]) & (values <= box[:, 1]), axis=1)


def _score(box: Array, values: Array, violated: Flags, weights: Array) -> float:
    inside = _inside(box, values)
    hit = float(weights[inside & violated].sum())
    return hit**2 / (float(weights[inside].sum()) * float(weights[violated].sum())) if hit > 0.0 else 0.0


def _cuts(values: Array, violated: Flags, side: int) -> list[float]:
    """Ends worth a try: halfway between a violation and the next episode outside it; well spread ones."""
    those = np.unique(values[violated])
    ends = those[np.unique(np.linspace(0, len(those) - 1, CUTS).round().astype(int))]
    known = np.unique(values)
    at = np.searchsorted(known, ends)
    beside = known[np.clip(at + (1 if side else -1), 0, len(known) - 1)]
    return (0.5 * (ends + beside)).tolist()


def _moved(box: Array, key: int, side: int, end: float) -> Array:
    moved = box.copy()
    moved[key, side] = end
    return moved


def _words(key: str, low: float, high: float) -> str:
    if low == -math.inf:
        return f"{key} <= {high:.4g}"
    if high == math.inf:
        return f"{key} >= {low:.4g}"
    return f"{low:.4g} <= {key} <= {high:.4g}"
