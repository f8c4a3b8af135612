"""`Corrected`: what a correction, such as the safety filter, made of a proposed action."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rudc.arrays import Array


class Corrected(NamedTuple):
    """An action after correction, and how it came about. Corrections without barriers give only the first
    three fields, and `infeasible`.
    """

    u: Array
    """(2,) safe action: acceleration m/s2, front-wheel angle rad"""
    correction: Array
    """(2,) u minus the nominal action, m/s2 and rad"""
    status: str
    """how it came about: `nominal` where nothing needed correction, else a name that the correction gives"""
    active: tuple[str, ...] = ()
    """names of the constraints that determine the solution, or that had to be violated"""
    h: Array = np.zeros(0)
    """(K,) m2, barrier values of all constraints"""
    names: tuple[str, ...] = ()
    """(K,) their names"""
    violation: float = 0.0
    """m2 per step, largest violation of any row by a `relaxed` solution, also of rows that were given up; inf
    with status `braking`"""
    optimality_gap: float = 0.0
    """largest violation of the QP's optimality conditions; 0 where nothing was solved, inf with status
    `braking`"""
    solve_ms: float = 0.0
    """ms, time spent in QP solvers"""
    infeasible: bool = False
    """whether no action within bounds satisfied all rows, as far as the solver could tell"""
    slack: float = 0.0
    """delta by which rows were relaxed, or tightened where negative: in m2 per step, or without unit for
    slack of kind `rate` (rudc/safety/slack.py)"""

    @property
    def onwards(self) -> bool:
        """Whether the EV goes on because stopping would be worse (rudc/safety/last_resort.py). Then nothing
        else may hold it back.
        """
        return self.status == "onwards"
