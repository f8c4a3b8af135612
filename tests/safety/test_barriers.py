"""Further barriers and rules: one class each, registered by name, everything else as it is."""

from typing import ClassVar

import numpy as np
import pytest
from pydantic import Field, model_validator

from rudc.errors import InputError
from rudc.safety.barrier import Barrier, BarrierSettings, Found, Terms
from rudc.safety.barriers import BARRIERS, register_barrier
from rudc.safety.clearance import EPSILON, Bodies, Clearance
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.residual import ResidualPredictor, shipped_predictor
from rudc.safety.rows import RowWeights
from rudc.safety.rules import RULES, Rule, register_rule
from rudc.world.scene import Kind
from tests.safety.scenes import Other, make_scene


class SpeedSettings(BarrierSettings):
    limit: float = 8.0
    """m/s"""


class SpeedBarrier(Barrier):
    """h = limit - v: a barrier of relative degree 1, and about no place at all."""

    name: ClassVar[str] = "speed"
    Settings: ClassVar[type[BarrierSettings]] = SpeedSettings

    def find(self, scene):
        return Found(("speed",))

    def terms(self, scene, found):
        zero = np.zeros(1)
        h = np.array([self.settings.limit - scene.ego.v])
        return Terms(h, zero, zero, zero, zero, zero, zero, zero, zero, lg_a=np.array([-1.0]))


class PedestrianSettings(BarrierSettings):
    distance: float = 2.0
    """m"""


class PedestrianBarrier(Clearance):
    """A round distance to each pedestrian, besides what is kept from whoever moves."""

    name: ClassVar[str] = "pedestrian"
    Settings: ClassVar[type[BarrierSettings]] = PedestrianSettings

    def find(self, scene):
        who = np.flatnonzero(scene.kind == Kind.PEDESTRIAN)
        return Found(tuple(f"pedestrian:{scene.ids[i]}" for i in who), who)

    def fill(self, scene, found, to: Bodies):
        to.position[:] = scene.position[found.others] @ (1, 1j)
        to.velocity[:] = scene.velocity[found.others] @ (1, 1j)
        to.direction[:], to.mode[:] = 1.0, 1.0
        to.short[:], to.stretch[:] = EPSILON, 0.0
        to.margin[:] = 2.5 + self.settings.distance


class Halving(Rule):
    """h may lose a share of what it is in a step, whatever h'' is."""

    share: float = 0.5

    def weights(self, dt: float, *, road: bool) -> RowWeights:
        return RowWeights(h=self.share, first=dt, second=0.5 * dt * dt, required=0.0)


@pytest.fixture(autouse=True)
def _as_it_was():
    before, rules = dict(BARRIERS), dict(RULES)
    register_barrier(SpeedBarrier)
    register_barrier(PedestrianBarrier)
    register_rule("halving", Halving)
    yield
    for registry, old in ((BARRIERS, before), (RULES, rules)):
        registry.clear()
        registry.update(old)


@pytest.mark.parametrize("rule", ["ttcbf", "ecbf", "halving"])
def test_a_speed_limit_as_a_barrier(rule):
    own = {"ttcbf_gamma": 0.0} if rule == "ttcbf" else {}
    config = FilterConfig.preset(rule, speed=True, speed_limit=8.0, road=False, last_resort=False, **own)
    filter = SafetyFilter(config)
    slow, fast = make_scene(v=4.0), make_scene(v=7.95)
    assert filter.filter(slow, np.array([1.0, 0.0])).status == "nominal"
    answer = filter.filter(fast, np.array([3.0, 0.0]))
    assert (answer.status, answer.names, answer.active) == ("solved", ("speed",), ("speed",))
    assert answer.h == pytest.approx([0.05])
    weights = config.row_weights(road=False)
    assert answer.u[0] == pytest.approx(float(weights.h) * 0.05 / float(weights.first), abs=1e-5)


def test_barriers_stand_beside_each_other_and_beside_the_predictor():
    walker = Other(14.0, 3.0, -1.57, 1.2, length=0.5, width=0.5)
    kinds = np.array([Kind.PEDESTRIAN, Kind.CAR])
    scene = make_scene([walker, Other(30.0, 0.0)], v=8.0, kind=kinds)
    config = FilterConfig.preset("ttcbf", speed=True, speed_limit=20, pedestrian=True, constrained="all")
    filter = SafetyFilter(config)
    names = filter.constraints(scene).names
    assert names[:2] == ("veh:sv0", "veh:sv1")
    assert names[-2:] == ("pedestrian:sv0", "speed"), "those that keep a distance come first"
    answer = filter.filter(scene, np.array([2.0, 0.0]))
    assert answer.h[-2] == pytest.approx(14.0**2 + 3.0**2 - 4.5**2, abs=0.1)
    assert "pedestrian:sv0" in answer.active
    w = shipped_predictor()(scene, filter.constraints(scene), np.array([2.0, 0.0]))
    assert w[:2].all()
    assert not w[-2:].any(), "nothing has been fitted of these"
    plain = SafetyFilter(FilterConfig(constrained="all")).filter(scene, np.array([2.0, 0.0]))
    np.testing.assert_array_equal(plain.h, answer.h[:-2])


def test_a_barrier_at_work_needs_no_head_of_the_predictor():
    class Seen(PedestrianBarrier):
        name: ClassVar[str] = "seen"
        at_work: ClassVar[bool] = True
        inputs: ClassVar[tuple[str, ...]] = ("speed / 10",)

        def features(self, scene, found, part, xi):
            xi[:, -1] = scene.ego.v / 10

    register_barrier(Seen)
    scene = make_scene([Other(14.0, 3.0, length=0.5, width=0.5)], v=8.0, kind=np.array([Kind.PEDESTRIAN]))
    constraints = SafetyFilter(FilterConfig.preset("ttcbf", road=False, constrained="all")).constraints(scene)
    predictor = ResidualPredictor(shipped_predictor().arrays)
    assert constraints.names == ("veh:sv0", "pedestrian:sv0")
    assert (predictor(scene, constraints, np.array([2.0, 0.0])) != 0).tolist() == [True, False]


def test_their_settings_are_the_trees():
    config = FilterConfig.preset("halving", halving_share=0.25, speed=True, speed_limit=5.0)
    written = config.model_dump()
    assert (written["speed_limit"], written["halving_share"], written["speed"]) == (5.0, 0.25, True)
    assert not any(key.startswith(("ttcbf_", "ecbf_", "pedestrian")) for key in written)
    assert FilterConfig(road=False).model_dump()["road"] is False
    assert FilterConfig.model_validate(written) == config
    for changes, said in (
        ({"speed_limit": 5.0}, "speed_limit: has no effect with speed=false"),
        ({"speed": "fast"}, "speed: expected true or false"),
        ({"speed": True, "speed_limit": "much"}, "speed_limit: expected a number"),
        (
            {"speed": True, "speed_limt": 5},
            r"speed_limt: there is no such setting .did you mean 'speed_limit'",
        ),
        ({"halving_share": 0.1}, "halving_share: has no effect with rule=ttcbf"),
    ):
        with pytest.raises(InputError, match=said):
            FilterConfig.preset("ttcbf", **changes)


def test_a_check_across_settings_names_whose_they_are():
    class Between(BarrierSettings):
        low: float = 1.0
        high: float = 2.0

        @model_validator(mode="after")
        def _in_order(self):
            if self.low > self.high:
                raise ValueError("low lies above high")
            return self

    class Renamed(BarrierSettings):
        low: float = Field(alias="bottom")

    for settings, said in (
        (Between, "band: low lies above high"),
        (Renamed, "band: is missing, and it is required"),
    ):
        register_barrier(type("Band", (SpeedBarrier,), {"name": "band", "Settings": settings}))
        with pytest.raises(InputError, match=said):
            FilterConfig.preset("ttcbf", band=True, band_low=3.0)


def test_a_barrier_that_is_not_complete_is_refused_when_it_is_registered():
    class Idle(Barrier):
        name: ClassVar[str] = "idle"

    class Blind(PedestrianBarrier):
        name: ClassVar[str] = "blind"
        inputs: ClassVar[tuple[str, ...]] = ("speed / 10",)

    class Bodiless(SpeedBarrier):
        name: ClassVar[str] = "bodiless"
        inputs: ClassVar[tuple[str, ...]] = ("speed / 10",)

        def features(self, scene, found, part, xi):
            xi[:, -1] = scene.ego.v / 10

    for barrier, says in (
        (Idle, "'idle' lacks find, terms"),
        (Blind, "'blind' lacks features"),
        (Bodiless, "'bodiless' has inputs, but .* make it a Clearance"),
    ):
        with pytest.raises(InputError, match=says):
            register_barrier(barrier)
        assert barrier.name not in BARRIERS


def test_a_rule_without_weights_is_refused_when_it_is_registered():
    with pytest.raises(InputError, match="rule 'idle' lacks weights"):
        register_rule("idle", type("Idle", (Rule,), {}))
    assert "idle" not in RULES
