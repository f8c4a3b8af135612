"""The Gymnasium environment: its contract, seeds, infos, several at once."""

import pickle

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

import rudc
from rudc.drawing.view import Driving
from rudc.env.intersection import IntersectionEnv
from rudc.errors import InputError, SimulationError, WorldBusyError
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.vehicle import EgoVehicle
from rudc.world.config import WorldConfig
from rudc.world.scene import Scene
from tests.env.test_reward import TERMS

ID = rudc.ENV_ID
COAST = np.array([1 / 3, 0.0], dtype=np.float32)


@pytest.fixture
def make():
    made = []

    def build(**arguments):
        made.append(gymnasium.make(ID, **arguments))
        return made[-1].unwrapped

    yield build
    for env in made:
        env.close()


def play(env, seed, steps=40, **reset):
    """Observations and rewards of a coasting ego."""
    observation, info = env.reset(seed=seed, **reset)
    observations, rewards = [observation], []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(COAST)
        observations.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            break
    return np.array(observations), rewards, info


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"observation": "conflict", "as_dict": True, "scenario": "dense_left_turn"},
        {"scenario": "perfect_storm", "render_mode": "rgb_array"},
    ],
    ids=["default", "conflict", "rendered"],
)
def test_check_env(make, arguments):
    check_env(make(**arguments), skip_render_check="render_mode" not in arguments)


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_render(make, mode, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    if mode == "human":
        pytest.importorskip("pygame")
    env = make(render_mode=mode)
    env.reset(seed=0)
    env.step(COAST)
    frame = env.render()
    if mode == "human":
        assert frame is None
    else:
        assert frame.shape == (600, 600, 3)
        assert frame.dtype == np.uint8
        env.driving = Driving("mine", active=tuple(f"veh:{name}" for name in env.episode.truth.ids))
        assert np.any(env.render()[:60] != frame[:60]), "the caption"
        assert np.any(env.render()[120:] != frame[120:]), "the marks"
        env.reset(seed=0)
        assert env.driving == Driving("mine")


def test_same_seed_same_episode_and_reset_draws_the_next(make):
    env = make(observation="conflict")
    first, second = play(env, 5), play(env, None)
    again, second_again = play(env, 5), play(env, None)
    np.testing.assert_array_equal(first[0], again[0])
    assert first[1] == again[1]
    np.testing.assert_array_equal(second[0], second_again[0])
    assert first[2]["seed"] == 5
    assert second[2]["seed"] == second_again[2]["seed"] != 5
    assert first[0].shape != second[0].shape or np.any(first[0] != second[0])


def test_info(make):
    env = make(scenario="dense_left_turn")
    _, info = env.reset(seed=1)
    assert set(info) == {"scene", "seed", "cost"}
    assert isinstance(info["cost"], np.float64)
    assert info["cost"] == 0.0
    assert isinstance(info["scene"], Scene)
    _, rewards, info = play(env, 1, steps=500)
    assert set(info) == {"scene", "seed", "reward_terms", "cost", "outcome", "metrics"}
    assert isinstance(info["cost"], np.float64)
    assert tuple(info["reward_terms"]) == TERMS
    assert sum(info["reward_terms"].values()) == pytest.approx(rewards[-1])
    assert info["metrics"]["outcome"] == info["outcome"] != ""
    assert info["metrics"]["episode_reward"] == pytest.approx(sum(rewards))
    assert info["metrics"]["steps"] == len(rewards)


def test_time_limit_truncates(make):
    env = make(overrides={"episode.timeout": 3, "ego.speed": 6, "ego.distance": 45})
    env.reset(seed=0)
    for _ in range(29):
        *_, terminated, truncated, info = env.step(np.array([0.2, 0.0], dtype=np.float32))
        assert not terminated
        assert not truncated
        assert info["outcome"] == ""
    *_, terminated, truncated, info = env.step(np.array([0.2, 0.0], dtype=np.float32))
    assert truncated
    assert not terminated
    assert info["outcome"] == "frozen"


def test_the_vehicle_can_be_another(make):
    with pytest.raises(InputError, match="a_min < 0 < a_max"):
        make(vehicle=EgoVehicle(a_min=6.0))
    van = EgoVehicle(length=6.0, width=2.2, a_max=1.5)
    env = make(scenario="dense_left_turn", vehicle=van, overrides={"traffic.density": 0})
    _, info = env.reset(seed=0)
    assert info["scene"].vehicle == van
    assert info["scene"].route is load_network("four_way", vehicle=van).route(
        info["scene"].route.origin, info["scene"].route.destination
    )
    full = np.array([1.0, 0.0], dtype=np.float32)
    assert env.step(full)[-1]["scene"].last_u.tolist() == [1.5, 0.0]


def test_the_longest_episode_is_said(make):
    assert make().spec.max_episode_steps == 400
    assert make(overrides={"episode.timeout": 3}).spec.max_episode_steps == 30
    env = gymnasium.make(ID, overrides={"episode.timeout": {"uniform": [2, 5]}})
    assert env.spec.max_episode_steps == 50
    assert "TimeLimit" not in str(env), "the episode itself ends there"


def test_films_are_as_fast_as_decisions(make):
    slow = make(config=WorldConfig(decision_s=0.2))
    assert (make().metadata["render_fps"], slow.metadata["render_fps"]) == (10, 5)


def test_leaving_the_road_terminates(make):
    env = make(overrides={"traffic.density": 0})
    env.reset(seed=0)
    for _ in range(60):
        *_, terminated, _truncated, info = env.step(np.array([0.5, -1.0], dtype=np.float32))
        if terminated:
            break
    assert info["outcome"] in ("off_road", "wrong_way")
    assert info["reward_terms"]["rule_violation"] == -50.0


def test_arguments_and_options(make):
    dense = load_scenario("dense_left_turn")
    env = make(scenario=dense)
    assert env.reset(seed=0)[1]["scene"].route.turn == "left"
    plan = load_scenario("random_destination", {"ego.route": {"from": "east", "turn": "right"}}).plan(7)
    _, info = env.reset(options={"plan": plan})
    assert (info["scene"].route.origin, info["scene"].route.turn, info["seed"]) == ("east", "right", 7)
    with pytest.warns(UserWarning, match=r"density_sweep sweeps traffic.density; .*overrides={'traffic"):
        _, info = env.reset(seed=3, options={"scenario": "density_sweep"})
    assert info["seed"] == 3
    assert env.reset(seed=0)[1]["scene"].route.turn == "left"
    expected = env.reset()[1]["seed"]
    env.reset(seed=0)
    with pytest.raises(InputError, match="nosuch: no shipped scenario"):
        env.reset(options={"scenario": "nosuch"})
    assert env.reset()[1]["seed"] == expected, "a reset that is refused draws no seed"
    with pytest.raises(InputError, match="colour"):
        env.reset(options={"colour": 1})
    with pytest.raises(InputError, match=r"takes a mapping with scenario or plan, not \[1\]"):
        env.reset(options=[1])
    with pytest.raises(InputError, match=r"plan is an `EpisodePlan`.*not 3"):
        env.reset(options={"plan": 3})
    with pytest.raises(InputError, match=r"config is a `WorldConfig`.*not \{'decision_s': 0.2\}"):
        IntersectionEnv(config={"decision_s": 0.2})  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="finite"):
        env.step(np.array([np.nan, 0.0]))
    with pytest.raises(InputError, match="finite"):
        env.step_physical(np.array([0.0, np.nan]))
    with pytest.raises(InputError, match=r"shape \(3,\)"):
        env.step_physical([1.0, 0.0, 9.0])
    with pytest.raises(InputError, match="no array of numbers"):
        env.step(["0.5", "0.0"])
    with pytest.raises(InputError, match=r"no array of numbers \(.* requires grad"):
        env.step(torch.zeros(2, requires_grad=True))
    with pytest.raises(InputError, match=r"no array of numbers \(a complex number"):
        env.step(np.array([1j, 0.0]))


def test_another_network(make):
    env = make(network="t_junction")
    assert env.reset(seed=0)[1]["scene"].network.name == "t_junction"
    _, info = env.reset(seed=0, options={"plan": load_scenario("random_destination").plan(0)})
    assert info["scene"].network.name == "four_way"


@pytest.mark.parametrize(
    "arguments",
    [
        {"observation": "papers"},
        {"render_mode": "ansi"},
        {"scenario": "no_such_scenario"},
        {"scenario": 42},
    ],
)
def test_wrong_arguments_are_refused(arguments):
    with pytest.raises(InputError):
        IntersectionEnv(**arguments)


def test_one_episode_per_process_if_it_must_be_and_reopening(make):
    first, second = make(isolated=False), make(isolated=False)
    first.reset(seed=0)
    with pytest.raises(WorldBusyError):
        second.reset(seed=0)
    first.close()
    second.reset(seed=0)
    second.close()
    second.close()
    with pytest.raises(InputError, match="reset"):
        second.step(COAST)
    first.reset(seed=0)
    first.step(COAST)


def test_a_reset_that_fails_leaves_no_episode(make, monkeypatch):
    env = make()
    env.reset(seed=0)

    def fail(*args, **kwargs):
        raise SimulationError("it cannot be set up")

    with monkeypatch.context() as patch:
        patch.setattr(env.episode.world, "reset", fail)
        with pytest.raises(SimulationError, match="set up"):
            env.reset(seed=1)
    for step in (env.step, env.step_physical):
        with pytest.raises(InputError, match=r"call reset\(\) first"):
            step(COAST)
    env.reset(seed=0)
    env.step(COAST)


def test_pickles_without_its_simulation(make):
    env = make(observation="conflict", as_dict=True)
    env.reset(seed=0)
    copy = pickle.loads(pickle.dumps(env))
    assert copy.observation_space == env.observation_space
    env.close()
    copy.reset(seed=0)
    copy.close()


@pytest.mark.parametrize(("context", "count"), [("fork", 2), ("spawn", 1)])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded, use of fork:DeprecationWarning")
def test_several_at_once(make, context, count):
    env = make()
    seeds = [3, 4][:count]
    alone = [play(env, seed, 15)[0] for seed in seeds]
    env.close()
    several = gymnasium.make_vec(ID, count, "async", vector_kwargs={"context": context})
    try:
        observations, info = several.reset(seed=seeds)
        assert [scene.route.origin for scene in info["scene"]]
        for k in range(16):
            for which in range(count):
                np.testing.assert_array_equal(observations[which], alone[which][k])
            observations, *_ = several.step(np.stack([COAST] * count))
    finally:
        several.close()
