"""The sigma study: what is positive, what it measures, and that it drives, keeps and resumes."""

import math
from functools import partial

import numpy as np
import pytest

from rudc.errors import InputError, StorageError
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.safety.plant import ORDINARY, PlantEstimate
from rudc.studies.auroc import auroc
from rudc.studies.base import Order
from rudc.studies.sigma_steps import AT, COLUMNS, HORIZON, SigmaLog, mismatch
from rudc.studies.sigma_study import (
    SCORES,
    Drive,
    Question,
    limits_of,
    measure,
    questions,
    run,
    slack_lines,
)
from rudc.studies.step_files import StepRunner, read_steps, steps_file
from rudc.vehicle import Actuation

PAIR = ("random_destination", "dense_left_turn")


def made(
    scenario: str, level: float, *, seen: float = math.nan, steps: int = 40, seed: int = 0, event_at: int = 99
) -> Drive:
    """An episode whose sigmas are near a level. By route they rise in the last two seconds of a violation; an
    event is in sight from a step on. `seen`: nan without violation, else whether the cause could be seen.
    """
    rng = np.random.default_rng(seed)
    table = np.full((steps, len(COLUMNS)), math.nan)
    for name in SCORES[:6]:
        table[:, AT[name]] = level + 0.1 * rng.normal(size=steps)
    table[:, AT["mismatch"]] = table[:, AT["unusual"]] = 0.0
    table[:, AT["disturbed"]] = table[:, AT["exposed"]] = np.arange(steps) >= event_at
    table[:, AT["seen"]] = seen
    violated = not math.isnan(seen)
    if violated:
        table[-HORIZON:, AT["route"]] += 10.0
    return Drive(scenario, violated, table)


def some_drives(shift: float = 0.0) -> list[Drive]:
    inside = [made(name, 1.0 + shift, seed=k) for name in PAIR for k in range(6)]
    causes = (1.0, 1.0, 0.0, math.nan, math.nan, math.nan)
    strange = [made("fog", 2.0 + shift, seen=causes[k], seed=10 + k, event_at=10) for k in range(6)]
    return [*inside, *strange, *(made("calm", 1.0 + shift, seed=20 + k) for k in range(6))]


def test_each_question_is_answered():
    lines = measure({"a": some_drives()})
    found = {(m["task"], m["scenarios"], m["sigma"]): m for m in lines}
    assert len(found) == len(lines) == len(SCORES) * len(questions([*PAIR, "fog", "calm"]))
    for task, episodes in (("violation", 3), ("violation seen", 2), ("violation hidden", 1)):
        soon = found[task, "fog", "route"]
        assert soon["auroc"] == found[task, "fog", "route_or_mismatch"]["auroc"] == 1.0
        assert (soon["positive_episodes"], soon["positive_decisions"]) == (episodes, episodes * HORIZON)
        assert soon["decisions"] == episodes * HORIZON + 6 * 10  # undisturbed: before the event
        assert 0.3 < found[task, "fog", "total"]["auroc"] < 0.7
    assert math.isnan(found["violation", "calm", "total"]["auroc"])
    exposed = found["exposed", "all out of distribution", "total"]
    assert exposed["positive_decisions"] == 6 * 30
    assert exposed["auroc"] > 0.8  # fog's own undisturbed decisions are like those exposed, calm's are not
    assert ("exposed", "random_destination", "total") not in found


def test_a_car_that_is_not_ordinary_comes_before_all_sigma():
    drive = made("ice", 5.0)
    drive.steps[30:, AT["mismatch"]] = np.linspace(0.1, 0.9, 10)
    both = drive.scores()[:, SCORES.index("route_or_mismatch")]
    assert both[30:].min() > both[:30].max()
    assert np.all(np.diff(both[30:]) > 0)
    monitors = drive.scores()[:, SCORES.index("route_or_monitors")]
    assert monitors[30:].min() > monitors[:30].max()
    assert mismatch(ORDINARY) == mismatch(None) == 0.0
    icy = PlantEstimate(Actuation(0.2, 0.1, 0.15), unusual=True)
    assert mismatch(icy) == pytest.approx(0.85 + 0.3)


def test_so_does_who_behaves_unlike_ordinary_traffic():
    drive = made("ghost", 5.0)
    drive.steps[:10, AT["unusual"]] = 1.0
    monitors = drive.scores()[:, SCORES.index("route_or_monitors")]
    assert monitors[:10].min() > monitors[10:].max()
    np.testing.assert_array_equal(monitors[10:], drive.of("route")[10:])


def test_shares_of_the_slack():
    """Sigma_total below its limit in all that precede violations; above it in one in twenty inside."""
    drives = some_drives()
    inside = np.concatenate([d.of("total") for d in drives if d.scenario in PAIR])
    limit = float(np.percentile(inside, 95))
    (line, by_route) = slack_lines("a", {"total": limit, "route": 5.0}, drives)
    assert line["above_inside"] == pytest.approx(5.0, abs=0.3)
    assert line["above_inside_decisions"] == 12 * 40
    assert line["relaxed_violation"] == 0.0  # fog's level is 2, the limit about 1.2
    assert by_route["relaxed_violation_seen"] == 0.0
    (line,) = slack_lines("a", {"total": 5.0}, drives)
    assert (line["relaxed_violation_hidden"], line["relaxed_violation_hidden_decisions"]) == (100.0, HORIZON)


def test_training_seeds_are_averaged_not_mixed():
    lines = measure({"a": some_drives(), "a-seed1": some_drives(shift=50.0)})
    asked = [m for m in lines if (m["task"], m["scenarios"], m["sigma"]) == ("violation", "fog", "route")]
    fog = {m["agent"] + "*" * m["mean_of_seeds"]: m for m in asked}
    assert sorted(fog) == ["a", "a*", "a-seed1"]
    assert fog["a*"]["auroc"] == pytest.approx(1.0)
    assert fog["a*"]["episodes"] == 2 * fog["a-seed1"]["episodes"]


def test_a_mean_over_training_seeds_is_of_all_of_them_or_there_is_none():
    """One was never calibrated by route, another did not violate."""
    without = some_drives()
    for drive in without:
        drive.steps[:, AT["route"]] = math.nan
    safe = [drive._replace(violated=False) for drive in some_drives()]
    lines = measure({"a": some_drives(), "a-seed1": without, "b": some_drives(), "b-seed1": safe})
    fog = [m for m in lines if (m["task"], m["scenarios"]) == ("violation", "fog")]
    means = {(m["family"], m["sigma"]): m for m in fog if m["mean_of_seeds"]}
    ends = ("auroc", "auroc_low", "auroc_high")
    assert all(math.isfinite(means["a", "total"][key]) for key in ends)
    assert all(
        math.isnan(means[lacking][key]) for lacking in (("a", "route"), ("b", "total")) for key in ends
    )
    single = {m["agent"]: m["auroc"] for m in fog if m["sigma"] == "route" and not m["mean_of_seeds"]}
    assert single == pytest.approx({"a": 1, "a-seed1": math.nan, "b": 1, "b-seed1": math.nan}, nan_ok=True)


def test_it_drives_listens_and_resumes(monkeypatch, tmp_path):
    import rudc.studies.sigma_study as module

    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    monkeypatch.setattr(module, "out_of_distribution", lambda _: module.in_distribution()[:0])
    monkeypatch.setattr(module, "in_distribution", partial(_only, "random_destination"))
    order = Order(tmp_path / "s", agents=("rudc-wo-cbf",), episodes=1, seed=3)
    report = run(order, lambda _: Silent())
    assert [path.name for path in report.files] == ["sigma.csv", "sigma_slack.csv", "sigma.md", "sigma.png"]
    assert not report.errors
    (row,) = read_table(tmp_path / "s" / "sweep" / "episodes.csv")
    ((_, stated),) = read_steps(tmp_path / "s" / "steps", [row], SigmaLog.columns)
    assert stated.shape == (int(row["steps"]), len(COLUMNS))
    total = stated[:, AT["total"]]
    assert total.mean() == pytest.approx(float(row["mean_sigma"]), rel=1e-4)
    np.testing.assert_allclose(
        np.hypot(stated[:, AT["epistemic"]], stated[:, AT["aleatoric"]]), total, rtol=1e-4
    )
    assert not stated[:, AT["disturbed"]].any()
    assert np.isnan(stated[:, AT["seen"]]).all() == (row["outcome"] in ("success", "frozen"))
    (share, *_) = read_table(tmp_path / "s" / "sigma_slack.csv")
    assert float(share["sigma_l"]) == pytest.approx(limits_of("rudc-wo-cbf")["total"])
    before = (tmp_path / "s" / "sigma.csv").read_bytes()
    monkeypatch.setattr(module, "limits_of", lambda _: {})
    again = run(Order(order.out, order.agents, (), 1, 3, resume=True), lambda _: Silent())
    assert [path.name for path in again.files] == ["sigma.csv", "sigma.md", "sigma.png"]
    assert not (order.out / "sigma_slack.csv").exists()
    assert "sigma_l" not in again.table
    assert again.files[0].read_bytes() == before
    steps_file(tmp_path / "s" / "steps", "rudc-wo-cbf", "random_destination", 3).unlink()
    with pytest.raises(StorageError, match=r"3\.npy cannot be read"):
        run(Order(order.out, order.agents, (), 1, 3, resume=True), lambda _: Silent())


@pytest.mark.parametrize("told", ["Uncertainty(scene.time_s, 0.0, scene.time_s)", "None"])
def test_an_agent_of_ones_own_is_heard(monkeypatch, tmp_path, told):
    """Whether it states its uncertainty is known once it drives."""
    import rudc.studies.sigma_study as module

    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    monkeypatch.setattr(module, "out_of_distribution", lambda _: ())
    monkeypatch.setattr(module, "in_distribution", partial(_only, "random_destination"))
    (tmp_path / "doubtful.py").write_text(DOUBTFUL.replace("TOLD", told), encoding="utf-8")
    order = Order(tmp_path / "s", agents=(f"{tmp_path / 'doubtful.py'}:Doubtful",), episodes=1, seed=3)
    if told == "None":
        with pytest.raises(InputError, match="Doubtful states no uncertainty"):
            run(order, lambda _: Silent())
    else:
        assert not run(order, lambda _: Silent()).errors
        assert {line["sigma"] for line in read_table(order.out / "sigma.csv")} == set(SCORES)
        assert not (order.out / "sigma_slack.csv").exists()


DOUBTFUL = """
from rudc.agents.base import unfiltered
from rudc.env.tracking import steering
from rudc.learning.uncertainty import Uncertainty


class Doubtful:
    def reset(self, scene, seed):
        pass

    def act(self, scene):
        decision = unfiltered(4.0 - scene.ego.v, steering(scene))
        return decision._replace(uncertainty=TOLD)
"""


def test_what_an_event_does_is_in_the_steps(tmp_path):
    """A truck stands on the way from the start: it is ahead and near at some step, and no car is unusual."""
    from rudc.evaluation.tasks import Task

    (scenario,) = _only("stalled_truck")
    runner = StepRunner(tmp_path, SigmaLog)
    assert not runner(Task(scenario, {}, "planner", 0)).error
    runner.close()
    row = {"agent": "planner", "scenario": "stalled_truck", "seed": "0", "error": ""}
    ((_, steps),) = read_steps(tmp_path, [row], SigmaLog.columns)
    assert steps[:, AT["exposed"]].any()
    assert steps[-1, AT["exposed"]] == 0  # past it
    assert np.all(steps[:, AT["disturbed"]] >= steps[:, AT["exposed"]])
    assert not steps[:, AT["mismatch"]].any()
    np.testing.assert_array_equal(steps[:, AT["unusual"]] > 0, steps[:, AT["exposed"]] > 0)


def _only(name: str):
    from rudc.scenario import find_scenarios

    return tuple(find_scenarios([name]))


@pytest.mark.parametrize("name", ["gap-acceptance", "sac", "sac+ttcbf:outlook.course=true"])
def test_agents_without_uncertainty_are_refused_before_anything_is_driven(tmp_path, name):
    with pytest.raises(InputError, match="states no uncertainty"):
        run(Order(tmp_path / "x", agents=("rudc-t", name), budget="quick", episodes=1), lambda _: Silent())
    assert not (tmp_path / "x").exists()


def test_a_folder_that_cannot_be_written_is_an_error_of_the_episode(tmp_path):
    from rudc.evaluation.tasks import Task

    (tmp_path / "file").write_text("")
    (scenario,) = _only("random_destination")
    runner = StepRunner(tmp_path / "file", SigmaLog)
    record = runner(Task(scenario, {}, "rudc-wo-cbf", 0))
    runner.close()
    assert "Not a directory" in record.error


def test_one_auroc_by_hand():
    drives = [made("fog", 1.0, seed=1), made("fog", 1.05, seed=2, seen=1.0)]
    lines = measure({"a": drives})
    line = next(m for m in lines if (m["task"], m["scenarios"], m["sigma"]) == ("violation", "fog", "total"))
    scores = np.concatenate([d.of("total") for d in drives])
    assert line["auroc"] == auroc(scores, np.arange(80) >= 60)
    assert Question("exposed", "fog", frozenset({"fog"})).positive(drives[0]).sum() == 0
