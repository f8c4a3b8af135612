"""What an event of one's own gets wrong in its code, and is told."""

import math
from typing import Annotated, Literal

import numpy as np
import pytest

from rudc.errors import InputError, PartFailedError
from rudc.network.network import load_network
from rudc.scenario import load_scenario, register_event
from rudc.scenario.distributions import AnyDistribution, Bounds, Constant
from rudc.scenario.events import Event, Felt, Stage, registry
from rudc.scenario.keys import sections
from rudc.world.world import World


class Leaves(Event, frozen=True):
    """Wet leaves on the road."""

    kind: Literal["leaves"]
    """wet leaves"""
    friction: float = 0.5
    """coefficient of friction"""
    times: int = 3
    """how often"""


class LeavesEffect(Felt[Leaves]):
    """Everybody slips."""

    def begin(self, stage: Stage) -> bool:
        stage.set_friction(self.event.friction)
        return True


@pytest.fixture(autouse=True)
def own_kinds(monkeypatch):
    assert registry.EVENT_KINDS, "found once a process: before their table is copied"
    monkeypatch.setattr(registry, "_REGISTERED", {**registry._REGISTERED})


def failure(tmp_path, effect, friction=0.5):
    """What an episode in which the effect plays its part ends with."""
    register_event(Leaves, effect)
    (tmp_path / "s.yaml").write_text(f"name: s\nevents: [{{kind: leaves, friction: {friction}}}]\n")
    plan = load_scenario(tmp_path / "s.yaml").plan(0)
    with World(load_network("four_way")) as world, pytest.raises(PartFailedError) as caught:
        begun(world, plan)
    return str(caught.value)


def begun(world, plan):
    world.reset(plan)
    world.advance(np.zeros(2))


@pytest.mark.parametrize("friction", [0.0001, -1.0, 1.3, math.nan, math.inf])
def test_numbers_that_no_file_could_give_are_refused(tmp_path, monkeypatch, friction):
    monkeypatch.setattr(LeavesEffect, "begin", lambda self, stage: stage.set_friction(friction) or True)
    told = failure(tmp_path, LeavesEffect)
    assert told.startswith("event 1 (events.0) leaves at 0.0 s: begin raised ValueError: ")
    assert f"set_friction(friction={friction}): expected 0.03 to 1.2" in told


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda stage: stage.set_density(1e9), "set_density(density=1000000000.0): expected 0 to 150"),
        (lambda stage: stage.set_dropout(0.5, range_m=-1), "set_dropout(range_m=-1): expected at least 0"),
        (lambda stage: stage.set_own_noise(math.nan), "set_own_noise(acceleration=nan): expected 0 to 5"),
        (lambda stage: stage.pose_on_lane("ego_in", math.inf), "(at=inf): expected finite numbers"),
        (
            lambda stage: stage.is_free("car", (0.0, math.nan, 0.0)),
            "is_free(place=(0.0, nan, 0.0)): expected finite numbers",
        ),
    ],
)
def test_so_are_those_of_every_other_method(tmp_path, monkeypatch, call, told):
    monkeypatch.setattr(LeavesEffect, "begin", lambda self, stage: call(stage) or True)
    assert told in failure(tmp_path, LeavesEffect)


def test_begin_must_say_whether_it_has_begun(tmp_path, monkeypatch):
    monkeypatch.setattr(LeavesEffect, "begin", lambda self, stage: stage.set_friction(0.5))
    told = failure(tmp_path, LeavesEffect)
    assert told == "event 1 (events.0) leaves at 0.0 s: begin answered None; expected True or False"


def test_a_misspelt_method_is_said_as_it_is_registered():
    class Misspelt(Felt[Leaves]):
        def begni(self, stage: Stage) -> bool:
            return True

    with pytest.raises(InputError, match=r"^Misspelt has no begin\(stage\)$"):
        register_event(Leaves, Misspelt)
    with pytest.raises(InputError, match=r"takes a model and its effect.*got LeavesEffect and Leaves$"):
        register_event(LeavesEffect, Leaves)


def test_the_default_of_a_number_that_may_be_drawn_is_a_distribution():
    class Horn(Event, frozen=True):
        """A horn."""

        kind: Literal["horn"]
        first: Annotated[AnyDistribution, Bounds(0.1, 1.2)] = 0.8

    with pytest.raises(
        InputError, match=r"^Horn\.first: a default is written Constant\(value=0\.8\), not 0\.8$"
    ):
        register_event(Horn, LeavesEffect)

    class Bell(Event, frozen=True):
        """A bell."""

        kind: Literal["bell"]
        first: Annotated[AnyDistribution, Bounds(0.1, 1.2)] = Constant(value=0.8)

    register_event(Bell, LeavesEffect)


def test_keys_of_plain_types_are_numbers():
    register_event(Leaves, LeavesEffect)
    (section,) = sections("leaves")
    assert {key.name: key.type for key in section.keys} == {
        "name": "text",
        "when": "mapping",
        "friction": "number",
        "times": "whole number",
    }
