"""Training twice with one seed, stopping and resuming, going astray."""

import csv
import json
import multiprocessing
import os
import shutil
import signal
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from rudc.agents.checkpoint import load_learnt, save_learnt
from rudc.agents.correction import CbfSettings
from rudc.agents.registry import agent_settings, agent_summary, make_agent
from rudc.errors import AgentError, InputError, TrainingError
from rudc.learning.algorithms import ALGORITHMS
from rudc.learning.config import EnsembleConfig
from rudc.learning.sac_lagrangian import LagrangianStatistics
from rudc.safety.residual import shipped_predictor
from rudc.training.calibration import calibrate
from rudc.training.config import TrainConfig
from rudc.training.folder import config_text, held, stored_config
from rudc.training.trainer import Trainer, astray, train
from rudc.training.workers import WorkerPool

pytestmark = pytest.mark.slow


def _config(algorithm: str = "rudc-wo-cbf", **changes: Any) -> TrainConfig:
    """A training of 300 decisions; `changes` are of its `training`."""
    small = {
        "steps": 300,
        "seed_steps": 100,
        "learning_starts": 16,
        "envs": 2,
        "round_decisions": 25,
        "log_every": 100,
        "checkpoint_every": 100,
        "evaluate_every": 300,
        "evaluation_episodes": 1,
        "evaluate_on": ("random_destination",),
    }
    learner = {"policy.hidden": 8, "critic.hidden": 8, "batch_size": 16}
    if ALGORITHMS[algorithm].config is EnsembleConfig:
        learner |= {"members": 2, "quantiles": 4}
        small |= {"calibration_episodes": 1}
    settings = {f"training.{k}": v for k, v in (small | changes).items()}
    return TrainConfig.of(algorithm, settings | {f"learner.{k}": v for k, v in learner.items()})


ALIKE = ("only-ttcbf", "rudc-wo-cbf")
"""trained by the learner of rudc-t, only-ecbf and esac; their settings: test_config.py, test_baselines.py"""


class Watcher:
    """Presses Ctrl-C once so many decisions are taken."""

    def __init__(self, stop_at: int | None = None) -> None:
        self.stop_at = stop_at
        self.notes: list[str] = []

    def advance(self, steps: int) -> None:
        if steps == self.stop_at:
            os.kill(os.getpid(), signal.SIGINT)

    def progress(self, row: Mapping[str, Any]) -> None:
        pass

    def note(self, text: str) -> None:
        self.notes.append(text)


def _curves(folder: Path) -> dict[str, list[dict[str, str]]]:
    curves = {}
    for name in ("progress", "evaluation"):
        with open(folder / f"{name}.csv", encoding="utf-8") as file:
            curves[name] = [{k: v for k, v in row.items() if k != "wall_s"} for row in csv.DictReader(file)]
    return curves


def _round(folder: Path) -> int:
    """How far the checkpoint of a training is."""
    return json.loads((folder / "checkpoint" / "training.json").read_text(encoding="utf-8"))["round"]


def _assert_the_same(a: Path, b: Path) -> None:
    """Two trainings wrote the same rows, weights, state of the learner and replay, bit by bit."""
    assert _curves(a) == _curves(b)
    for name in ("agent.safetensors", "training.safetensors", "replay.npz"):
        load = np.load if name.endswith(".npz") else load_file
        one, other = (dict(load(folder / "checkpoint" / name)) for folder in (a, b))
        assert one.keys() == other.keys()
        for key, array in one.items():
            np.testing.assert_array_equal(array, other[key], err_msg=f"{name}: {key}", strict=True)


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A training that was interrupted in its last round, and its notes."""
    folder, watcher = tmp_path_factory.mktemp("training") / "whole", Watcher(stop_at=400)
    assert train(_config(), folder, watcher)
    return folder, watcher.notes


@pytest.fixture(scope="module")
def trained(late: tuple[Path, list[str]]) -> Path:
    return late[0]


def test_stopped_and_resumed_twice_gives_the_same_numbers(trained: Path, tmp_path: Path):
    folder = tmp_path / "stopped"
    early, late = Watcher(stop_at=50), Watcher(stop_at=250)
    assert not train(_config(), folder, early)
    assert early.notes[-1] == "interrupted; there is no checkpoint yet, so --resume begins anew"
    assert not train(_config(), folder, late, resume=True)  # between two checkpoints
    assert late.notes[-1] == f"interrupted; the last checkpoint is kept in {folder / 'checkpoint'}"
    assert _round(folder) == 4
    (folder / "scenarios.json").unlink()  # as where a training began before they were kept
    assert train(_config(), folder, Watcher(), resume=True)
    _assert_the_same(trained, folder)
    assert (folder / "scenarios.json").read_text() == (trained / "scenarios.json").read_text()
    assert [row["steps"] for row in _curves(trained)["progress"]] == ["100", "200", "300"]


def test_ctrl_c_in_the_last_round_comes_after_the_work(late: tuple[Path, list[str]]):
    """Its numbers are those without it: the test above."""
    _, notes = late
    assert notes[0] == "interrupted, finishing this round"
    assert not [note for note in notes if "kept" in note or "--resume" in note]


def test_cut_off_in_an_evaluation_and_resumed_gives_the_same_numbers(
    trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def cut_off(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(WorkerPool, "evaluate", cut_off)
        with pytest.raises(KeyboardInterrupt):
            train(_config(), tmp_path / "cut", Watcher())
    assert train(_config(), tmp_path / "cut", Watcher(), resume=True)
    assert _curves(trained) == _curves(tmp_path / "cut")
    assert _curves(trained)["evaluation"]


def test_training_episodes_that_cannot_be_set_up_are_said_at_checkpoints(tmp_path: Path):
    """As those that begin before their arm does; the same after a stop."""
    config = _config("sac", envs=1, steps=100, checkpoint_every=50, curriculum={"distance": (40, 240)})
    said = "training episodes could not be set up or driven to their end: left out"
    whole, early, late = Watcher(), Watcher(stop_at=175), Watcher()
    assert train(config, tmp_path / "whole", whole)
    notes = [note for note in whole.notes if note.endswith(said)]
    assert len(notes) == 3, "after the seeding, and for each 50 steps"
    assert all(0 < int(lost) < int(drawn) for lost, _, drawn, *_ in map(str.split, notes))
    assert not train(config, tmp_path / "stopped", early)
    assert train(config, tmp_path / "stopped", late, resume=True)
    assert [note for note in early.notes + late.notes if note.endswith(said)] == notes
    _assert_the_same(tmp_path / "whole", tmp_path / "stopped")


def test_another_seed_gives_other_numbers(trained: Path, tmp_path: Path):
    assert train(_config(seed=1, steps=100, evaluate_every=100), tmp_path / "other", Watcher())
    assert _curves(trained)["progress"][0] != _curves(tmp_path / "other")["progress"][0]


def test_going_astray_stops_with_the_last_checkpoint_kept(tmp_path: Path):
    # The checkpoint at the end of the seeding comes before a loss this large can be seen.
    config = _config(loss_limit=1e-9, seed_steps=50)
    threads = torch.get_num_threads()
    torch.set_num_threads(4)
    with pytest.raises(TrainingError, match=r"astray at step 0: critic_loss .* kept in"):
        train(config, tmp_path / "astray", Watcher())
    after = torch.get_num_threads()
    torch.set_num_threads(threads)
    assert after == 4  # the next training has as many
    assert load_learnt(tmp_path / "astray" / "checkpoint").trained["steps"] == 0


@pytest.mark.parametrize("name", ["critic_loss", "policy_loss", "value", "policy_gradient", "multiplier"])
def test_what_counts_as_astray(name: str):
    good = LagrangianStatistics(**{field.name: -3.0 for field in fields(LagrangianStatistics)})
    assert not astray(good, 10.0)
    for bad in (float("nan"), float("inf"), -11.0):
        assert astray(replace(good, **{name: bad}), 10.0)


def test_a_round_in_which_every_episode_failed_says_nothing_of_sigma():
    Trainer._measure(Trainer.__new__(Trainer), ())


def test_a_folder_keeps_its_training(trained: Path):
    with pytest.raises(InputError, match="holds a training already"):
        train(_config(), trained, Watcher())
    with pytest.raises(InputError, match="other settings"):
        train(_config(seed=5), trained, Watcher(), resume=True)
    assert stored_config(trained) == _config()
    assert train(_config(), trained, Watcher(), resume=True)  # nothing is left to do


def test_only_an_empty_folder_is_taken(trained: Path, tmp_path: Path):
    """A checkpoint that was copied is no training of that folder, nor is a sweep."""
    shutil.copytree(trained / "checkpoint", tmp_path / "copy" / "checkpoint")
    for resume in (False, True):
        with pytest.raises(InputError, match=r"is not empty \(checkpoint\) and holds no training .* another"):
            train(_config(seed=5), tmp_path / "copy", Watcher(), resume=resume)
    (tmp_path / "copy" / "config.json").write_text(config_text(_config(seed=5)))
    with pytest.raises(InputError, match=r"with another training\.seed: take it out of the folder"):
        train(_config(seed=5), tmp_path / "copy", Watcher(), resume=True)
    assert sorted(os.listdir(tmp_path / "copy")) == ["checkpoint", "config.json"]


def test_one_training_at_a_time_writes_to_a_folder(trained: Path):
    with held(trained, print), pytest.raises(InputError, match="another rudc is writing to"):
        train(_config(), trained, Watcher(), resume=True)


def test_a_training_goes_on_from_the_scenarios_that_it_began_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "elsewhere").mkdir()
    own, folder = tmp_path / "own.yaml", tmp_path / "own"
    text = "name: own\nextends: random_destination\ntraffic: {density: 10}\n"
    own.write_text(text)
    config = _config(scenario="own.yaml", curriculum=None, evaluate_on=("own.yaml",), steps=100)
    monkeypatch.chdir(tmp_path)
    assert not train(config, folder, Watcher(stop_at=100))
    monkeypatch.chdir(tmp_path / "elsewhere")
    for there in (own, Path("own.yaml")):  # a file of that name here is not the one that is meant
        there.write_text(text.replace("10", "60"))
        if there == own:
            with pytest.raises(InputError, match=r"has changed since it began: own\.yaml\. Put it back"):
                train(config, folder, Watcher(), resume=True)
            own.write_text(text)
    assert train(config, folder, Watcher(), resume=True)
    assert [row["scenario"] for row in _curves(folder)["evaluation"]][:1] == ["own"]
    for name in ("config.json", "checkpoint/agent.json"):
        assert str(tmp_path) not in (folder / name).read_text()


def test_a_trained_folder_is_an_agent(trained: Path):
    agent = make_agent(str(trained))
    assert agent.name == str(trained)
    assert "without a safety filter. Learnt in 300 steps with seed 0." in agent_summary(str(trained))
    assert agent_settings(f"{trained}+ttcbf")["correction"]["rule"] == "ttcbf"
    assert make_agent(f"{trained}+ttcbf").name == f"{trained}+ttcbf"
    json.dumps(agent_settings(str(trained)))
    low, high = load_learnt(trained / "checkpoint").percentiles or (0.0, 0.0)
    assert 0 < low <= high


def test_checkpoints_that_cannot_drive_are_refused(trained: Path, tmp_path: Path):
    shutil.copytree(trained / "checkpoint", tmp_path / "copy")
    file = tmp_path / "copy" / "agent.json"
    text = file.read_text()
    file.write_text(text.replace('"algorithm": "rudc-wo-cbf"', '"algorithm": "sak"'))
    with pytest.raises(AgentError, match="there is no algorithm 'sak'"):
        make_agent(str(tmp_path / "copy"))
    file.write_text(text.replace('"observation": "conflict"', '"observation": "paper"'))
    with pytest.raises(AgentError, match="weights do not fit its settings"):
        make_agent(str(tmp_path / "copy"))


def test_nobody_trains_on_what_is_not_there(tmp_path: Path):
    with pytest.raises(InputError, match="device 'nowhere'"):
        train(_config(device="nowhere"), tmp_path / "a", Watcher())
    assert stored_config(tmp_path / "a") is None  # the folder can be used with another device
    for wrong in ({"scenario": "no_such_scenario"}, {"evaluate_on": ("no_such_scenario",)}):
        with pytest.raises(InputError, match=r"no_such_scenario: no shipped scenario"):
            train(_config("rudc-wo-cbf", **wrong), tmp_path / "b", Watcher())
    with pytest.raises(InputError, match=r"density_sweep sweeps traffic\.density, and held-out episodes"):
        train(_config(evaluate_on=("density_sweep",)), tmp_path / "b", Watcher())
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize("error", [RuntimeError, AssertionError])
def test_an_error_in_a_learner_is_not_its_devices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error):
    def wrong(*_: object) -> None:
        raise error("not that shape")

    monkeypatch.setattr("rudc.learning.sac.SacLearner.__init__", wrong)
    with pytest.raises(error, match=r"^not that shape$"):
        Trainer(_config("sac"), tmp_path, Watcher())


class Saboteur(Watcher):
    """Ends a worker process after the first round."""

    def advance(self, steps: int) -> None:
        for process in multiprocessing.active_children():
            process.kill()


def test_a_worker_that_dies_ends_the_training(tmp_path: Path):
    with pytest.raises(TrainingError, match=r"rudc-worker-0 has died"):
        train(_config(envs=1), tmp_path / "dead", Saboteur())


def test_a_training_that_is_interrupted_as_it_begins_leaves_no_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def cut_off(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(WorkerPool, "_answers", cut_off)
    with pytest.raises(KeyboardInterrupt):
        train(_config(), tmp_path / "cut", Watcher())
    assert not [one for one in multiprocessing.active_children() if one.name.startswith("rudc-worker")]


@pytest.mark.parametrize("algorithm", [name for name in ALGORITHMS if name not in ALIKE])
def test_each_algorithm_trains_100_steps_the_same_twice_and_drives(tmp_path: Path, algorithm: str):
    """The second time stopped and resumed. The replay holds half of the steps; episodes end before and after
    the checkpoint between.
    """
    short = tmp_path / "short.yaml"
    short.write_text("name: short\nextends: random_destination\nepisode: {timeout: 2}\n")
    config = _config(
        algorithm, envs=1, steps=100, seed_steps=50, round_decisions=25, update_every=10, replay_size=50,
        checkpoint_every=50, evaluate_every=100, log_every=50,
        scenario=str(short), curriculum=None, evaluate_on=(str(short),),
    )  # fmt: skip
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    assert train(config, whole, Watcher())
    assert not train(config, stopped, Watcher(stop_at=125))  # a round after the checkpoint
    assert _round(stopped) == config.seed_rounds + 2
    assert train(config, stopped, Watcher(), resume=True)
    _assert_the_same(whole, stopped)
    rows = _curves(whole)["progress"]
    assert [row["steps"] for row in rows] == ["50", "100"]
    assert rows[-1]["updates"] == "13"  # the second round of seeding is learnt from, too; 2.5 in each round
    assert config.given.updates == 13
    assert all(int(row["episodes"]) >= 2 for row in rows)
    assert ("multiplier" in rows[-1]) is (algorithm in ("sac-lagrangian", "fac"))
    _assert_a_whole_agent(whole, config)


def _assert_a_whole_agent(folder: Path, config: TrainConfig) -> None:
    """It drives, its weights are learnt, and it has what its critics and its correction need."""
    learnt = load_learnt(folder / "checkpoint")
    assert learnt.config == config.agent
    assert make_agent(str(folder)).name == str(folder)
    first = config.entry.kind(config.algorithm)(config.learner, config.given, "cpu").weights()
    assert any(not np.array_equal(learnt.arrays[name], first[name]) for name in first if "policy/" in name)
    states = "sigma" in config.learner.offers
    assert (learnt.percentiles is not None) is states
    assert all((row["sigma_l"] != "") is states for row in _curves(folder)["progress"])
    if not states:
        with pytest.raises(AgentError, match="states no sigma"):
            calibrate(folder / "checkpoint", ("random_destination",), 1, advance=int)
    residual = isinstance(config.correction, CbfSettings) and bool(config.correction.residual)
    shipped = {f"residual/{name}": array for name, array in shipped_predictor().arrays.items()}
    assert {name for name in learnt.arrays if name.startswith("residual/")} == (
        shipped.keys() if residual else set()
    )
    for name, array in shipped.items() if residual else ():
        np.testing.assert_array_equal(learnt.arrays[name], array)


def test_the_final_policy_is_calibrated_as_it_drives(trained: Path, tmp_path: Path):
    """sigma_l and sigma_h of the stored agent are those of the held-out episodes, of both kinds, and
    calibrating again, which changes nothing here where no slack depends on them, finds the same.
    """
    shutil.copytree(trained / "checkpoint", tmp_path / "copy")
    before = load_learnt(tmp_path / "copy").percentiles
    found = calibrate(tmp_path / "copy", ("random_destination",), 1, advance=int)
    save_learnt(tmp_path / "copy", found.learnt)
    for limits in found.kinds.values():
        assert limits.found == pytest.approx(limits.before, rel=1e-4)
        assert limits.above == pytest.approx((0.05, 0.025), abs=0.02)
    assert found.kinds["paper"].before == before
    assert found.decisions > 20
    with pytest.raises(InputError, match="density_sweep sweeps"):
        calibrate(tmp_path / "copy", ("density_sweep",), 1, advance=int)
    make_agent(f"{tmp_path / 'copy'}:sigma=route")  # which needs what is usual along the route
    other = calibrate(tmp_path / "copy", ("dense_left_turn",), 1, advance=int)
    save_learnt(tmp_path / "copy", other.learnt)
    assert load_learnt(tmp_path / "copy").percentiles == other.kinds["paper"].found != before
