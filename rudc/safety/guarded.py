"""Checks the answers of barriers, rules and solvers that are not RUDC's: where an answer does not fit, an
error says whose it is and what is wrong with it.

The filter puts the numbers of all barriers into one table, row after row. An array that is too long or too
short would shift the rows of other barriers.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from rudc.arrays import Array, Flags
from rudc.imports import ask_own, is_own, refused, shortened
from rudc.safety.barrier import Barrier, BarrierSettings, Found, Terms
from rudc.safety.clearance import Bodies, Clearance
from rudc.safety.qp import Problem, Solution, Solver
from rudc.safety.rows import RowWeights
from rudc.safety.rules import Rule
from rudc.world.scene import Scene

_FLOAT = np.dtype(np.float64)


class GuardedBarrier(Barrier):
    """A barrier that is not RUDC's. Every method raises PartFailedError where the barrier's own method raises
    an exception or its answer does not fit.
    """

    def __init__(self, inner: Barrier) -> None:
        super().__init__(getattr(inner, "settings", None))
        self.inner = inner
        self._who = f"barrier {inner.name}"
        for fixed in ("name", "as_road", "inputs"):
            setattr(self, fixed, getattr(inner, fixed))

    def find(self, scene: Scene) -> Found:
        """The barrier's own answer; its names must all differ."""
        found: Any = self._ask("find", scene, lambda: self.inner.find(scene))
        if isinstance(found, Found) and _different_texts(found.names):
            return found
        raise refused(
            self._who, scene.time_s, "find", shortened(found), "a `Found` of a tuple of different names"
        )

    def terms(self, scene: Scene, found: Found) -> Terms:
        """The barrier's own answer; each array must have one finite number for each name."""
        terms: Any = self._ask("terms", scene, lambda: self.inner.terms(scene, found))
        if not isinstance(terms, Terms):
            raise refused(self._who, scene.time_s, "terms", shortened(terms), "`Terms`")
        wanted = (len(found.names),)
        for array in terms if terms.lg_a is not None else terms[:9]:
            if not (type(array) is np.ndarray and array.shape == wanted and array.dtype is _FLOAT):
                terms = self._mended(scene, terms, wanted)
                break
        if not np.isfinite([array for array in terms if array is not None]).all():
            name, array = next(
                (n, a) for n, a in terms._asdict().items() if a is not None and not _all_finite(a)
            )
            raise refused(self._who, scene.time_s, "terms", f"{name} = {shortened(array)}", "finite numbers")
        return terms

    def in_conflict(self, scene: Scene, found: Found) -> Flags:
        """The barrier's own answer; it must have one truth value for each name."""
        flags: Any = self._ask("in_conflict", scene, lambda: self.inner.in_conflict(scene, found))
        if isinstance(flags, np.ndarray) and flags.shape == (len(found.names),) and flags.dtype == np.bool_:
            return flags
        wanted = f"an array of {len(found.names)} truth values (one for each name that find gave)"
        raise refused(self._who, scene.time_s, "in_conflict", shortened(flags), wanted)

    def on_path(self, scene: Scene) -> Scene | None:
        """The barrier's own answer."""
        followed: Any = self._ask("on_path", scene, lambda: self.inner.on_path(scene))
        if followed is None or isinstance(followed, Scene):
            return followed
        raise refused(self._who, scene.time_s, "on_path", shortened(followed), "a `Scene` or None")

    def features(self, scene: Scene, found: Found, part: Any, xi: Array) -> None:
        """Let the barrier write its inputs."""
        self._ask("features", scene, lambda: self.inner.features(scene, found, part, xi))

    def _mended(self, scene: Scene, terms: Terms, wanted: tuple[int]) -> Terms:
        """The terms as arrays of floats. Raises PartFailedError where a term is no array of numbers or has a
        shape other than `wanted`.
        """
        mended: dict[str, Array] = {}
        for name, given in terms._asdict().items():
            if given is None and name == "lg_a":
                continue
            try:
                array = np.asarray(given)
            except (TypeError, ValueError):
                array = np.asarray(None)
            if array.dtype.kind not in "biuf":
                raise refused(
                    self._who, scene.time_s, "terms", f"{name} = {shortened(given)}", "an array of numbers"
                )
            if array.shape != wanted:
                told = f"{name} of shape {array.shape}"
                asked = f"shape {wanted} (a number for each name that find gave)"
                raise refused(self._who, scene.time_s, "terms", told, asked)
            mended[name] = array.astype(np.float64)
        return Terms(**mended)

    def _ask(self, method: str, scene: Scene, call: Any) -> Any:
        return ask_own(self._who, scene.time_s, method, call)


class GuardedClearance(GuardedBarrier, Clearance):
    """As `GuardedBarrier`, for a barrier that keeps a distance."""

    def __init__(self, inner: Clearance) -> None:
        super().__init__(inner)
        self._fill = inner.fill

    def fill(self, scene: Scene, found: Found, to: Bodies) -> None:
        """Let the barrier write what was found."""
        self._ask("fill", scene, lambda: self._fill(scene, found, to))


def barrier_of(kind: type[Barrier], name: str, settings: BarrierSettings) -> Barrier:
    """A barrier with these settings. Raises PartFailedError if it is not RUDC's and cannot be made."""
    if not is_own(kind):
        return kind(settings)
    return ask_own(f"barrier {name}", None, "__init__", lambda: kind(settings))


def weights_of(rule: Rule, name: str, dt: float, *, road: bool) -> RowWeights:
    """The rule's weights. Raises PartFailedError if the rule is not RUDC's and either raises an exception or
    answers with something that is no `RowWeights` of finite numbers. `dt`: s that an action is held.
    """
    if not is_own(rule):
        return rule.weights(dt, road=road)
    who = f"rule {name}"
    answer: Any = ask_own(who, None, "weights", lambda: rule.weights(dt, road=road))
    if isinstance(answer, RowWeights):
        numbers = answer.h, answer.first, answer.second, answer.required
        if all(map(_is_number, numbers)):
            return answer
    raise refused(who, None, "weights", shortened(answer), "`RowWeights` of four finite numbers")


def most_of(rule: Rule, name: str, *, road: bool) -> float:
    """The rule's `most`, checked in the same way: a number that is at least 1."""
    if not is_own(rule):
        return rule.most(road=road)
    who = f"rule {name}"
    answer: Any = ask_own(who, None, "most", lambda: rule.most(road=road))
    if _is_number(answer) and answer >= 1.0:
        return float(answer)
    raise refused(who, None, "most", shortened(answer), "a finite number that is at least 1")


def answer_of(solver: Solver, name: str, problem: Problem, time_s: float) -> Solution:
    """The solver's answer. Raises PartFailedError if the solver is not RUDC's and either raises an exception
    or answers with something that is no `Solution` of the problem. `time_s`: s, time in the episode.
    """
    if not is_own(solver):
        return solver.solve(problem)
    who = f"QP solver {name}"
    answer: Any = ask_own(who, time_s, "solve", lambda: solver.solve(problem))
    if isinstance(answer, Solution) and isinstance(answer.solve_ms, int | float):
        fits = _is_finite(answer.x, problem.q.shape) and _is_finite(answer.multipliers, problem.b.shape)
        if fits or not answer.found:
            return answer
    n, m = len(problem.q), len(problem.b)
    wanted = f"a `Solution` with {n} finite numbers as x and {m} as multipliers, or found=False"
    raise refused(who, time_s, "solve", shortened(answer), wanted)


def refuse_alike(scene: Scene, barriers: Iterable[Barrier], names: Sequence[str]) -> None:
    """Raise PartFailedError if two constraints have the same name."""
    alike = sorted(name for name, times in Counter(names).items() if times > 1)
    if alike:
        who = f"barriers {', '.join(barrier.name for barrier in barriers)}"
        raise refused(who, scene.time_s, "find", f"the name {alike[0]!r} twice", "a name of its own for each")


def _all_finite(array: Array) -> bool:
    return bool(np.isfinite(array).all())


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


def _is_finite(array: Any, shape: tuple[int, ...]) -> bool:
    return (
        isinstance(array, np.ndarray)
        and array.shape == shape
        and array.dtype is _FLOAT
        and _all_finite(array)
    )


def _different_texts(names: Any) -> bool:
    return type(names) is tuple and {*map(type, names)} <= {str} and len({*names}) == len(names)
