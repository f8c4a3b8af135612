"""Training's configuration refuses what cannot work; presets; the curriculum draws what it says."""

import math
from collections import Counter

import numpy as np
import pytest
import yaml

from rudc.agents.correction import CbfSettings, NoCorrection
from rudc.errors import InputError
from rudc.learning.algorithms import ALGORITHMS, Algorithm, register_algorithm
from rudc.learning.config import EnsembleConfig, LearnerConfig
from rudc.network.network import load_network
from rudc.safety.road_edges import RoadSettings
from rudc.safety.vehicles import VehicleSettings
from rudc.settings import known_keys
from rudc.training.config import Curriculum, TrainConfig
from rudc.training.curriculum import FIRST_SEED, HELD_OUT_SEED, held_out, make_mixture
from rudc.training.presets import FOLDER, preset_names


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("algorithm", list(ALGORITHMS))
def test_every_algorithm_has_every_preset(algorithm: str, preset: str):
    config = TrainConfig.of(algorithm, {"training.seed": 3, "training.steps": 20_000}, preset)
    assert config.algorithm == algorithm
    assert type(config.learner) is ALGORITHMS[algorithm].config
    assert config.given.seed == 3
    assert TrainConfig.model_validate_json(config.model_dump_json()) == config
    assert config.agent.model_dump() == {k: v for k, v in config.model_dump().items() if k != "training"}


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("rule", ["ttcbf", "ecbf"])
def test_a_fixed_filter_is_rudcs_own_but_for_slack_and_residual(rule: str, preset: str):
    fixed, whole = (
        TrainConfig.of(name, preset=preset).model_dump() for name in (f"only-{rule}", f"rudc-{rule[0]}")
    )
    slack, others = fixed["correction"].pop("slack"), whole["correction"].pop("slack")
    assert (slack["gain"], slack["constant"], others["gain"]) == (0.0, 0.0, 0.5)
    assert not fixed["correction"].pop("residual")
    assert whole["correction"].pop("residual")
    assert fixed | {"algorithm": ""} == whole | {"algorithm": ""}


def test_esac_is_rudc_without_filter_that_maximises_the_mean():
    mean, tail = (TrainConfig.of(name).model_dump() for name in ("esac", "rudc-wo-cbf"))
    assert mean["learner"]["distortion"] == "expectation"
    mean["learner"]["distortion"] = tail["learner"]["distortion"]
    tail["learner"].pop("distortion_parameter", None)
    mean["learner"].pop("distortion_parameter", None)
    assert mean | {"algorithm": ""} == tail | {"algorithm": ""}


def test_presets_hold_nothing_that_nobody_knows():
    known = {key for name in ALGORITHMS for key in known_keys(TrainConfig.of(name))}
    known |= {
        key for name in ALGORITHMS for key in known_keys(TrainConfig.of(name, {"correction.kind": "cbf"}))
    }

    def keys(tree: dict, before: str = "") -> list[str]:
        parts = [
            keys(v, f"{before}{k}.") if isinstance(v, dict) else [f"{before}{k}"] for k, v in tree.items()
        ]
        return [key for part in parts for key in part]

    assert preset_names() == ("default", "paper")
    for name in preset_names():
        unknown = set(keys(yaml.safe_load((FOLDER / f"{name}.yaml").read_text()))) - known
        assert unknown <= {"training.curriculum"}


@pytest.mark.parametrize(
    ("algorithm", "wrong", "said"),
    [
        ("sac2", {}, r"no algorithm 'sac2' \(did you mean 'sac'"),
        ("rudc-t", {"training.envs": 0}, "training.envs: must be at least 1"),
        ("rudc-wo-cbf", {"correction.slack.gain": 1.0}, "no setting 'correction.slack.gain'"),
        ("sac", {"training.seed": 2**63}, "training.seed: .*less than 9223372036854775808"),
        ("rudc-t", {"learner.seed": 1}, r"did you mean 'training\.seed'"),
        ("rudc-t", {"learner.n_step": 101}, "n_step"),
        ("rudc-t", {"speed": 3}, "speed"),
        ("rudc-t", {"observation": "all"}, "observation"),
        ("sac", {"learner.members": 3}, "no setting 'learner.members'"),
        ("sac", {"training.filtered_share": 0.3}, "filtered_share: has no effect with correction.kind=none"),
        ("sac", {"learner.learns_from": "proposed"}, "learns_from: has no effect with correction.kind=none"),
        ("sac", {"training.calibration_episodes": 3}, "has no effect with sac, which states no sigma"),
        ("rudc-t", {"correction.ecbf_rate1": 2.0}, "has no effect with rule=ttcbf"),
        ("rudc-t", {"learner.critic.heads": 2}, "has no effect with encoder=mlp"),
        ("rudc-t", {"learner.distortion_parameter": 2}, "has no effect with distortion=cvar"),
        ("rudc-t", {"training.seed_steps": 0, "training.seed_noise": 0.2}, "has no effect with seed_steps=0"),
        (
            "rudc-t",
            {"driver.learner.n_step": 1},
            r"'driver\.learner\.n_step' \(did you mean 'learner\.n_step'",
        ),
        ("rudc-t", {"steps": 1}, r"did you mean 'training\.steps'"),
        ("rudc-t", {"driver.slack_gain": 1}, r"called correction\.slack\.gain"),
        ("rudc-t", {"replayed": "nominal"}, r"called learner\.learns_from"),
        ("rudc-t", {"training.steps.more": 1}, "which has no parts"),
        ("rudc-t", {"": 1}, "dotted key"),
        ("rudc-t", {"algorithm": "sac"}, "training: sets algorithm to 'sac', but 'rudc-t' is to be trained"),
        ("rudc-t", {"training.evaluate_on": []}, "training.evaluate_on: .* at least 1 item"),
        ("rudc-t", {"learner.actor_rate": [-1e-3, 1e-5]}, "learner.actor_rate.0: must be at least 0"),
        ("sac", {"learner.critic_rate": [1e-3, math.nan]}, "learner.critic_rate.1: .*finite"),
        ("rudc-t", {"learner.value_scale": math.inf}, "learner.value_scale: .*finite"),
        ("rudc-t", {"learner.log_std": [-math.inf, 1.0]}, "learner.log_std.0: .*finite"),
        ("rudc-t", {"learner.target_entropy": math.nan}, "learner.target_entropy: .*finite"),
        ("sac", {"training.loss_limit": math.inf}, "training.loss_limit: .*finite"),
        ("sac", {"training.replay_size": 100}, r"replay_size 100 must be training\.learning_starts \(2000\)"),
        ("sac", {"training.replay_size": 3000, "learner.batch_size": 3001}, r"learner\.batch_size \(3001\)"),
        (
            "sac",
            {"training.steps": 12_000, "training.learning_starts": 20_000},
            "nothing is learnt in 20000 decisions",
        ),
        ("sac", {"training.steps": 12_000, "training.update_every": 20_001}, "a gradient step every 20001"),
    ],
)
def test_wrong_settings_are_refused_in_words(algorithm: str, wrong: dict, said: str):
    with pytest.raises(InputError, match=said):
        TrainConfig.of(algorithm, wrong)


def test_two_ways_of_writing_a_number_are_one():
    """What follows from others is not stored: nothing can be said twice and differently."""
    one = TrainConfig.of("rudc-t", {"training.steps": 20_000, "training.seed": 2, "observation": "paper"})
    other = TrainConfig.of("rudc-t").changed(
        {"observation": "paper", "training.seed": 2, "training.steps": 20_000}
    )
    assert one == other
    assert one.given == other.given
    assert (one.given.seed, one.given.layout.size) == (2, 105)


@pytest.mark.parametrize(("preset", "updates"), [("default", 26_000 // 4), ("paper", 18_000 // 4)])
def test_learning_rates_fall_over_all_gradient_steps(preset: str, updates: int):
    """Those of the seeding included; the paper has none."""
    assert TrainConfig.of("sac", {"training.steps": 20_000}, preset).given.updates == updates


def test_decisions_are_rounded_up_to_rounds():
    config = TrainConfig.of(
        "rudc-t", {"training.envs": 3, "training.steps": 1600, "training.seed_steps": 301}
    )
    assert (config.round_steps, config.seed_rounds, config.rounds) == (300, 2, 8)
    config = TrainConfig.of("rudc-t", {"training.steps": 2300, "training.seed_steps": 0})
    assert (config.seed_rounds, config.rounds) == (0, 12)


def test_gradient_steps_that_no_round_holds_whole_are_carried_on():
    """Rounds of 6 decisions, a gradient step every 4; learning starts after the second round."""
    small = {"envs": 1, "round_decisions": 6, "learning_starts": 7, "seed_steps": 6, "steps": 24}
    config = TrainConfig.of("sac", {f"training.{k}": v for k, v in small.items()} | {"learner.batch_size": 2})
    assert [config.updates_until(rounds) for rounds in range(6)] == [0, 0, 0, 1, 3, 4]
    rare = config.changed({"training.update_every": 13})  # none in most rounds
    assert [rare.updates_until(rounds) for rounds in range(6)] == [0, 0, 0, 1, 1, 2]


def test_observation_decides_what_the_networks_see():
    assert TrainConfig.of("sac", {"observation": "paper"}).given.layout.size == 105
    assert TrainConfig.of("sac").given.layout.size == 146


def test_curriculum_draws_arms_turns_traffic_and_starts_as_it_says():
    mixture = make_mixture("random_destination", Curriculum())
    rng = np.random.default_rng(1)
    plans = [mixture.draw(rng) for _ in range(2000)]
    arms = {arm.name: arm.major for arm in load_network("four_way").arms}
    minor = np.mean([not arms[plan.ego.origin or ""] for plan in plans])
    assert minor == pytest.approx(0.65, abs=0.04)
    turns = Counter(plan.ego.turn for plan in plans)
    assert turns["left"] / 2000 == pytest.approx(0.35, abs=0.04)
    assert turns["right"] / 2000 == pytest.approx(0.325, abs=0.04)
    density = [plan.traffic.density for plan in plans]
    distance = [plan.ego.distance_m for plan in plans]
    assert 10 <= min(density) < 11 < 34 < max(density) <= 35
    assert 25 <= min(distance) < 26 < 44 < max(distance) <= 45
    assert min(plan.seed for plan in plans) >= FIRST_SEED > HELD_OUT_SEED + 10_000


def test_without_curriculum_the_scenario_is_kept():
    mixture = make_mixture("dense_left_turn", None)
    plan = mixture.draw(np.random.default_rng(0))
    assert (plan.traffic.density, plan.ego.turn, len(mixture.scenarios)) == (30.0, "left", 1)
    swept = make_mixture("density_sweep", None)
    assert len(swept.scenarios) == 5
    assert sum(swept.chances) == pytest.approx(1)


def test_with_a_curriculum_all_values_that_a_scenario_sweeps_are_trained_on(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("name: mine\nextends: random_destination\nsweep: {episode.timeout: [5, 60]}\n")
    mixture = make_mixture(str(file), Curriculum())
    plans = [(scenario.plan(0), chance) for scenario, chance in zip(*mixture, strict=True)]
    for timeout in (5.0, 60.0):
        assert sum(chance for plan, chance in plans if plan.timeout_s == timeout) == pytest.approx(0.5)
    file.write_text("name: mine\nextends: random_destination\nsweep: {network: [four_way, t_junction]}\n")
    with pytest.raises(InputError, match="mine sweeps network, and a curriculum has the arms of one network"):
        make_mixture(str(file), Curriculum())


def test_held_out_scenarios_have_names_of_their_own(tmp_path):
    """Episodes of two of one name could not be told from each other."""
    for file, density in (("thin", 10), ("thick", 35)):
        text = f"name: same\nextends: random_destination\ntraffic: {{density: {density}}}\n"
        (tmp_path / f"{file}.yaml").write_text(text)
    files = tuple(map(str, sorted(tmp_path.iterdir())))
    assert list(held_out(("random_destination", files[0]))) == ["random_destination", files[0]]
    for twice, name in ((files, "same"), (("dense_left_turn",) * 2, "dense_left_turn")):
        with pytest.raises(InputError, match=f"held-out scenario '{name}' is given more than once"):
            held_out(twice)


@pytest.mark.parametrize("rule", ["ttcbf", "ecbf"])
def test_the_papers_preset_is_as_written(rule):
    config = TrainConfig.of(f"rudc-{rule[0]}", {"training.steps": 4000}, "paper")
    learner, correction = config.learner, config.correction
    assert (config.observation, config.action.model_dump()) == ("paper", {"kind": "direct"})
    assert isinstance(correction, CbfSettings)
    vehicles, road = (correction.row_weights(road=road) for road in (False, True))
    assert (correction.rule, vehicles.h, vehicles.first) == (rule, road.h, road.first)
    assert correction.barriers == {
        "vehicle": VehicleSettings(constrained="all", max_vehicles=None),
        "road": RoadSettings(points="fixed", d_safe=0.5),
    }
    assert (correction.max_steering_correction, correction.max_added_acceleration) == (0.05, math.inf)
    assert not correction.last_resort
    assert isinstance(learner, EnsembleConfig)
    assert (learner.members, learner.n_step, learner.critic.encoder, learner.critic.hidden) == (
        5,
        1,
        "attention",
        256,
    )
    training = config.training
    assert (training.curriculum, training.seed_steps, training.collision_reward) == (None, 0, -50.0)
    assert training.filtered_share == 1.0
    assert (learner.learns_from, learner.temperature, learner.target_rate) == ("proposed", 0.05, 0.005)


def test_a_preset_of_ones_own(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("learner: {n_step: 2, members: 7}\ntraining: {envs: 1}\n")
    assert TrainConfig.of("sac", {}, str(path)).learner.n_step == 2
    found = TrainConfig.of("rudc-t", {}, str(path))
    assert isinstance(found.learner, EnsembleConfig)
    assert (found.learner.members, found.training.envs) == (7, 1)
    path.write_text("algorithm: sac\nlearner: {n_step: 2}\n")
    assert TrainConfig.of("sac", {"algorithm": "sac"}, str(path)).algorithm == "sac"
    with pytest.raises(
        InputError, match=r"mine.yaml': sets algorithm to 'sac', but 'rudc-t' is to be trained"
    ):
        TrainConfig.of("rudc-t", {}, str(path))
    path.write_text("learner: {n_step: 1\n")
    with pytest.raises(InputError, match=r"mine.yaml:2:1: not valid YAML"):
        TrainConfig.of("sac", {}, str(path))
    path.write_text("learner: [1]")
    with pytest.raises(InputError, match="learner"):
        TrainConfig.of("sac", {}, str(path))
    path.write_text("- 1")
    with pytest.raises(InputError, match=r"mine.yaml:1:1: expected a mapping with keys such as `learner`"):
        TrainConfig.of("sac", {}, str(path))
    with pytest.raises(InputError, match=r"no preset 'papr' \(did you mean 'paper'"):
        TrainConfig.of("sac", {}, "papr")


def test_nothing_in_a_preset_is_lost_without_a_word(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("correction: {d_safe: 0.1}\nlearner: {learns_from: proposed}\n")
    found = TrainConfig.of("rudc-t", {}, str(path))
    assert found.correction.model_dump()["d_safe"] == 0.1
    assert found.learner.learns_from == "proposed"
    with pytest.raises(InputError, match="the mapping has no `kind`"):
        TrainConfig.of("sac", {}, str(path))
    path.write_text("learner: {bacth_size: 64}\n")
    with pytest.raises(
        InputError,
        match=r"mine.yaml': there is no setting 'learner.bacth_size' \(did you mean 'learner.batch_",
    ):
        TrainConfig.of("rudc-t", {}, str(path))


@pytest.mark.parametrize(
    ("algorithm", "correction", "kind"),
    [
        ("rudc-t", "{kind: none}", "none"),
        ("usl", "{kind: none}", "none"),
        ("sac", "{kind: cbf, d_safe: 0.1}", "cbf"),
        ("usl", "{kind: cbf}", "cbf"),
        ("sac", "{kind: cbf, slack: {gain: 0.5}}", "none"),  # asks for sigma
        ("rudc-t", "{kind: usl, steps: 3}", "cbf"),
        ("rudc-t", "usl", "cbf"),
        ("fac", "{kind: usl}", "usl"),
    ],
)
def test_a_correction_of_ones_own_preset_is_taken_where_it_can_work(tmp_path, algorithm, correction, kind):
    path = tmp_path / "mine.yaml"
    path.write_text(f"correction: {correction}\nlearner: {{learns_from: proposed}}\n")
    found = TrainConfig.of(algorithm, {}, str(path)).correction
    assert found.model_dump()["kind"] == kind
    if "d_safe" in correction:
        assert found.model_dump()["d_safe"] == 0.1


def test_a_wrong_correction_in_ones_own_preset_is_refused(tmp_path):
    path = tmp_path / "mine.yaml"
    for wrong in ("{kind: cbff}", "{kind: cbf, d_saef: 1}", "{kind: [1]}", "null"):
        path.write_text(f"correction: {wrong}\n")
        with pytest.raises(InputError, match=r"mine.yaml': .*(correction|d_saef)"):
            TrainConfig.of("sac", {}, str(path))


def test_single_values_can_be_changed_by_their_keys():
    config = TrainConfig.of("rudc-t").changed(
        {
            "observation": "paper",
            "learner.n_step": 1,
            "correction.constrained": "all",
            "training.curriculum.left_share": 0.5,
        }
    )
    assert config.learner.n_step == 1
    assert isinstance(config.correction, CbfSettings)
    assert config.correction.model_dump()["constrained"] == "all"
    assert config.training.curriculum is not None
    assert config.training.curriculum.left_share == 0.5
    assert TrainConfig.of("rudc-t", {"training.curriculum": None}).training.curriculum is None
    assert TrainConfig.of("rudc-t", {"correction.kind": "none"}).correction == NoCorrection()


def test_a_strangers_algorithm_takes_its_place():
    mine = Algorithm("Mine.", "tests.learning.test_sac:SacLearner", LearnerConfig, {"learner": {"n_step": 5}})
    try:
        register_algorithm("mine", mine)
        register_algorithm("mine", mine)
        with pytest.raises(InputError, match="there is an algorithm 'mine' already"):
            register_algorithm("mine", ALGORITHMS["sac"])
        config = TrainConfig.of("mine", {}, "paper")
        assert config.learner.n_step == 5
        assert config.entry.kind(config.algorithm)(config.learner, config.given, "cpu").updates == 0
    finally:
        ALGORITHMS.pop("mine", None)


def test_an_algorithm_whose_critics_cannot_state_sigma_does_not_offer_it():
    """Its training could not be calibrated, at its very end; settings that are named are read when asked."""
    learner, said = "tests.learning.test_sac:SacLearner", "Vague offers sigma, which only critics by Ensemble"
    with pytest.raises(InputError, match=said):
        register_algorithm("vague", Algorithm("Mine.", learner, Vague))
    assert "vague" not in ALGORITHMS
    register_algorithm("vague", Algorithm("Mine.", learner, f"{__name__}:Vague"))
    try:
        with pytest.raises(InputError, match=said):
            TrainConfig.of("vague", {})
    finally:
        del ALGORITHMS["vague"]
    register_algorithm("sure", Algorithm("Mine.", learner, Sure))
    del ALGORITHMS["sure"]


class Vague(LearnerConfig):
    """Offers what it does not have."""

    offers = ("sigma",)


class Sure(EnsembleConfig):
    """Offers what it has, and more."""

    offers = ("sigma", "cost")
