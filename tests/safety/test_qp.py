"""The QP solvers: agreement with others, certificates, and what happens when there is no solution."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import linprog

from rudc.errors import SolverError
from rudc.safety import planar_kernels, qp_kernels
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.qp import NamedSolver, PlanarSolver, Problem, certified, make_solver
from tests.safety.scenes import Other, make_scene

PROBLEMS = 10_000


def like_real(rng: np.random.Generator) -> Problem:
    """A problem with the sizes and scales of the filter's: up to 12 vehicles and 6 road-edge points."""
    k = int(rng.integers(1, 19))
    rows = np.asfortranarray(
        np.column_stack([rng.normal(0, 0.15, k), rng.normal(0, 3, k) * rng.uniform(0, 1)])
    )
    nominal = np.array([rng.uniform(-6, 3), rng.uniform(-0.3, 0.3)])
    b = rows @ nominal - rng.exponential(0.5, k) + rng.choice([0.0, 0.4]) * rng.exponential(0.5, k)
    cost = np.diag([1.0, 20.0])
    lower = np.array([max(-6.0, -rng.uniform(0, 100)), nominal[1] - 0.05])
    return Problem(cost, -cost @ nominal, rows, b, lower, np.array([3.0, nominal[1] + 0.05]))


def test_the_planar_solver_agrees_with_others() -> None:
    rng, mine = np.random.default_rng(3), PlanarSolver()
    others = [NamedSolver("daqp"), NamedSolver("quadprog")]
    solved, worst = 0, 0.0
    for _ in range(PROBLEMS):
        problem = like_real(rng)
        a, theirs = mine.solve(problem), [other.solve(problem) for other in others]
        assert all(a.found == b.found for b in theirs)
        if a.found:
            solved += 1
            worst = max(worst, *(float(np.abs(a.x - b.x).max()) for b in theirs))
            assert np.all(problem.A @ a.x >= problem.b - 1e-6)
    assert worst < 1e-6
    assert PROBLEMS // 3 < solved < PROBLEMS


def test_the_filters_own_problem_is_solved_alike_by_all() -> None:
    """Rows that cannot bind are left out by the filter; others solve the whole problem that it records."""
    rng, solvers = np.random.default_rng(5), [NamedSolver("daqp"), NamedSolver("quadprog")]
    filter = SafetyFilter(FilterConfig.preset("ecbf", constrained="all"))
    compared = 0
    for _ in range(400):
        others = [
            Other(rng.uniform(5, 40), rng.uniform(-10, 10), rng.uniform(-3, 3), rng.uniform(0, 3))
            for _ in range(rng.integers(1, 4))
        ]
        scene = make_scene(others, v=rng.uniform(0, 6), y=rng.uniform(-3, 3), psi=rng.uniform(-0.2, 0.2))
        answer = filter.filter(scene, np.array([rng.uniform(-2, 3), rng.uniform(-0.2, 0.2)]))
        problem = filter.last_problem
        assert problem is not None
        for solver in solvers:
            theirs = solver.solve(problem)
            assert theirs.found != answer.infeasible
            if theirs.found and answer.status == "solved":
                u = answer.u[0], np.tan(answer.u[1])
                compared += 1
                assert np.abs(theirs.x - u).max() < 1e-6
    assert compared > 50


def box(rows: list[list[float]], b: list[float]) -> Problem:
    """min |x|^2 / 2 in the box of half side 2, under some rows."""
    return Problem(np.eye(2), np.zeros(2), np.array(rows), np.array(b), np.full(2, -2.0), np.full(2, 2.0))


@pytest.mark.parametrize("name", ["planar", "piqp", "daqp", "quadprog", "osqp", "clarabel"])
def test_every_solver_finds_the_nearest_point(name: str) -> None:
    solution = make_solver(name).solve(box([[3.0, 4.0]], [5.0]))
    assert solution.found
    assert solution.optimality_gap < 1e-6
    assert solution.x == pytest.approx([0.6, 0.8], abs=1e-6)
    assert solution.multipliers == pytest.approx([0.2], abs=1e-6)


@pytest.mark.parametrize("name", ["planar", "piqp", "daqp", "quadprog", "osqp", "clarabel"])
def test_no_solver_finds_what_is_not_there(name: str) -> None:
    solution = make_solver(name).solve(box([[1.0, 1.0], [-1.0, -1.0]], [1.0, 1.0]))
    assert not solution.found
    assert solution.optimality_gap == np.inf


@pytest.mark.parametrize("name", ["piqp", "daqp", "quadprog"])
def test_open_bounds(name: str) -> None:
    problem = box([[1.0, 1.0]], [10.0])._replace(upper=np.array([np.inf, 2.0]))
    assert make_solver(name).solve(problem).x == pytest.approx([8.0, 2.0], abs=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {"upper": np.array([np.inf, 2.0])},
        {"P": np.diag([1.0, 0.0])},
        {"P": np.eye(3), "q": np.zeros(3), "A": np.array([[1.0, 1.0, 2.0]]),
         "lower": np.array([-2.0, -2.0, -np.inf]), "upper": np.array([2.0, 2.0, np.inf])},
    ],
    ids=["an open bound", "a cost that is flat", "a third variable that is no violation"],
)  # fmt: skip
def test_the_planar_solver_refuses_other_problems(changes: dict[str, np.ndarray]) -> None:
    problem = box([[1.0, 1.0]], [1.0])
    with pytest.raises(SolverError, match="two variables between finite bounds"):
        PlanarSolver().solve(problem._replace(**changes))


def test_the_planar_solver_knows_what_touches() -> None:
    """Where more rows meet in the solution than make it up; a strip, a rectangle without width, a point."""
    daqp = NamedSolver("daqp")
    for problem in (
        box([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 2.0], [1.0, 2.0]], [1.0, 1.0, 2.0, 4.0, 3.0]),
        box([[1.0, 1.0], [-1.0, -1.0]], [1.0, -1.0]),
        box([[1.0, 0.0]], [1.0])._replace(lower=np.array([-2.0, 0.3]), upper=np.array([2.0, 0.3])),
        box([[1.0, 1.0]], [4.0]),
        box([[1.0, 1.0], [1.0, 1.0]], [1.0, 1.0]),
    ):
        ours, theirs = PlanarSolver().solve(problem), daqp.solve(problem)
        assert ours.found
        assert ours.optimality_gap < 2e-9
        assert ours.x == pytest.approx(theirs.x, abs=1e-8)


def test_a_solver_survives_an_infeasible_problem() -> None:
    solver, good = PlanarSolver(), box([[3.0, 4.0], [0.0, 1.0]], [5.0, -1.0])
    before = solver.solve(good)
    assert not solver.solve(box([[1.0, 1.0], [-1.0, -1.0]], [1.0, 1.0])).found
    after = solver.solve(good)
    assert after.found
    assert after.x == pytest.approx(before.x, abs=1e-9)


def test_relaxed_problems_are_always_solved_and_as_by_others() -> None:
    """Whatever the rows, all to be violated at a price or some to hold: one of these made piqp diverge."""
    rng, filter, solver = np.random.default_rng(11), SafetyFilter(), NamedSolver("quadprog")
    problems = [
        Problem(
            np.diag([1.0, 20.0]),
            np.zeros(2),
            np.array([[-0.03502380703766179, 0.0]]),
            np.array([4.232587417799866]),
            np.array([0.0, -0.05]),
            np.array([3.0, 0.05]),
        ),
        *(like_real(rng) for _ in range(1500)),
    ]
    found = []
    for problem in problems:
        k = len(problem.b)
        mode = (np.arange(k) < rng.integers(0, k + 1)).astype(float)
        more = problem._replace(b=problem.b + rng.choice([0.0, 1.0, 10.0]) * rng.random(k))
        for hard in (np.zeros(k, dtype=bool), rng.random(k) < 0.3):
            relaxed = filter._relaxed(more, mode, hard)
            ours, other = PlanarSolver().solve(relaxed), solver.solve(relaxed)
            assert ours.found == other.found
            if ours.found:
                assert ours.x == pytest.approx(other.x, abs=1e-6)
                assert ours.multipliers == pytest.approx(other.multipliers, rel=1e-6, abs=1e-6)
            assert ours.found or hard.any()
            found.append(ours.found)
    assert 2000 < sum(found) < 3000


def test_rows_that_are_left_out_hold_everywhere_and_hopeless_is_what_holds_nowhere() -> None:
    rng, kinds = np.random.default_rng(13), set()
    for _ in range(300):
        problem = like_real(rng)
        problem = problem._replace(b=problem.b + rng.choice([-2.0, 0.0, 1.0]))
        corners = np.array(
            [
                [a, z]
                for a in (problem.lower[0], problem.upper[0])
                for z in (problem.lower[1], problem.upper[1])
            ]
        )
        excess = corners @ problem.A.T - problem.b
        kept, hopeless = qp_kernels.undecided(problem.A, problem.b, problem.lower, problem.upper)
        assert kept.tolist() == np.flatnonzero(excess.min(axis=0) < 0.0).tolist()
        assert hopeless == (excess.max(axis=0) < 0.0).any()
        kinds.add((len(kept) == len(problem.b), hopeless))
        A, b = qp_kernels.some_rows(problem.A, problem.b, kept)
        assert np.array_equal(A, problem.A[kept])
        assert np.array_equal(b, problem.b[kept])
    assert len(kinds) == 4


def test_nothing_is_left_of_the_polygon_where_a_linear_programme_finds_nothing() -> None:
    """It looks for the least t by which a point between the bounds violates every row at most."""
    rng, answers = np.random.default_rng(19), []
    for _ in range(400):
        problem = like_real(rng)
        problem = problem._replace(b=problem.b + rng.choice([-1.0, 0.0, 1.0, 2.0]))
        rows, bounds = np.column_stack([problem.A, np.ones(len(problem.b))]), (problem.lower, problem.upper)
        box = [*zip(*bounds, strict=True), (0.0, None)]
        best = linprog([0.0, 0.0, 1.0], -rows, -problem.b, bounds=box)
        assert not 0.0 < best.fun < 1e-8, "too near to tell"
        answers.append(best.fun > 0.0)
        assert PlanarSolver().solve(problem).found != answers[-1]
    assert 100 < sum(answers) < 300


def test_a_row_is_added_to_the_cost() -> None:
    rng = np.random.default_rng(23)

    def of(cost: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The cost at the points (n, 2); a constant is not kept."""
        r = np.array([cost[:2], [0.0, cost[2]]])
        return ((x @ r.T - cost[3:]) ** 2).sum(axis=1) / 2

    for _ in range(100):
        cost, line, x = rng.uniform(0.1, 1, 5), rng.normal(0, 1, 3), rng.normal(0, 1, (3, 2))
        weight = rng.exponential(1e3)
        wanted = of(cost, x) + weight * (line[2] - x @ line[:2]) ** 2 / 2
        added = of(planar_kernels.with_row(cost, weight, line), x)
        assert np.ptp(added - wanted) == pytest.approx(0.0, abs=1e-9 * wanted.max())


def test_the_least_excess_is_nan_where_a_row_is_not_finite() -> None:
    rng = np.random.default_rng(29)
    for _ in range(100):
        problem, u = like_real(rng), rng.normal(0, 1, 2)
        excess = qp_kernels.least_excess(problem.A, problem.b, u)
        assert excess == pytest.approx((problem.A @ u - problem.b).min(), abs=1e-12)
        for wrong in (np.nan, np.inf, -np.inf):
            b = problem.b.copy()
            b[rng.integers(len(b))] = wrong
            assert np.isnan(qp_kernels.least_excess(problem.A, b, u))


def test_the_gap_is_the_largest_violation_of_the_conditions() -> None:
    rng = np.random.default_rng(17)
    for _ in range(300):
        problem = like_real(rng)
        P, q, A, b, lower, upper = problem
        if rng.random() < 0.3:
            upper = np.full(2, np.inf)
        x, y = rng.uniform(-1, 1, 2), rng.normal(0, 1, len(b))
        y_lower, y_upper = rng.exponential(1, (2, 2)) * [1.0, rng.choice([0.0, 1.0])]
        gap, multipliers = qp_kernels.optimality_gap(P, q, A, b, lower, upper, x, y, y_lower, y_upper, 1e30)
        y = np.maximum(y, 0.0)
        scale = 1.0 + max(np.abs(q).max(), y.max())
        above = np.minimum(upper - x, 1e30)
        wanted = [
            (b - A @ x).max(), (lower - x).max(), (x - upper).max(),
            np.abs(P @ x + q - A.T @ y - y_lower + y_upper).max() / scale,
            np.abs(y * (A @ x - b)).max() / scale,
            np.abs(y_lower * (x - lower)).max() / scale, np.abs(y_upper * above).max() / scale,
        ]  # fmt: skip
        assert gap == pytest.approx(max(wanted), rel=1e-12)
        assert np.array_equal(multipliers, y)


def test_steering_goes_where_the_roads_rows_want_it_but_not_beyond_the_bounds() -> None:
    lower, upper, mode = np.array([-6.0, -0.05]), np.array([3.0, 0.05]), np.array([1.0, 0.0, 0.0])
    A, b = np.array([[0.0, -9.0], [0.5, 2.0], [0.0, -1.0]]), np.array([0.0, -1.96, -0.045])
    x = np.array([-4.0, -0.01, 0.2, 0.3, 0.4])

    def moved(second: float, third: float = 0.0) -> list[float]:
        more = np.array([0.0, second, third])
        return qp_kernels.on_the_road(x, A, b + more, lower, upper, mode, 1e-6).tolist()

    assert moved(0.0) == pytest.approx([-4.0, 0.02, 0.18, 0.0, 0.0]), "just so far that the road's row holds"
    assert moved(0.04) == pytest.approx([-4.0, 0.04, 0.36, 0.0, 0.0])
    assert moved(-1.0) == x.tolist(), "the row holds"
    assert moved(0.06) == x.tolist(), "pushed from both edges"
    assert moved(1.0, -1.0)[:2] == [-4.0, 0.05], "no farther than the bounds"


def test_a_wrong_answer_is_not_found() -> None:
    problem, nothing = box([[3.0, 4.0]], [5.0]), np.zeros(2)
    right = certified(problem, np.array([0.6, 0.8]), np.array([0.2]), nothing, nothing, 0.0)
    assert right.found
    for x in ([0.0, 0.0], [1.0, 0.8], [0.6, np.nan]):
        assert not certified(problem, np.array(x), np.array([0.2]), nothing, nothing, 0.0).found
    assert not certified(problem, np.array([0.6, 0.8]), np.array([0.3]), nothing, nothing, 0.0).found


def test_solver_not_installed() -> None:
    with pytest.raises(SolverError, match=r"'gurobbi' is not installed; there are: planar, .*daqp"):
        make_solver("gurobbi")
    with pytest.raises(ValidationError, match="not installed"):
        FilterConfig(solver="gurobbi")
