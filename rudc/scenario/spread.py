"""Which points of a grid are tried when it has too many to try them all."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

Point = tuple[int, ...]
"""which value of each key"""


def spread(sizes: Sequence[int], most: int) -> list[Point]:
    """The points of a grid with `sizes` values of each key, the last key varying fastest: all of them, or
    `most` at most of a larger grid, the same ones each time. Those of a larger grid are a Latin hypercube:
    each key's values come up about equally often, its first and its last among them, and all of them if there
    are no more than `most`.
    """
    if math.prod(sizes) <= most:
        return list(itertools.product(*map(range, sizes)))
    rng = np.random.default_rng(0)
    columns = [rng.permutation(np.linspace(0, size - 1, most).round().astype(int)).tolist() for size in sizes]
    return list(dict.fromkeys(zip(*columns, strict=True)))
