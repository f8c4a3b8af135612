"""Small convex quadratic programmes, solved and certified.

    minimise 1/2 x' P x + q' x    subject to    A x >= b,    lower <= x <= upper

No solver is trusted: each answer comes with the largest violation of the optimality conditions, its
optimality gap. It is computed here from the solver's x and its multipliers y, y_lower, y_upper (where y is
negative, it is taken as zero),

    primal          max(b - A x, lower - x, x - upper, 0)
    stationarity    max |P x + q - A' y - y_lower + y_upper| / (1 + max(|q|, y))
    complementarity max |y (A x - b)|, |y_lower (x - lower)|, |y_upper (upper - x)| / (1 + max(|q|, y))

and an answer is `found` only if the gap is at most TOLERANCE. This is needed: piqp leaves its last x in the
answer when it finds nothing, and daqp and quadprog return an x even for an input with NaN in it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from pydantic import AfterValidator

from rudc.arrays import Array
from rudc.errors import SolverError
from rudc.safety.planar_kernels import NOT_PLANAR, NOTHING, planar_solution
from rudc.safety.qp_kernels import optimality_gap

TOLERANCE = 1e-6
"""largest violation of an optimality condition that is accepted"""
ACCURATE = {
    "daqp": {"primal_tol": 1e-11, "dual_tol": 1e-11},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 50_000},
    "piqp": {"eps_duality_gap_abs": 1e-12, "eps_duality_gap_rel": 1e-14, "max_iter": 60},
}
"""settings of solvers whose defaults are too inaccurate for TOLERANCE"""
UNBOUNDED = 1e30
"""taken for the distance to a bound that is infinite, since 0 * inf is not 0"""


class Problem(NamedTuple):
    """A quadratic programme with n variables and m rows."""

    P: Array
    """(n, n), symmetric and positive definite"""
    q: Array
    """(n,)"""
    A: Array
    """(m, n)"""
    b: Array
    """(m,)"""
    lower: Array
    """(n,), -inf for none"""
    upper: Array
    """(n,), inf for none"""


class Solution(NamedTuple):
    """What a solver answered."""

    x: Array
    """(n,), without meaning unless `found`"""
    found: bool
    """whether the solver found a solution and the optimality gap is at most TOLERANCE"""
    optimality_gap: float
    """largest violation of the optimality conditions; inf if the solver found nothing"""
    multipliers: Array
    """(m,) multipliers of the rows, not negative; zeros unless `found`"""
    solve_ms: float
    """ms, time that the solver took"""


class Solver(Protocol):
    """Solves problems one after the other."""

    def solve(self, problem: Problem) -> Solution:
        """The problem's solution; its inputs must be finite."""
        ...


class PlanarSolver:
    """RUDC's own solver (rudc/safety/planar_kernels.py). It is exact, for problems of two variables between
    finite bounds, with or without violations of single rows as further variables. All QPs of the filter are
    such problems.
    """

    def solve(self, problem: Problem) -> Solution:
        """The problem's solution. Raises SolverError if the problem is of another form."""
        began = time.perf_counter()
        status, x, multipliers, gap = planar_solution(*problem, UNBOUNDED)
        spent = 1e3 * (time.perf_counter() - began)
        if status == NOT_PLANAR:
            raise SolverError(
                "QP solver 'planar' solves problems of two variables between finite bounds, and problems "
                "with violations of single rows as further variables; this is neither: take 'piqp'"
            )
        if status == NOTHING or not gap <= TOLERANCE:
            return _nothing(problem, spent)
        return Solution(x, True, gap, multipliers, spent)


class NamedSolver:
    """Any solver that qpsolvers knows and that is installed."""

    def __init__(self, name: str) -> None:
        """Raises SolverError if there is no such solver."""
        import qpsolvers

        if name not in qpsolvers.available_solvers:
            known = ", ".join([*SOLVERS, *sorted(qpsolvers.available_solvers)])
            raise SolverError(f"QP solver {name!r} is not installed; there are: {known}")
        self._name = name
        self._settings = ACCURATE.get(name, {})
        self._qpsolvers = qpsolvers

    def solve(self, problem: Problem) -> Solution:
        """The problem's solution."""
        began = time.perf_counter()
        m, bounded_below, bounded_above = len(problem.b), *map(np.isfinite, (problem.lower, problem.upper))
        identity = np.eye(len(problem.q))
        above, below = identity[bounded_below], identity[bounded_above]
        G = np.vstack([-problem.A, -above, below])
        h = np.concatenate([-problem.b, -problem.lower[bounded_below], problem.upper[bounded_above]])
        stated = self._qpsolvers.Problem(problem.P, problem.q, G, h)
        try:
            with warnings.catch_warnings():  # about speed, and about what `certified` checks
                warnings.simplefilter("ignore")
                answer = self._qpsolvers.solve_problem(stated, solver=self._name, **self._settings)
        except (self._qpsolvers.exceptions.QPError, ValueError, ArithmeticError):
            answer = None
        spent = 1e3 * (time.perf_counter() - began)
        if answer is None or not answer.found or answer.x is None:
            return _nothing(problem, spent)
        y = answer.z if answer.z is not None else np.zeros(len(h))
        y_lower, y_upper = y[m : m + len(above)] @ above, y[m + len(above) :] @ below
        return certified(problem, answer.x, y[:m], y_lower, y_upper, spent)


SOLVERS: dict[str, Callable[[], Solver]] = {"planar": PlanarSolver}
"""name -> what makes the solver; all other names are those of qpsolvers"""


def make_solver(name: str) -> Solver:
    """The solver of that name. Raises SolverError."""
    return SOLVERS[name]() if name in SOLVERS else NamedSolver(name)


def _installed(name: str) -> str:
    try:
        make_solver(name)
    except SolverError as error:
        raise ValueError(error) from None
    return name


SolverName = Annotated[str, AfterValidator(_installed)]
"""name of a solver as a setting: `planar`, or any that qpsolvers knows and that is installed"""


def certified(
    problem: Problem, x: Array, y: Array, y_lower: Array, y_upper: Array, spent_ms: float
) -> Solution:
    """The solution `x` (n,) with its optimality gap, given the multipliers of rows `y` (m,) and of bounds
    `y_lower`, `y_upper` (n,).
    """
    gap, multipliers = optimality_gap(*problem, x, y, y_lower, y_upper, UNBOUNDED)
    found = gap <= TOLERANCE
    return Solution(x, found, gap, multipliers if found else np.zeros(len(multipliers)), spent_ms)


def _nothing(problem: Problem, spent_ms: float) -> Solution:
    return Solution(np.zeros(len(problem.q)), False, np.inf, np.zeros(len(problem.b)), spent_ms)
