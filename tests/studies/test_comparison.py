"""Comparisons of trainings: their files, their tables and claims, and one from training to tables."""

import csv
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import rudc.evaluation.paper
from rudc.agents.checkpoint import shipped_checkpoints
from rudc.errors import InputError, SweepError
from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.evaluation.tables import make_table
from rudc.scenario import find_scenarios
from rudc.studies import comparison
from rudc.studies.base import Order
from rudc.studies.campaign import METRIC, OUTSIDE, Campaign, Effort, Row, read_campaign
from rudc.studies.claims import HELD, NOT_HELD, NOT_MEASURED, Verdict, claims_markdown, judge
from rudc.studies.outcomes import Outcomes
from rudc.studies.seed_tables import lines_of, metrics_markdown, pair_lines, paper_lines
from rudc.studies.trained import fitting
from rudc.training.config import TrainConfig
from tests.studies.test_trained import TINY

PAPER = Path(rudc.evaluation.paper.__file__).with_name("paper.csv")
FOG = {"fog": ("fog",)}
SMALL = {
    **TINY, "training.steps": 100, "training.evaluate_every": 100, "training.evaluation_episodes": 1,
    "training.evaluate_on": ("random_destination",), "training.calibration_episodes": 1, "training.envs": 1,
}  # fmt: skip
"""what is trained is not what is looked at; the quick budget's, and what is drawn: test_quick.py"""
SHORT = {"episode.timeout": 2}
"""nor is how episodes end"""


def drove(outcomes: Outcomes, row: str, ends: str, *, seed: int = 0, scenario: str = "fog", speed: float = 6):
    """Take in a training whose episodes ended in s(uccess), f(rozen), c(ollision) or e(rror)."""
    words = {"s": "success", "f": "frozen", "c": "collision", "e": ""}
    outcomes.add(
        row,
        seed,
        [
            {
                **dict.fromkeys(COLUMNS, "1"),
                "scenario": scenario,
                "seed": str(k),
                "outcome": words[end],
                "error": "no" if end == "e" else "",
                "mean_speed_mps": str(speed + 0.01 * (k % 3)),
            }
            for k, end in enumerate(ends)
        ],
    )


def campaign(*claims: dict) -> Campaign:
    """Rows rudc-t, sac, dsac and usl."""
    rows = [{"name": n, "algorithm": n} for n in ("sac", "dsac", "usl", "rudc-t")]
    values = {"paper": "comparison", "reference": "rudc-t", "rows": rows, "budgets": {}}
    source = {"says": "it does", "source": "Sec. X", "where": ("fog",)}
    return Campaign.model_validate({"name": "x", **values, "claims": [{**source, **c} for c in claims]})


def verdicts(outcomes: Outcomes, *claims: dict) -> list[Verdict]:
    return judge(campaign(*claims), outcomes, FOG)


@pytest.mark.parametrize("name", ["comparison", "ablation"])
def test_a_campaign_has_every_row_of_the_papers_table(name):
    found = read_campaign(name)
    text = PAPER.read_text(encoding="utf-8").splitlines()
    theirs = {row["agent"] for row in csv.DictReader(text) if row["table"] == name}
    assert {row.in_paper for row in found.rows if row.in_paper} == theirs
    assert list(found.budgets) == ["quick", "full", "paper"]
    settings = [found.budgets[budget].settings for budget in ("quick", "full")]
    assert settings[0]["training.steps"] < settings[1]["training.steps"] == 100_000


@pytest.mark.parametrize("name", ["comparison", "ablation"])
def test_every_row_can_be_trained_and_driven_as_it_says(name):
    found = read_campaign(name)
    for row in found.rows:
        for effort in found.budgets.values():
            row.wanted.config(fitting(effort.settings, row.wanted))
        TrainConfig.of(row.algorithm, row.drive)


def test_rows_are_chosen_by_name_and_drive_as_they_say():
    found = read_campaign("ablation")
    (row,) = found.chosen(("rudc-t-wo-course",))
    assert row.wanted.name == "rudc-t"
    assert row.agent("./rudc-t-seed0") == "./rudc-t-seed0:outlook.course=false"
    own = next(r for r in found.rows if r.name == "rudc-t-wo-priors")
    assert (own.wanted.name, own.in_paper) == ("rudc-t-wo-priors", "")
    with pytest.raises(InputError, match="did you mean 'rudc-t'"):
        found.chosen(("rudct",))
    assert Effort(seeds=(0,), steps=1, episodes=100, outside=10).with_episodes(25).outside == 3


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"row": "sac", "metric": "VR", "rule": "more"}, "needs `than`"),
        ({"row": "sak", "metric": "VR", "rule": "first"}, "no row 'sak'"),
        ({"row": "sac", "metric": "SR", "rule": "gap", "than": ("usl",)}, "two places"),
    ],
)
def test_a_claim_that_cannot_be_judged_is_refused(values, said):
    with pytest.raises(ValueError, match=said):
        campaign(values)


def test_a_row_that_is_only_ours_is_not_among_those_that_the_paper_compares():
    data = read_campaign("ablation").model_dump()
    claim = next(claim for claim in data["claims"] if claim["rule"] == "first")
    claim["without"] = [name for name in claim["without"] if name != "rudc-t-wo-course"]
    with pytest.raises(ValueError, match="no row 'rudc-t-wo-course'; name it in `without`"):
        Campaign.model_validate(data)


def test_rows_are_compared_in_the_episodes_and_training_seeds_that_both_have():
    outcomes = Outcomes()
    drove(outcomes, "rudc-t", "s" * 30)
    drove(outcomes, "rudc-t", "s" * 30, seed=1)
    drove(outcomes, "sac", "c" * 20 + "s" * 9 + "e")
    pair = outcomes.paired("sac", "rudc-t", METRIC["VR"], ("fog",))
    assert pair is not None
    assert (pair.pairs, pair.more, pair.less) == (29, 20, 0)
    assert pair.change == pytest.approx(100 * 20 / 29)
    assert outcomes.paired("sac", "dsac", METRIC["VR"], ("fog",)) is None
    assert outcomes.errors("sac", ("fog",)) == 1
    assert outcomes.over_seeds("rudc-t", METRIC["SR"], ("fog",)).seeds == 2
    (lead,) = outcomes.lead("rudc-t", ("sac",), METRIC["SR"], ("fog",)).values()
    assert np.bincount(lead.astype(int), minlength=101)[[0, 100]].tolist() == [9, 20]


def test_any_two_rows_are_paired():
    outcomes = Outcomes()
    for name in ("rudc-t", "sac", "usl"):
        drove(outcomes, name, "s" * 9 + ("c" if name == "sac" else "s"))
    lines = pair_lines(campaign().rows, "rudc-t", outcomes, FOG)
    found = {(m["row"], m["against"]): [] for m in lines}
    for line in lines:
        found[line["row"], line["against"]].append(line["metric"])
    assert found["sac", "rudc-t"] == ["SR", "VR", "FR", "AER", "AES", "min_DTC"]
    assert found["sac", "usl"] == ["SR", "VR", "FR"]
    assert len(found) == 3  # dsac did not drive
    (line,) = (m for m in lines if (m["row"], m["against"], m["metric"]) == ("sac", "usl", "VR"))
    assert (line["change"], line["more"], line["less"], line["p"]) == (10.0, 1, 0, 1.0)


def test_claims_of_more_and_less():
    outcomes = Outcomes()
    drove(outcomes, "rudc-t", "s" * 40)
    drove(outcomes, "sac", "c" * 15 + "s" * 25)
    drove(outcomes, "dsac", "c" * 1 + "s" * 39)
    more = {"rule": "more", "metric": "VR", "than": ["rudc-t"]}
    found = verdicts(
        outcomes,
        {**more, "row": "sac"},
        {**more, "row": "dsac"},
        {**more, "row": "usl"},
        {"rule": "less", "row": "rudc-t", "metric": "VR", "than": ["sac"]},
        {"rule": "less", "row": "sac", "metric": "VR", "than": ["rudc-t"]},
    )
    assert [v.verdict for v in found] == [HELD, NOT_HELD, NOT_MEASURED, HELD, NOT_HELD]
    assert found[0].figures.startswith("VR +37.5 [")
    assert (found[0].seeds, found[2].figures) == (1, "no episodes of USL")


def test_the_first_is_clear_of_all_that_drive():
    outcomes = Outcomes()
    drove(outcomes, "rudc-t", "s" * 50)
    drove(outcomes, "sac", "c" * 20 + "s" * 30)
    drove(outcomes, "usl", "f" * 50)
    first = {"rule": "first", "row": "rudc-t", "metric": "VR"}
    (alone,) = verdicts(outcomes, first)
    assert alone.verdict == HELD
    assert "they freeze: USL" in alone.figures
    assert "without DSAC, which did not drive" in alone.figures
    drove(outcomes, "dsac", "s" * 50, seed=1)
    (apart,) = verdicts(outcomes, first)
    assert apart.figures.endswith("without DSAC, which finished none of the same episodes")
    drove(outcomes, "dsac", "s" * 50)
    (level,) = verdicts(outcomes, first)
    assert (level.verdict, "not clearly apart from DSAC" in level.figures) == (NOT_HELD, True)
    (left_out,) = verdicts(outcomes, {**first, "without": ["dsac"]})
    assert left_out.verdict == HELD
    (behind,) = verdicts(outcomes, {**first, "row": "sac", "metric": "SR"})
    assert "behind DSAC, RUDC-T" in behind.figures
    (frozen,) = verdicts(outcomes, {**first, "row": "usl"})
    assert (frozen.verdict, "freezes itself" in frozen.figures) == (NOT_HELD, True)


def test_a_gap_that_one_training_of_three_makes_is_not_clear():
    outcomes = Outcomes()
    for scenario, failed in (("fog", (2, 2, 2)), ("ice", (30, 2, 2))):
        for seed, number in enumerate(failed):
            drove(outcomes, "rudc-t", "s" * 60, scenario=scenario, seed=seed)
            drove(outcomes, "sac", "c" * number + "s" * (60 - number), scenario=scenario, seed=seed)
    gap = {"rule": "gap", "row": "rudc-t", "metric": "SR", "than": ["sac"], "where": ("fog", "ice")}
    (verdict,) = judge(campaign(gap), outcomes, {"fog": ("fog",), "ice": ("ice",)})
    assert (verdict.verdict, verdict.seeds) == (NOT_HELD, 3)
    assert "change 15.6 [-" in verdict.figures


def test_a_gap_is_larger_where_the_leads_differ_clearly():
    outcomes = Outcomes()
    for scenario, failed in (("fog", 2), ("ice", 30)):
        drove(outcomes, "rudc-t", "s" * 60, scenario=scenario)
        drove(outcomes, "sac", "c" * failed + "s" * (60 - failed), scenario=scenario)
    gap = {"rule": "gap", "row": "rudc-t", "metric": "SR", "than": ["sac", "dsac"]}
    places = {"fog": ("fog",), "ice": ("ice",)}
    (wider,) = judge(campaign({**gap, "where": ("fog", "ice")}), outcomes, places)
    assert (wider.verdict, "without DSAC" in wider.figures) == (HELD, True)
    (narrower,) = judge(campaign({**gap, "where": ("ice", "fog")}), outcomes, places)
    assert narrower.verdict == NOT_HELD
    (nowhere,) = judge(campaign({**gap, "where": ("fog", "rain")}), outcomes, places)
    assert nowhere.verdict == NOT_MEASURED
    alone = Outcomes()
    drove(alone, "rudc-t", "s" * 60)
    (nobody,) = judge(campaign({**gap, "where": ("fog", "ice")}), alone, places)
    assert nobody.verdict == NOT_MEASURED
    assert "20 % of the episodes" in claims_markdown([wider])


def test_a_row_without_episodes_stands_in_the_tables_as_missing():
    outcomes = Outcomes()
    drove(outcomes, "sac", "s" * 9 + "c", scenario="random_destination")
    drove(outcomes, "sac", "s" * 10, scenario="random_destination", seed=1)
    rows = (Row(name="sac", algorithm="sac"), Row(name="usl", algorithm="usl"))
    place = {"random_destination": ("random_destination",)}
    lines = lines_of(rows, outcomes, place)
    assert (lines[0]["SR_mean"], lines[0]["SR_std"]) == pytest.approx((95.0, 50**0.5))
    sac, usl = metrics_markdown(lines).splitlines()[2:]
    assert "95.0 (7.1) [" in sac
    assert usl.count("–") == 9
    beside = paper_lines(read_campaign("comparison"), rows, lines)
    sources = [(m["title"], m["source"]) for m in beside]
    assert sources == [("SAC", "ours"), ("SAC", "paper"), ("USL", "ours"), ("USL", "paper")]
    assert beside[1]["SR_mean"] == 75.4
    assert not pair_lines(rows, "usl", outcomes, place)


@pytest.mark.slow
def test_from_training_to_tables(tmp_path, monkeypatch):
    """And the same again with --resume; trainings made before are taken, what is missing is said, and sweeps
    of a row that two studies share are taken from one to the other.
    """
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    monkeypatch.setattr(Effort, "settings", SMALL)
    monkeypatch.setattr(comparison, "draw_curves", not_drawn)
    monkeypatch.setattr("rudc.studies.base.find_scenarios", partial(find_scenarios, overrides=SHORT))
    order = Order(tmp_path / "a", agents=("sac", "rudc-t"), episodes=1, budget="quick")
    report = comparison.run(order, lambda _: Silent())
    assert not report.errors
    steps = {(m["row"], m["steps"]) for m in read_table(tmp_path / "a" / "trainings.csv")}
    assert steps == {("sac", "100"), ("rudc-t", "100")}
    metrics = read_table(tmp_path / "a" / "metrics.csv")
    assert {m["place"] for m in metrics} > {"random_destination", "dense_left_turn", OUTSIDE}
    for name in ("curves.csv", "claims.md", "against_paper.csv", "pairs.csv"):
        assert (tmp_path / "a" / name).stat().st_size > 100
    rows, parameters = read_sweep(tmp_path / "a" / "in_distribution")
    assert parameters == ("training_seed",)
    table = make_table(rows, ("scenario", "agent"), against="paper")
    assert table.index("| sac ") < table.index("| SAC (paper) ")
    assert comparison.run(replace(order, resume=True), nothing_is_driven) == report
    made = tmp_path / "a" / "trainings"
    more = Order(
        tmp_path / "a", ("sac", "usl", "rudc-t"), episodes=1, budget="quick", trainings=made, resume=True
    )
    other = comparison.run(more, nothing_is_driven)
    assert other.notes[0] == "usl-seed0: no training there"
    assert "usl-seed0: no training there" in other.table
    shutil.copytree(tmp_path / "a" / "sweeps", tmp_path / "b" / "sweeps")
    ablation = replace(more, out=tmp_path / "b", agents=("rudc-t",))
    assert "# Study ablation" in comparison.run(ablation, nothing_is_driven, "ablation").table
    with pytest.raises(InputError, match=r"no agent to drive in .*: usl-seed0: no training there"):
        comparison.run(Order(tmp_path / "c", ("usl",), budget="quick", trainings=made), lambda _: Silent())


@pytest.fixture
def first(tmp_path, monkeypatch):
    """An order of rudc-t, of a folder with the shipped trainings of it and of sac, an episode of one scenario
    in either domain; curves are not drawn.
    """
    monkeypatch.setattr(comparison, "draw_curves", not_drawn)
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")
    inside, outside = (find_scenarios([f"{n}_left_turn"], overrides=SHORT) for n in ("dense", "blocked"))
    monkeypatch.setattr(comparison, "in_distribution", lambda: inside)
    monkeypatch.setattr(comparison, "out_of_distribution", lambda _: outside)
    for shipped, name in (("rudc-t", "rudc-t-seed0"), ("sac", "sac-seed0"), ("sac-seed1", "sac-seed1")):
        shutil.copytree(shipped_checkpoints()[shipped], tmp_path / "made" / name)
    return Order(tmp_path / "a", ("rudc-t",), episodes=1, budget="quick", trainings=tmp_path / "made")


def test_rows_and_seeds_added_later_join_those_that_drove_before(first, tmp_path):
    """The tables are as if all had been asked for at once."""
    comparison.run(first, lambda _: Silent())
    later = comparison.run(replace(first, agents=("sac",), resume=True), lambda _: Silent())
    shutil.copytree(tmp_path / "a" / "sweeps", tmp_path / "b" / "sweeps")
    both = replace(first, out=tmp_path / "b", agents=("sac", "rudc-t"), resume=True)
    assert comparison.run(both, nothing_is_driven).table == later.table
    for name in ("metrics.csv", "pairs.csv", "trainings.csv", "in_distribution/episodes.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    comparison.run(replace(first, agents=("sac",), training_seeds=(1,), resume=True), lambda _: Silent())
    trainings = read_table(tmp_path / "a" / "trainings.csv")
    assert [(m["row"], m["training_seed"]) for m in trainings] == [
        ("sac", "0"),
        ("sac", "1"),
        ("rudc-t", "0"),
    ]
    assert [m["agent"] for m in trainings] == ["./sac-seed0", "./sac-seed1", "./rudc-t-seed0"]


def test_a_page_says_which_agent_each_row_is_and_what_is_missing(first):
    report = comparison.run(replace(first, agents=("rudc-t", "usl")), lambda _: Silent())
    assert report.notes[0] == "usl-seed0: no training there"
    lines = [[cell.strip() for cell in line.split("|")[2:-1]] for line in report.table.splitlines()]
    assert ["rudc-t", "./rudc-t-seed0", "0", "100000", "–"] in lines
    assert ["usl", "–", "–", "–", "usl-seed0: no training there"] in lines


def test_one_whose_logs_are_gone_is_in_the_tables_but_not_in_the_curves(first):
    gone = first.trainings / "rudc-t-seed0"
    (gone / "progress.csv").unlink()
    report = comparison.run(replace(first, agents=("sac", "rudc-t")), lambda _: Silent())
    assert f"rudc-t-seed0 is not in the curves: no progress.csv in {gone}" in report.notes[0]
    assert {m["agent"] for m in read_table(first.out / "curves.csv")} == {"SAC"}
    assert {m["row"] for m in read_table(first.out / "metrics.csv")} == {"sac", "rudc-t"}
    again = comparison.run(replace(first, resume=True), nothing_is_driven)
    assert [path.name for path in again.files if "curves" in path.name] == [
        "curves.csv",
        "curves.png",
        "curves.pdf",
    ]


def test_what_drove_before_stays_only_if_it_fits(first):
    """That is seen before anything is trained or driven."""
    comparison.run(first, lambda _: Silent())
    more = replace(first, agents=("sac",), resume=True)
    with pytest.raises(InputError, match=r"rudc-t-seed0 drove\); add --resume"):
        comparison.run(replace(more, resume=False), nothing_is_driven)
    with pytest.raises(SweepError, match=r"(?s)rudc-t-seed0 holds another sweep.*seed: 0 there, 5 here"):
        comparison.run(replace(more, seed=5), nothing_is_driven)
    shutil.rmtree(first.trainings / "rudc-t-seed0")
    report = comparison.run(more, lambda _: Silent())
    assert report.notes[0] == "rudc-t-seed0: no training there; what it drove before is left out"
    assert [m["episodes"] for m in read_table(first.out / "metrics.csv") if m["row"] == "rudc-t"] == ["0"] * 3


class Finished(Silent):
    """All episodes are there already."""

    def begin(self, total, finished, warnings):
        assert total == finished


def not_drawn(_, path):
    """Instead of `draw_curves`, which takes seconds: leaves empty files."""
    for file in (path, path.with_suffix(".pdf")):
        file.touch()
    return path


def nothing_is_driven(_: str) -> Finished:
    return Finished()
