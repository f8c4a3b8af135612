"""Barriers, rules and solvers of other people: what does not fit is refused, what fits drives as before."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rudc.errors import PartFailedError
from rudc.safety.barrier import Barrier, Found, Terms
from rudc.safety.barriers import BARRIERS
from rudc.safety.clearance import Clearance
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.qp import SOLVERS, Solution
from rudc.safety.rows import RowWeights
from rudc.safety.rules import RULES, Rule
from tests.safety.scenes import Other, make_scene


class Limit(Barrier):
    """v <= 3."""

    name = "limit"

    def find(self, scene):
        return Found(("limit",))

    def terms(self, scene, found):
        zero = np.zeros(1)
        return Terms(np.array([3.0 - scene.ego.v]), *[zero] * 8, lg_a=np.array([-1.0]))


class Far(Limit):
    """v <= 100: says nothing."""

    name = "far"

    def find(self, scene):
        return Found(("far",))

    def terms(self, scene, found):
        return super().terms(scene, found)._replace(h=np.array([100.0]))


class Pole(Clearance):
    """Something that stands ahead."""

    name = "pole"

    def find(self, scene):
        return Found(("pole",))

    def fill(self, scene, found, to):
        to.position[:], to.velocity[:], to.direction[:] = 20.0, 0.0, 1.0


def with_barriers(monkeypatch, *barriers):
    for barrier in barriers:
        monkeypatch.setitem(BARRIERS.so_far, barrier.name, barrier)
    return SafetyFilter(FilterConfig.preset("ttcbf", **{barrier.name: True for barrier in barriers}))


def changed(method, answer):
    """A barrier whose `method` answers something else."""
    return type("Changed", (Far,), {method: lambda self, scene, found=None: answer(Far, self, scene, found)})


def terms_with(**fields):
    return changed("terms", lambda far, self, scene, found: far.terms(self, scene, found)._replace(**fields))


def answered(method, answer):
    return changed(method, lambda *_: answer)


SHAPES = {
    "h": np.array([100.0, 1.0]), "lf": np.zeros(0), "lg": 0.0, "az": np.zeros((1, 1)),
    "lg_a": np.array([-1.0, 0.0]),
}  # fmt: skip


@pytest.mark.parametrize("field", SHAPES)
def test_a_wrong_shape_is_refused(monkeypatch, field):
    """Without a check `lg_a` with two numbers moved the row of the barrier behind it by one."""
    guarded = with_barriers(monkeypatch, terms_with(**{field: SHAPES[field]}), Limit)
    with pytest.raises(PartFailedError) as caught:
        guarded.filter(make_scene(time_s=4.2), np.zeros(2))
    told = f"barrier far at 4.2 s: terms answered {field} of shape {np.shape(SHAPES[field])}; "
    assert str(caught.value) == f"{told}expected shape (1,) (a number for each name that find gave)"


@pytest.mark.parametrize(
    ("barrier", "told"),
    [
        (answered("find", Found(("a", "b"))), "terms answered h of shape (1,); expected shape (2,)"),
        (answered("find", Found("far")), "find answered Found(names='far'"),  # pyright: ignore[reportArgumentType]
        (answered("find", Found(("a", "a"))), "expected a `Found` of a tuple of different names"),
        (answered("find", Found((1,))), "find answered Found(names=(1,)"),  # pyright: ignore[reportArgumentType]
        (answered("find", None), "find answered None"),
        (answered("terms", [0.0] * 9), "expected `Terms`"),
        (terms_with(lf=np.array([1j])), "lf = array([0.+1.j]); expected an array of numbers"),
        (terms_with(lf=np.array([np.nan])), "terms answered lf = array([nan]); expected finite numbers"),
        (terms_with(h=[np.inf]), "terms answered h = array([inf]); expected finite numbers"),
        (terms_with(lf=None), "terms answered lf = None"),
        (terms_with(lf=["0"]), "terms answered lf = ['0']"),
        (answered("find", Found(("limit",))), "barriers vehicle, road, far, limit at 0.0 s: find"),
        (changed("terms", lambda *_: 1 / 0), "terms raised ZeroDivisionError: division by zero (test_gu"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(monkeypatch, barrier, told):
    with pytest.raises(PartFailedError) as caught:
        with_barriers(monkeypatch, barrier, Limit).filter(make_scene(), np.zeros(2))
    assert told in str(caught.value)
    assert "far" in str(caught.value)
    assert "0.0 s" in str(caught.value)


def test_who_is_in_conflict_is_one_answer_a_name(monkeypatch):
    towards = [Other(9.0, 0.0, 0.0, 0.0), Other(-5.5, 0.0, 0.0, 14.0)]
    scene, barrier = make_scene(towards, v=8.0), answered("in_conflict", np.zeros(2, dtype=bool))
    with pytest.raises(PartFailedError, match=r"in_conflict answered .* an array of 1 truth values"):
        with_barriers(monkeypatch, barrier).constraints(scene).in_conflict(scene)


def test_rows_that_are_unknown_on_the_path_are_refused(monkeypatch):
    """Such a row was left out without a word."""

    class Lost(Limit):
        def on_path(self, scene):
            return replace(scene, ego=replace(scene.ego, v=math.nan))

    guarded = with_barriers(monkeypatch, Lost)
    told = r"barrier limit at 0\.0 s: terms answered h = array\(\[nan\]\); expected finite numbers"
    with pytest.raises(PartFailedError, match=told):
        guarded.filter(make_scene(v=5.0), np.zeros(2))


@pytest.mark.parametrize("convert", [list, np.float32, int], ids=["lists", "float32", "whole"])
def test_numbers_of_other_types_are_taken_as_floats(monkeypatch, convert):
    class Converted(Limit):
        def terms(self, scene, found):
            given = (np.asarray(part) for part in super().terms(scene, found))
            changed: list[Any] = [list(a) if convert is list else a.astype(convert) for a in given]
            return Terms(*changed)

    scene, u = make_scene(v=5.0), np.array([2.0, 0.0])
    same, other = (with_barriers(monkeypatch, barrier).filter(scene, u) for barrier in (Limit, Converted))
    assert same.u.tolist() == other.u.tolist()
    assert same.u[0] < 0


def test_one_that_keeps_a_distance(monkeypatch):
    corrected = with_barriers(monkeypatch, Pole, Limit).filter(make_scene(v=8.0), np.zeros(2))
    assert corrected.names[-2:] == ("pole", "limit")
    broken = type("Broken", (Pole,), {"fill": lambda self, scene, found, to: to.margin.missing})
    with pytest.raises(PartFailedError, match=r"barrier pole at 0.0 s: fill raised AttributeError: "):
        with_barriers(monkeypatch, broken).filter(make_scene(), np.zeros(2))


@pytest.mark.parametrize(
    ("method", "answer", "told"),
    [
        ("weights", lambda: (0.1, 0.1, 0.005, 0.0), "weights answered (0.1, 0.1, 0.005, 0.0); expected `Row"),
        (
            "weights",
            lambda: RowWeights(0.1, np.nan, 0.005, 0.0),
            "weights answered RowWeights(h=0.1, first=n",
        ),
        ("weights", lambda: {}["no"], "weights raised KeyError: 'no' (test_guarded.py:"),
        ("most", lambda: None, "most answered None; expected a finite number that is at least 1"),
        ("most", lambda: {}["no"], "most raised KeyError: 'no' (test_guarded.py:"),
    ],
)
def test_a_rule_that_gives_no_weights(monkeypatch, method, answer, told):
    class Mine(Rule):
        def weights(self, dt, *, road):
            return RowWeights(0.1, dt, 0.5 * dt * dt, 0.0)

    monkeypatch.setitem(RULES, "mine", Mine)
    SafetyFilter(FilterConfig.preset("mine"))
    monkeypatch.setattr(Mine, method, lambda self, *_, road: answer())
    with pytest.raises(PartFailedError) as caught:
        SafetyFilter(FilterConfig.preset("mine"))
    assert str(caught.value).startswith(f"rule mine: {told}")


def test_a_barrier_that_cannot_be_made(monkeypatch):
    settingless = type("Settingless", (Far,), {"__init__": lambda self, settings: None})
    assert with_barriers(monkeypatch, settingless).filter(make_scene(), np.zeros(2)).names[-1:] == ("far",)
    broken = type("Broken", (Far,), {"__init__": lambda self, settings: settings.missing})
    with pytest.raises(PartFailedError, match=r"^barrier far: __init__ raised AttributeError: "):
        with_barriers(monkeypatch, broken)


def nothing(problem, **other):
    return Solution(np.zeros(len(problem.q)), True, 0.0, np.zeros(len(problem.b)), 0.0)._replace(**other)


@pytest.mark.parametrize(
    ("solve", "told"),
    [
        (
            lambda problem: nothing(problem, x=np.full(len(problem.q), np.nan)),
            "answered Solution(x=array([nan",
        ),
        (lambda problem: nothing(problem, multipliers=np.zeros(9)), "answered Solution("),
        (
            lambda problem: np.zeros(2),
            "answered array([0., 0.]); expected a `Solution` with 3 finite numbers",
        ),
        (lambda problem: None, "answered None; expected"),
        (lambda problem: {}["no"], "raised KeyError: 'no' (test_guarded.py:"),
    ],
)
def test_a_solver_that_answers_no_solution(monkeypatch, solve, told):
    monkeypatch.setitem(SOLVERS, "mine", lambda: SimpleNamespace(solve=solve))
    asked = SafetyFilter(FilterConfig.preset("ttcbf", solver="mine", last_resort=False))
    scene = make_scene([Other(12.0, 0.0, 0.0, 0.0)], time_s=1.3)
    with pytest.raises(PartFailedError) as caught:
        asked.filter(scene, np.array([3.0, 0.0]))
    assert str(caught.value).startswith(f"QP solver mine at 1.3 s: solve {told}")


def test_a_solver_that_finds_nothing_is_believed(monkeypatch):
    found = Solution(np.array([np.nan]), False, np.inf, np.zeros(0), 0.0)
    monkeypatch.setitem(SOLVERS, "mine", lambda: SimpleNamespace(solve=lambda problem: found))
    asked = SafetyFilter(FilterConfig.preset("ttcbf", solver="mine", last_resort=False))
    scene = make_scene([Other(12.0, 0.0, 0.0, 0.0)])
    assert asked.filter(scene, np.array([3.0, 0.0])).status == "braking"
