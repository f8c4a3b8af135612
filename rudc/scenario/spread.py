"""Which points of a grid are looked at where it has too many to look at all."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

Point = tuple[int, ...]
"""which value of each key"""


def spread(sizes: Sequence[int], most: int) -> list[Point]:
    """All points of a grid with so many values of each key, the last key varying fastest; of a grid of more
    than `most` points so many at most, the same ones each time. They are a Latin hypercube: each key's values
    come up about equally often, its first and its last among them, and all of them where it has no more than
    `most`.
    """
    if math.prod(sizes) <= most:
        return list(itertools.product(*map(range, sizes)))
    rng = np.random.default_rng(0)
    columns = [rng.permutation(np.linspace(0, size - 1, most).round().astype(int)).tolist() for size in sizes]
    return list(dict.fromkeys(zip(*columns, strict=True)))
