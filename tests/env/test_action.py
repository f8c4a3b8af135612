"""What actions in [-1, 1] mean, by kind."""

import gymnasium
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, ValidationError

import rudc.env  # noqa: F401  # registers the environment
from rudc.env.action import ACTIONS, ActionSettings, Adjustment, Direct, read_action
from rudc.env.tracking import steering
from rudc.errors import InputError, PartFailedError

unit = st.floats(-1, 1)


@pytest.mark.parametrize("kind", ACTIONS)
@given(x=unit, y=unit, offset=st.floats(-1, 1))
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_actions_come_back_from_what_they_stand_for(make_scene, kind, x, y, offset):
    action, scene = read_action(kind), make_scene(s=20.0, offset=offset)
    u = action.physical(np.array([x, y]), scene)
    assert -6 <= u[0] <= 3
    assert abs(u[1]) <= 0.6
    back = action.normalised(u, scene)
    assert action.space().contains(back.astype(np.float32))
    assert action.physical(back, scene) == pytest.approx(u, abs=1e-9)
    if abs(u[1]) < 0.6:
        assert back == pytest.approx([x, y], abs=1e-9)


def test_direct_reaches_the_limits(make_scene):
    scene = make_scene()
    for action, u in (((-1, -1), (-6, -0.6)), ((1, 1), (3, 0.6)), ((0, 0), (-1.5, 0)), ((9, -9), (3, -0.6))):
        assert Direct().physical(np.array(action), scene) == pytest.approx(u)


def test_doing_nothing_coasts_along_the_path(make_scene):
    scene = make_scene(s=60.0, offset=0.4)
    assert Adjustment().physical(np.zeros(2), scene) == pytest.approx([0, steering(scene)])


@pytest.mark.parametrize("kind", ACTIONS)
def test_what_no_action_reaches_becomes_the_nearest(make_scene, kind):
    assert read_action(kind).normalised(np.array([-20.0, 0.6]), make_scene(s=20.0)).tolist() == [-1, 1]


def test_a_name_or_a_mapping_says_which_is_meant():
    assert read_action("direct") == Direct()
    assert read_action({"kind": "adjustment", "adjustment": 0.2}) == Adjustment(adjustment=0.2)
    for wrong, said in (
        ("dirct", "action: there is no 'dirct' .did you mean 'direct'"),
        ({"kind": "direct", "adjustment": 0.2}, "action: there is no setting 'adjustment'"),
        (
            {"kind": "adjustment", "adjustment": 0},
            "action: adjustment: must be at least 0.001",
        ),
        (3, "action: expected one of direct, adjustment"),
    ):
        with pytest.raises(InputError, match=said):
            read_action(wrong)  # pyright: ignore[reportArgumentType]


def test_a_field_takes_any_kind_and_gives_it_back():
    class Settings(BaseModel):
        model_config = ConfigDict(extra="forbid")
        action: ActionSettings = Adjustment()

    found = Settings.model_validate({"action": {"kind": "adjustment", "adjustment": 0.3}})
    assert found.action == Adjustment(adjustment=0.3)
    assert Settings.model_validate_json(found.model_dump_json()) == found
    with pytest.raises(
        ValidationError, match=r"action\.adjustment\n  Input should be greater than or equal to 0.001"
    ):
        Settings.model_validate({"action": {"kind": "adjustment", "adjustment": -1}})


def test_an_environment_takes_the_same_kinds():
    """Outside learners have the seat that our agents have: doing nothing follows the path."""
    env = gymnasium.make("rudc/Intersection-v0", scenario="random_destination", action="adjustment")
    try:
        _, info = env.reset(seed=3)
        assert env.action_space == Adjustment().space()
        for _ in range(20):
            wanted = steering(info["scene"])
            _, _, _, _, info = env.step(np.zeros(2, np.float32))
            assert info["scene"].last_u == pytest.approx([0.0, wanted])
        assert abs(info["scene"].ego_offset) < 0.2
    finally:
        env.close()


@pytest.mark.parametrize("method", ["physical", "normalised"])
@pytest.mark.parametrize("answer", [np.array([np.nan, 0.0]), np.zeros(3), None, "00", [1j, 0.0]])
def test_a_kind_of_ones_own_answers_two_numbers(make_scene, method, answer):
    odd = type("Odd", (Direct,), {method: lambda *_: answer, "__module__": "mine"})()
    ask = odd.u_of if method == "physical" else odd.action_of
    with pytest.raises(PartFailedError) as caught:
        ask(np.zeros(2), make_scene())
    told = str(caught.value)
    assert told.startswith(
        f"action kind direct at 3.0 s: {method} answered {' '.join(repr(answer).split())}; "
    )
    assert told.endswith("expected two finite numbers")


def test_a_kind_of_ones_own_may_answer_a_list(make_scene):
    listed = type("Listed", (Direct,), {"physical": lambda *_: [1, 0], "__module__": "mine"})()
    assert listed.u_of(np.zeros(2), make_scene()).tolist() == [1.0, 0.0]


def test_the_environment_refuses_such_a_kind(monkeypatch):
    monkeypatch.setitem(
        ACTIONS, "direct", type("Odd", (Direct,), {"physical": lambda *_: None, "__module__": "mine"})
    )
    env = gymnasium.make("rudc/Intersection-v0", scenario="random_destination")
    try:
        env.reset(seed=0)
        with pytest.raises(PartFailedError, match=r"action kind direct at 0\.0 s: physical answered None"):
            env.step(np.zeros(2, np.float32))
    finally:
        env.close()
