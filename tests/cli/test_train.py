"""`rudc train`: what it makes of its options; training itself is tested in tests/training."""

from pathlib import Path
from typing import Any

import pytest

from rudc.training import trainer
from rudc.training.config import Curriculum, TrainConfig


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[TrainConfig, Path, bool]]:
    """What the trainer was asked for; it says that it was interrupted if the seed is 130."""
    seen: list[tuple[TrainConfig, Path, bool]] = []

    def run(config: TrainConfig, folder: Path, watcher: Any, *, resume: bool) -> bool:
        seen.append((config, folder, resume))
        watcher.advance(0)
        watcher.progress({"steps": 10, "episodes": 4, "success": 0.5, "episode_reward": 61.7, "wall_s": 3.2})
        watcher.note("a note")
        folder.mkdir(exist_ok=True)
        (folder / trainer.CONFIG).write_text(config.model_dump_json())
        return config.training.seed != 130

    monkeypatch.setattr(trainer, "train", run)
    return seen


def test_any_value_of_the_configuration_can_be_set(rudc, calls):
    said = ("train", "rudc-t", "--steps", 2000, "--set", "observation=paper", "--out", "x")
    answer = rudc(*said, "--set", "training.curriculum=null")
    assert answer.status == 0
    wanted = {"training.steps": 2000, "observation": "paper", "training.curriculum": None}
    assert calls[0][0] == TrainConfig.of("rudc-t", wanted)
    assert rudc(*said, "--resume").status == 0
    again = rudc(*said, "--set", "learner.n_step=1", "--resume")
    assert again.status == 2
    assert "holds a training with another learner.n_step: resume it as it is" in again.err
    longer = rudc("train", "--steps", 3000, "--out", "x", "--resume")
    assert "holds a training of 2000 steps: resume it as it is (without --steps)" in longer.err
    assert "learning rates fall over all its steps" in longer.err
    assert rudc("train", "rudc-e", "--configuration", "paper", "--out", "y").status == 0
    assert calls[-1][0] == TrainConfig.of("rudc-e", preset="paper")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("--set", "n_step"), "KEY=VALUE"),
        (("--set", "lerner.n_step=1"), "did you mean 'learner.n_step'"),
        (("--steps", 100, "--set", "training.steps=200"), "training.steps is given twice"),
        (("--set", "training.steps=[1"), "is not a value"),
        (("--configuration", "papr"), "did you mean 'paper'"),
    ],
)
def test_settings_that_cannot_be_are_refused(rudc, calls, wrong, said):
    answer = rudc("train", "rudc-t", *wrong, "--out", "x")
    assert answer.status == 2
    assert said in answer.err
    assert not calls


def test_options_reach_the_configuration(rudc, calls):
    answer = rudc("train", "rudc-t", "--steps", 2000, "--seed", 4, "--envs", 3, "--out", "x")
    assert answer.status == 0
    config, folder, resume = calls[0]
    assert config == TrainConfig.of(
        "rudc-t", {"training.steps": 2000, "training.seed": 4, "training.envs": 3}
    )
    assert config.training.curriculum == Curriculum()
    assert (folder, resume) == (Path("x"), False)
    assert "10/2100 steps, 50% success, reward 62, 3 s" in answer.err
    assert "a note" in answer.err
    assert "--agent x" in answer.err


@pytest.mark.parametrize(
    ("out", "called"),
    [
        ("x", "x"),
        ("./sac", "./sac"),  # `sac` is shipped, and so is the driver `follower`
        ("follower", "./follower"),
        ("mine:Mine", "./mine:Mine"),
        ("a b", "'a b'"),
    ],
)
def test_the_command_at_the_end_drives_what_was_trained(rudc, calls, out, called):
    assert f"done: rudc sweep SCENARIO --agent {called} --out DIR" in rudc("train", "sac", "--out", out).err


def test_the_command_at_the_end_imports_what_this_one_did(rudc, calls, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {"mine.events": None})
    said = rudc("train", "sac", "--out", "x").err
    assert "done: rudc --import mine.events sweep SCENARIO --agent x --out DIR" in said


def test_steps_that_are_rounded_are_said_once(rudc, calls):
    answer = rudc("train", "rudc-t", "--steps", 1, "--out", "x")
    assert answer.err.count("200 steps instead of 1: whole rounds of 200 are made\n") == 1
    assert "instead" not in rudc("train", "rudc-t", "--steps", 400, "--out", "y").err


def test_a_report_is_kept_once_the_training_has_begun(rudc, calls, tmp_path):
    answer = rudc("train", "sac", "--out", "x", "--report")
    assert answer.err.count("live page: x/report.html\n") == 1
    assert answer.err.index("live page") < answer.err.index("a note")


@pytest.mark.parametrize("bars", [False, True])
def test_of_a_folder_that_is_refused_nothing_else_is_said(rudc, tmp_path, monkeypatch, bars):
    """No report either; steps 1 would be rounded."""
    monkeypatch.setattr("rudc.cli.train.shows_bars", lambda: bars)
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "episodes.csv").write_text("")
    answer = rudc("train", "sac", "--steps", 1, "--out", "x", "--report")
    assert answer.status == 2
    assert answer.err.startswith("error: x is not empty (episodes.csv)")
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["episodes.csv"]


def test_a_scenario_is_trained_on_as_it_is(rudc, calls):
    rudc("train", "rudc-wo-cbf", "--scenario", "dense_left_turn", "--out", "x")
    assert (calls[0][0].training.scenario, calls[0][0].training.curriculum) == ("dense_left_turn", None)


def test_resuming_takes_the_settings_from_the_folder(rudc, calls):
    assert rudc("train", "rudc-e", "--seed", 130, "--steps", 400, "--out", "x").status == 130
    assert rudc("train", "--out", "x", "--resume").status == 130
    assert rudc("train", "rudc-e", "--steps", 400, "--out", "x", "--resume").status == 130
    assert calls[0][0] == calls[1][0] == calls[2][0]
    for other in (("rudc-t",), ("rudc-e", "--steps", "600")):
        answer = rudc("train", *other, "--out", "x", "--resume")
        assert answer.status == 2
        assert "resume it as it is" in answer.err


def test_the_command_that_began_a_training_resumes_it(rudc, calls):
    """The scenario takes the curriculum away, and the setting gives one of its own."""
    said = ("train", "sac", "--scenario", "dense_left_turn", "--out", "x", "--resume")
    density = ("--set", "training.curriculum.density=[10, 20]")
    assert rudc(*said, *density).status == rudc(*said, *density).status == 0
    assert calls[0][0] == calls[1][0]
    other = rudc(*said, "--set", "training.curriculum.density=[10, 30]")
    assert other.status == 2
    assert "training.curriculum.density: resume it as it is" in other.err


def test_what_of_a_configuration_has_no_effect_is_said(rudc, calls, tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "correction: {d_safe: 0.2}\nlearner: {distortion: cvar, distortion_parameter: 0.1, batch_size: 64}\n"
    )
    answer = rudc("train", "rudc-t", "--configuration", "mine.yaml", "--out", "x")
    assert "mine.yaml: without effect here, and left out: learner.distortion_parameter\n" in answer.err
    assert "left out" not in rudc("train", "rudc-t", "--configuration", "paper", "--out", "y").err
    (tmp_path / "mine.yaml").write_text(
        "correction: {kind: usl, steps: 3}\nlearner: {learns_from: executed}\n"
    )
    answer = rudc("train", "rudc-t", "--configuration", "mine.yaml", "--out", "z")
    assert "left out: correction, learner.learns_from\n" in answer.err


@pytest.mark.parametrize("algorithm", ["rudc-t", "sac"])
def test_resuming_with_another_preset_is_refused(rudc, calls, tmp_path, algorithm):
    (tmp_path / "mine.yaml").write_text("learner: {n_step: 2, members: 4}\ntraining: {seed_steps: 300}\n")
    said = ("train", algorithm, "--out")
    for preset in ("default", "paper", "mine.yaml"):
        with_set = ("--steps", 4000, "--set", "learner.batch_size=64", "--configuration", preset)
        assert rudc(*said, preset + "-out", *with_set).status == 0
        assert rudc(*said, preset + "-out", *with_set, "--resume").status == 0
        for other in {"default", "paper", "mine.yaml"} - {preset}:
            answer = rudc(*said, preset + "-out", "--steps", 4000, "--configuration", other, "--resume")
            assert answer.status == 2
            assert f" than with --configuration {other}: resume it as it is" in answer.err
    assert rudc(*said, "paper-out", "--configuration", "paper", "--resume").status == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("rudc-t",), "--out DIR"),
        (("--out", "x"), "which algorithm?"),
        (
            ("--resume", "--out", "lost"),
            "which algorithm? lost holds no training to go on with; give one of rudc-t,",
        ),
        (("sak", "--out", "x"), "no algorithm 'sak' (did you mean 'sac'?); there are: rudc-t"),
        (("rudc-t", "--scenario", "nowhere", "--out", "x"), "nowhere: no shipped scenario"),
        (("rudc-t", "--device", "cuda:99", "--steps", "200", "--out", "x"), "device 'cuda:99'"),
    ],
)
def test_wrong_input_is_answered_in_words(rudc, arguments, said):
    answer = rudc("train", *arguments)
    assert answer.status == 2
    assert said in answer.err
