"""`SafetyFilter`: the least change to an action that satisfies every barrier's condition.

Paper, Sec. "Safety Correction Formulation": with rows A u >= b from rows.py, u = (a, z) and
z = tan(delta_f),

    minimise  w_a (a - a_rl)^2 / 2 + w_z (z - z_rl)^2 / 2
    subject to  A u >= b,   a_low <= a <= min(a_max, a_rl + max_added_acceleration),
                |z - z_rl| <= max_steering_correction,   |z| <= tan(delta_max)

and delta_f = atan(z). a_low = max(a_min, -v / dt), since the model would drive backwards from standstill,
and a row that holds only by driving backwards must not count as satisfied. A nominal action that brakes
harder than a_low counts as a_low and is passed on unchanged.

Some barriers know an ego that keeps h >= 0 by following its path (`Barrier.on_path`: an ego close to the path
stays off the road's edges). A row that this ego would violate is wrong about what comes, since it takes a
bent edge for straight. It is relaxed by the largest amount by which that ego would violate it at any
acceleration between full braking and the proposed one.

The result, by `Corrected.status`:

    nominal   the action satisfies all rows (or there are none), so it is the solution and no QP is solved
    solved    the QP's solution, certified (see qp.py). The rows are linearised about it and the QP is solved
              again until the solution satisfies rows that are linearised about itself, which are exact there;
              it is then the nearest action only as far as rows are linear
    relaxed   no action satisfies all rows. The one that violates them least is taken: with a violation s >= 0
              of each row, minimise ... + sum_i r_i s_i^2 / 2,  A u + s >= b; by default r of vehicles is a
              thousand times r of the road. If some vehicles' rows ask for more acceleration and others for
              less, those in conflict (see gating.py) must hold, and the others may be violated; if no
              action does that, only those in conflict and the road's count, and all of them may be violated.
              If acceleration would violate any vehicle's row more, a <= 0 as well: otherwise the squares of
              a passing car's row can outweigh those of a truck ahead
    braking   not even that could be solved: full braking, steering as proposed
    last_resort   whichever of these came out, it would leave the ego no way to stop or to go on without
              hitting somebody (see last_resort.py): full braking instead
    onwards   the ego goes on: at full acceleration along the route if somebody would hit it even at full
              braking; as proposed if the QP's action would leave it in somebody's way (last_resort.py)
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from rudc.arrays import Array, Flags, Index
from rudc.errors import SolverError
from rudc.safety.barrier import Terms
from rudc.safety.config import FilterConfig
from rudc.safety.constraints import ConstraintBuilder, Constraints
from rudc.safety.corrected import Corrected
from rudc.safety.guarded import answer_of
from rudc.safety.last_resort import Instead, LastResort
from rudc.safety.qp import TOLERANCE, Problem, Solution, make_solver
from rudc.safety.qp_kernels import least_excess, on_the_road, pulls, some_rows, undecided, with_violations
from rudc.safety.rows import RowWeights, affine_rows, per_row
from rudc.safety.slack import rate_factor
from rudc.safety.soundness import refuse_unsound
from rudc.vehicle import EgoVehicle
from rudc.world.ego import within_limits
from rudc.world.scene import Scene

__all__ = ["Corrected", "FilterConfig", "SafetyFilter", "Status"]

Status = Literal["nominal", "solved", "relaxed", "braking", "last_resort", "onwards"]

MOST_PASSES = 4
"""how often rows are linearised at most; two times nearly always suffice"""
LEAST_ROOM = 1e-3
"""m/s2, least difference of the bounds of acceleration, since interior-point solvers need an interior"""
LEAST_LEVER = 1e-6
"""m2 per unit of tan(steering): a row with a smaller coefficient of steering says nothing about it"""
PUSHING = 1e-6
"""multiplier (cost per m2) above which a row counts as active"""
_NOBODY: Flags = np.zeros(1, dtype=np.bool_)


class _Bounds(NamedTuple):
    """The nominal action cut to the limits, and the QP's bounds, all as (a, z) in m/s2 and without unit."""

    nominal: Array
    """(2,)"""
    lower: Array
    """(2,)"""
    upper: Array
    """(2,)"""


class _Slack(NamedTuple):
    """How much the rows are relaxed (rudc/safety/slack.py); 0 means not at all."""

    level: float
    """m2 per step, added to all rows"""
    rate: float
    """logarithm of the factor on the weight of h"""


class _Conditions(NamedTuple):
    """The conditions of all constraints, exact to second order in time."""

    terms: Terms
    weights: RowWeights
    relief: Array
    """(K,) w + delta, m2 per step"""

    def sparing(self, scene: Scene, constraints: Constraints, bounds: _Bounds) -> _Conditions | None:
        """The same conditions, relaxed so far that an ego that follows its path satisfies them; None where no
        barrier knows such an ego.
        """
        a = float(bounds.lower[0]), float(bounds.nominal[0])
        lacking = constraints.lacking(scene, self.weights, self.relief, a)
        return None if lacking is None else self._replace(relief=self.relief + lacking)

    def rows(self, u: Array) -> tuple[Array, Array]:
        """A (K, 2) and b (K,), linearised about u (2,) and exact there."""
        return affine_rows(self.terms, self.weights, float(u[0]), float(u[1]), self.relief)


class SafetyFilter:
    """Corrects actions, one decision after the other."""

    def __init__(self, config: FilterConfig | None = None) -> None:
        self.config = config = config or FilterConfig()
        self.last_problem: Problem | None = None
        """the last QP of the last decision, whether it was solved or not; None if it had no constraints"""
        self._weights = config.row_weights(road=False), config.row_weights(road=True)
        self._most = config.most(road=False), config.most(road=True)
        self._builder = ConstraintBuilder(config)
        self._last_resort = LastResort(config) if config.last_resort else None
        self._solver = make_solver(config.solver)
        self._prices: Array = np.array([config.acceleration_weight, config.steering_weight])
        self._cost: Array = np.diag(self._prices)
        self._per_row: dict[bytes, RowWeights] = {}
        self._seen: tuple[Scene, Constraints] | None = None
        self._spent_ms = 0.0

    def reset(self) -> None:
        """Begin a new episode."""
        self.last_problem = None
        self._seen = None

    def constraints(self, scene: Scene) -> Constraints:
        """What `filter` will constrain in this scene, in the order of its rows; its argument `residual` must
        be in the same order. Raises SolverError for a scene that cannot be (rudc/safety/soundness.py).
        """
        if self._seen is None or self._seen[0] is not scene:
            refuse_unsound(scene)
            self._seen = scene, self._builder.build(scene)
        return self._seen[1]

    def filter(
        self,
        scene: Scene,
        u_rl: Array,
        slack: float = 0.0,
        residual: Array | None = None,
        rate: float = 0.0,
    ) -> Corrected:
        """The safe action for a nominal one `u_rl` (2,): acceleration m/s2, front-wheel angle rad.

        `slack`: delta(sigma) of kind `level`, m2 per step, added to all rows. `rate`: delta(sigma) of kind
        `rate`, without unit (rudc/safety/slack.py explains both). `residual`: (K,) m2 per step, predicted
        h(x_next) minus that of the filter's model, in the order of `constraints(scene)`; see rows.py. Raises
        SolverError if anything is not finite, if `residual` does not fit the constraints, or for a scene that
        cannot be.
        """
        if len(u_rl) != 2:
            raise SolverError(f"the filter was given {u_rl}, not an acceleration and a front-wheel angle")
        a, delta = float(u_rl[0]), float(u_rl[1])
        proposed = np.array([a, delta])
        if not math.isfinite(a + delta + slack + rate):
            raise SolverError(
                f"the filter was given an action or slack that is not finite: {proposed}, {slack}, {rate}"
            )
        filtered = self._corrected(scene, proposed, _Slack(slack, rate), residual)
        if (last := self._last_resort) is not None:
            instead = self._onwards(scene, proposed, filtered, last) or last.instead_of(scene, filtered.u)
            if instead is not None:
                filtered = self._replaced(scene, proposed, filtered, instead)
        return filtered

    def _onwards(self, scene: Scene, proposed: Array, found: Corrected, last: LastResort) -> Instead | None:
        """The proposed action, where `found` leaves the ego in somebody's way (`LastResort.would_block`)."""
        u, is_of_qp = _within(scene.vehicle, proposed), found.status in ("solved", "relaxed")
        if not is_of_qp or found.u[0] >= u[0]:
            return None
        modes = zip(found.names, self.constraints(scene).mode.tolist(), strict=True)
        of_the_road = any(k == 0.0 and name in found.active for name, k in modes)
        if of_the_road or not len(who := last.would_block(scene, found.u, u)):
            return None
        return Instead(u, True, who)

    def _replaced(self, scene: Scene, proposed: Array, filtered: Corrected, instead: Instead) -> Corrected:
        """The result with the last resort's action instead."""
        names = tuple(["veh:" + scene.ids[i] for i in instead.hit.tolist()])
        u, status = instead.u, "onwards" if instead.onwards else "last_resort"
        return filtered._replace(u=u, correction=u - proposed, status=status, active=names)

    def _corrected(self, scene: Scene, proposed: Array, slack: _Slack, residual: Array | None) -> Corrected:
        """The action as the rows correct it, before the last resort."""
        constraints = self.constraints(scene)
        bounds = self._bounds(scene, proposed)
        if not constraints.count:
            self.last_problem = None
            return self._passed(scene, proposed, np.zeros(0), ())
        conditions = self._conditions(scene, constraints, slack, residual)
        rows, b = conditions.rows(bounds.nominal)
        least = _least(rows, b, bounds.nominal, constraints.names)
        spared = conditions.sparing(scene, constraints, bounds) if least < 0.0 else None
        if spared is not None:
            conditions = spared
            rows, b = conditions.rows(bounds.nominal)
            least = _least(rows, b, bounds.nominal, constraints.names)
        h = conditions.terms.h
        q = -self._prices * bounds.nominal
        problem = self.last_problem = Problem(self._cost, q, rows, b, bounds.lower, bounds.upper)
        if least >= 0.0:
            return self._passed(scene, proposed, h, constraints.names)
        status, solution, kept = self._solve(scene, constraints, problem, conditions)
        u, violation = self._action(status, scene.vehicle, proposed, bounds, solution)
        if status == "braking":
            pushing = np.flatnonzero(rows @ bounds.nominal < b)
        else:
            pushing = kept[solution.multipliers > PUSHING]
        return Corrected(
            u=u,
            correction=u - proposed,
            status=status,
            active=tuple([constraints.names[i] for i in pushing.tolist()]),
            h=h,
            names=constraints.names,
            violation=violation,
            optimality_gap=solution.optimality_gap,
            solve_ms=self._spent_ms,
            infeasible=status != "solved",
        )

    def _bounds(self, scene: Scene, proposed: Array) -> _Bounds:
        body, most = scene.vehicle, self.config.max_steering_correction
        a_proposed, delta = proposed.tolist()
        a_low = min(max(body.a_min, -scene.ego.v / self.config.dt), body.a_max)
        z_max = math.tan(body.delta_max)
        a = min(max(a_proposed, a_low), body.a_max)
        a_high = max(a + self.config.max_added_acceleration, a_low + LEAST_ROOM)
        z = math.tan(min(max(delta, -body.delta_max), body.delta_max))
        return _Bounds(
            nominal=np.array([a, z]),
            lower=np.array([a_low, max(z - most, -z_max)]),
            upper=np.array([min(a_high, body.a_max), min(z + most, z_max)]),
        )

    def _conditions(
        self, scene: Scene, constraints: Constraints, slack: _Slack, residual: Array | None
    ) -> _Conditions:
        terms = constraints.terms(scene)
        if residual is not None and np.shape(residual) != (constraints.count,):
            raise SolverError(
                f"the filter has {constraints.count} constraints, but residuals of shape {np.shape(residual)}"
            )
        relief = slack.level + (np.zeros(constraints.count) if residual is None else residual)
        modes = constraints.mode.tobytes()
        weights = self._per_row.get(modes)
        if weights is None:
            weights = self._per_row[modes] = per_row(*self._weights, constraints.mode)
        if slack.rate != 0.0:
            most = np.where(constraints.mode > 0, *self._most)
            weights = replace(weights, h=weights.h * rate_factor(slack.rate, terms.h, most))
        return _Conditions(terms, weights, relief)

    def _solve(
        self, scene: Scene, constraints: Constraints, problem: Problem, conditions: _Conditions
    ) -> tuple[Status, Solution, Index]:
        """Status, solution, and the indices (k,) of the rows to which the solution's multipliers belong."""
        self._spent_ms = 0.0
        kept, hopeless = _undecided(problem)
        for _ in range(MOST_PASSES):
            if hopeless:
                break
            solution = self._answer(scene, _part(problem, kept))
            if not solution.found:
                break
            rows, b = conditions.rows(solution.x)
            if least_excess(rows, b, solution.x) >= -TOLERANCE:
                return "solved", solution, kept
            problem = self.last_problem = Problem(*problem[:2], rows, b, *problem[4:])
            kept, hopeless = _undecided(problem)
        relaxed, kept = self._relax(scene, constraints, problem, kept)
        return ("relaxed" if relaxed.found else "braking"), relaxed, kept

    def _relax(
        self, scene: Scene, constraints: Constraints, problem: Problem, kept: Index
    ) -> tuple[Solution, Index]:
        """The solution that violates the rows `kept` least, those in conflict first, and the indices of the
        rows to which its multipliers belong.
        """
        part, mode = _part(problem, kept), constraints.mode[kept]
        brakes, hastens = pulls(part.A, mode)
        if brakes < 0.0:  # towards somebody the ego does not accelerate
            most = min(part.upper[0], max(0.0, part.lower[0] + LEAST_ROOM))
            part = part._replace(upper=np.array([most, part.upper[1]]))
        conflict = constraints.in_conflict(scene)[kept] if brakes < 0.0 < hastens else _NOBODY
        passing = (mode > 0) & ~conflict if conflict.any() else _NOBODY
        if passing.any():
            solution = self._answer(scene, self._relaxed(part, mode, conflict))
            if solution.found:
                return Solution(_on_the_road(solution.x, part, mode), *solution[1:]), kept
            part, mode, kept = _part(part, np.flatnonzero(~passing)), mode[~passing], kept[~passing]
        solution = self._answer(scene, self._relaxed(part, mode, np.zeros(len(mode), dtype=bool)))
        if solution.found:
            solution = Solution(_on_the_road(solution.x, part, mode), *solution[1:])
        return solution, kept

    def _answer(self, scene: Scene, problem: Problem) -> Solution:
        """The solver's answer; its time is added to the decision's."""
        solution = answer_of(self._solver, self.config.solver, problem, scene.time_s)
        self._spent_ms += solution.solve_ms
        return solution

    def _relaxed(self, problem: Problem, mode: Array, hard: Flags) -> Problem:
        """The same problem in the variables (a, z, s_1, ...), with a violation s_i of every row that is not
        `hard` (k,). s_i >= 0 needs no bound, since a negative one only costs more.

        The whole cost is scaled by one over the geometric mean of the two violation weights: without that,
        interior-point solvers diverge now and then.
        """
        road, vehicle = self.config.road_violation_weight, self.config.vehicle_violation_weight
        _, q, rows, b, lower, upper = problem
        cost, q, rows, lower, upper = with_violations(
            q, rows, lower, upper, self._prices, mode, hard, road, vehicle
        )
        return Problem(cost, q, rows, b, lower, upper)

    def _passed(self, scene: Scene, proposed: Array, h: Array, names: tuple[str, ...]) -> Corrected:
        """The nominal action itself, cut to the vehicle's limits, as a result."""
        u = _within(scene.vehicle, proposed)
        return Corrected(u, u - proposed, "nominal", (), h, names)

    def _action(
        self, status: Status, body: EgoVehicle, proposed: Array, bounds: _Bounds, solution: Solution
    ) -> tuple[Array, float]:
        """The action (m/s2, rad) that a solution stands for, and the largest violation (m2 per step) of a row
        of the last problem, those that were given up included.
        """
        if status == "braking":  # whatever the solver left is not looked at
            return np.array([body.a_min, _within(body, proposed)[1]]), math.inf
        (a, z), (a_low, z_low), (a_high, z_high) = (
            part.tolist() for part in (solution.x[:2], bounds.lower, bounds.upper)
        )
        a, z = min(max(a, a_low), a_high), min(max(z, z_low), z_high)
        violation, problem = 0.0, self.last_problem
        if status == "relaxed" and problem is not None:
            violation = max(0.0, -least_excess(problem.A, problem.b, np.array([a, z])))
        if a <= a_low + 1e-6:  # as good as standing still: brake as hard as was proposed
            a = min(a, max(float(proposed[0]), body.a_min))
        return _within(body, np.array([a, math.atan(z)])), violation


def _undecided(problem: Problem) -> tuple[Index, bool]:
    """Indices (k,) of the rows that do not hold everywhere between the bounds; whether any row holds nowhere
    there.
    """
    return undecided(problem.A, problem.b, problem.lower, problem.upper)


def _part(problem: Problem, kept: Index) -> Problem:
    """The problem with the rows `kept` only."""
    if len(kept) == len(problem.b):
        return problem
    P, q, A, b, lower, upper = problem
    return Problem(P, q, *some_rows(A, b, kept), lower, upper)


def _on_the_road(x: Array, problem: Problem, mode: Array) -> Array:
    """A relaxed solution (a, z, violations) with steering that keeps to the road (see the kernel)."""
    return on_the_road(x, *problem[2:], mode, LEAST_LEVER)


def _least(rows: Array, b: Array, u: Array, names: tuple[str, ...]) -> float:
    """m2 per step, least of A u - b. Raises SolverError, naming the constraints, if rows are not finite."""
    least = least_excess(rows, b, u)
    if math.isnan(least):
        bad = ~(np.isfinite(rows).all(axis=1) & np.isfinite(b))
        wrong = ", ".join(name for name, is_bad in zip(names, bad, strict=True) if is_bad)
        if wrong:
            raise SolverError(f"the filter's rows are not finite for {wrong}")
    return least


def _within(body: EgoVehicle, u: Array) -> Array:
    """(2,) the action (m/s2, rad) clipped to the vehicle's limits."""
    return np.array(within_limits(body, *u.tolist()))
