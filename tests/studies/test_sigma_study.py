"""The sigma study: what is positive, what it measures, and that it drives, keeps and resumes."""

import math
from functools import partial

import numpy as np
import pytest

from rudc.errors import InputError, StorageError
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.studies import sigma_study
from rudc.studies.auroc import auroc
from rudc.studies.base import Order
from rudc.studies.sigma_study import HORIZON, Drive, ListeningRunner, measure, questions, run, sigma_file

TASKS = ("random_destination", "dense_left_turn")


def made(scenario: str, level: float, *, violated: bool = False, steps: int = 40, seed: int = 0) -> Drive:
    """An episode whose sigmas are near a level, total rising in the last two seconds of a violation."""
    sigmas = level + 0.1 * np.random.default_rng(seed).normal(size=(steps, 3))
    if violated:
        sigmas[-HORIZON:, 2] += 10.0
    return Drive(scenario, violated, sigmas)


def some_drives(shift: float = 0.0) -> list[Drive]:
    inside = [made(name, 1.0 + shift, seed=k) for name in TASKS for k in range(6)]
    strange = [made("fog", 2.0 + shift, violated=k < 3, seed=10 + k) for k in range(6)]
    return [*inside, *strange, *(made("calm", 1.0 + shift, seed=20 + k) for k in range(6))]


def test_each_question_is_answered():
    lines = measure({"a": some_drives()})
    found = {(m["task"], m["scenarios"], m["sigma"]): m for m in lines}
    assert len(found) == len(lines) == 3 * len(questions([*TASKS, "fog", "calm"]))
    fog = found["ood", "fog", "epistemic"]
    assert fog["auroc"] == 1.0
    assert (fog["episodes"], fog["positive_episodes"], fog["positive_decisions"]) == (18, 6, 240)
    calm = found["ood", "calm", "epistemic"]
    assert 0.4 < calm["auroc_low"] < calm["auroc"] < calm["auroc_high"] < 0.6
    soon = found["violation", "fog", "total"]
    assert soon["auroc"] == 1.0
    assert soon["positive_decisions"] == 3 * HORIZON
    assert found["violation", "fog", "aleatoric"]["auroc"] < 0.6
    assert math.isnan(found["violation", "calm", "total"]["auroc"])


def test_training_seeds_are_averaged_not_mixed():
    lines = measure({"a": some_drives(), "a-seed1": some_drives(shift=50.0)})
    asked = [m for m in lines if (m["task"], m["scenarios"], m["sigma"]) == ("ood", "fog", "aleatoric")]
    fog = {m["agent"] + "*" * m["mean_of_seeds"]: m for m in asked}
    assert sorted(fog) == ["a", "a*", "a-seed1"]
    assert fog["a*"]["auroc"] == pytest.approx(1.0)
    assert fog["a*"]["episodes"] == 2 * fog["a-seed1"]["episodes"]


def test_it_drives_listens_and_resumes(monkeypatch, tmp_path):
    import rudc.studies.sigma_study as module

    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    monkeypatch.setattr(module, "out_of_distribution", lambda _: module.in_distribution()[:0])
    monkeypatch.setattr(module, "in_distribution", partial(_only, "random_destination"))
    order = Order(tmp_path / "s", agents=("rudc-wo-cbf",), episodes=1, seed=3)
    report = run(order, lambda _: Silent())
    assert [path.name for path in report.files] == ["sigma.csv", "sigma.md", "sigma.png"]
    assert not report.errors
    (row,) = read_table(tmp_path / "s" / "sweep" / "episodes.csv")
    stated = np.load(sigma_file(tmp_path / "s" / "sigmas", "rudc-wo-cbf", "random_destination", 3))
    assert stated.shape == (int(row["steps"]), 3)
    assert stated[:, 2].mean() == pytest.approx(float(row["mean_sigma"]), rel=1e-4)
    np.testing.assert_allclose(np.hypot(stated[:, 0], stated[:, 1]), stated[:, 2], rtol=1e-4)
    before = (tmp_path / "s" / "sigma.csv").read_bytes()
    again = run(Order(order.out, order.agents, (), 1, 3, resume=True), lambda _: Silent())
    assert again.files[0].read_bytes() == before
    sigma_file(tmp_path / "s" / "sigmas", "rudc-wo-cbf", "random_destination", 3).unlink()
    with pytest.raises(StorageError, match=r"3\.npy cannot be read"):
        run(Order(order.out, order.agents, (), 1, 3, resume=True), lambda _: Silent())


def _only(name: str):
    from rudc.scenario import find_scenarios

    return tuple(find_scenarios([name]))


def test_agents_without_uncertainty_are_refused(tmp_path):
    with pytest.raises(InputError, match="states no uncertainty"):
        run(Order(tmp_path / "x", agents=("gap-acceptance",)), lambda _: Silent())
    assert not (tmp_path / "x").exists()


def test_a_folder_that_cannot_be_written_is_an_error_of_the_episode(tmp_path):
    from rudc.evaluation.tasks import Task

    (tmp_path / "file").write_text("")
    (scenario,) = _only("random_destination")
    runner = ListeningRunner(tmp_path / "file")
    record = runner(Task(scenario, {}, "rudc-wo-cbf", 0))
    runner._run.close()
    assert "Not a directory" in record.error


def test_one_auroc_by_hand():
    drives = [made(TASKS[0], 1.0, seed=1), made("fog", 1.05, seed=2)]
    line = next(m for m in measure({"a": drives}) if m["scenarios"] == "fog" and m["sigma"] == "total")
    scores = np.concatenate([d.sigmas[:, 2] for d in drives])
    assert line["auroc"] == auroc(scores, np.repeat([False, True], 40))
    assert sigma_study.SIGMAS[2] == "total"
