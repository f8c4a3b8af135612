"""`Others`: where those are predicted to be whom a manoeuvre of the last resort might hit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.arrays import Array, Complex, Flags, Index


class Others(NamedTuple):
    """m predictions of those whom a manoeuvre might hit: up to three for each of them."""

    who: Index
    """(m,) index of each among the scene's others"""
    place: Complex
    """(m, T) m, positions of their centres"""
    facing: Complex
    """(m, T) directions e^(i psi)"""
    half: Array
    """(m, 2) m, half lengths and half widths"""
    still: Flags
    """(m,) whether they stand still"""

    def during(self, instants: slice) -> Others:
        """The same predictions at some of the instants only."""
        return self._replace(place=self.place[:, instants], facing=self.facing[:, instants])

    @property
    def steady(self) -> Flags:
        """(m,) whether each is the prediction at the present speed: the first of each of the others."""
        first = np.zeros(len(self.who), dtype=np.bool_)
        first[np.unique(self.who, return_index=True)[1]] = True
        return first
