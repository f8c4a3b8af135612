"""Tables of metrics: every style, what is bold, and the paper's numbers beside."""

import csv
import io
import itertools
import json
import math

import pytest

from rudc.errors import InputError
from rudc.evaluation.columns import COLUMNS, METRICS
from rudc.evaluation.metrics import Group
from rudc.evaluation.paper import TABLES, beside, paper_groups, paper_name
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.statistics import Summary
from rudc.evaluation.tables import best_of, cell, make_table, measured, named_metrics


@pytest.fixture
def rows():
    """Ten episodes of each of two agents in two scenarios; `good_one` is better in everything but speed."""
    found = []
    for scenario, agent, i in itertools.product(
        ["random_destination", "50%_off"], ["good_one", "bad&ugly"], range(10)
    ):
        good = agent == "good_one"
        outcome = "success" if good and i else "collision" if i % 2 else "frozen"
        record = EpisodeRecord(
            {
                "scenario": scenario, "agent": agent, "seed": i, "outcome": outcome, "steps": 100,
                "duration_s": 10.0, "route_completion": 1.0 if good else 0.4,
                "mean_speed_mps": (6.0 if good else 9.0) + 0.1 * (i % 2),
                "episode_reward": 100.0 + i if good else -20.0,
                "min_dtc_m": (2.5 if good else 0.5) + 0.01 * i, "interventions": 0, "mean_correction": 0.0,
                "infeasible_steps": 0, "decision_ms_mean": 0.5, "decision_ms_max": 1.0, "events_fired": i % 3,
                "priority": "minor" if i % 2 else "major",
            }
        )  # fmt: skip
        found.append(dict(zip(COLUMNS, record.row(), strict=True)))
    return found


BY = ("scenario", "agent")


def test_a_column_is_grouped_by_or_shown(rows):
    with pytest.raises(InputError, match="'steps' is both grouped by and shown; leave it out of one"):
        make_table(rows, ("agent", "steps"), "json", metrics=named_metrics(["SR", "steps"]))


def test_csv_has_every_statistic_in_full(rows):
    table = list(csv.DictReader(io.StringIO(make_table(rows, BY, "csv"))))
    assert list(table[0])[2:8] == ["episodes", "errors", "SR_mean", "SR_std", "SR_low", "SR_high"]
    assert [(row["scenario"], row["agent"]) for row in table] == [
        ("random_destination", "good_one"), ("random_destination", "bad&ugly"),
        ("50%_off", "good_one"), ("50%_off", "bad&ugly"),
    ]  # fmt: skip
    first = table[0]
    assert (first["episodes"], first["SR_mean"], first["RC_mean"], first["RC_std"]) == (
        "10",
        "90.0",
        "100.0",
        "0.0",
    )
    assert float(first["SR_low"]) == pytest.approx(59.585, abs=1e-3)
    assert float(first["SR_high"]) == pytest.approx(98.212, abs=1e-3)
    assert 102 < float(first["AER_low"]) < float(first["AER_mean"]) == 104.5 < float(first["AER_high"]) < 107


def test_markdown_shows_intervals_and_bolds_what_is_best_beyond_chance(rows):
    lines = make_table(rows, BY, "markdown").splitlines()
    assert len({len(line) for line in lines}) == 1, "columns must line up"
    assert "SR (%) ↑" in lines[0]
    assert "VR (%) ↓" in lines[0]
    good, bad = (line.split(" | ") for line in lines[2:4])
    assert good[3].strip() == "**90.0 [59.6, 98.2]**"
    assert bad[3].strip() == "0.0 [0.0, 27.8]"
    assert "**" in bad[6], "the faster one is better in speed"
    assert good[9].strip(" |") == "**2.54 [2.52, 2.57]**"
    assert bad[7].strip() == "-20.0 (0.0)", "few that are all alike have no interval"


def test_nothing_is_bold_that_may_be_chance(rows):
    """Of 40 and 50 % success in ten episodes each, neither is shown to be better."""
    for row in rows:
        if row["agent"] == "bad&ugly":
            row["outcome"] = "success" if int(row["seed"]) < 6 else "frozen"
    best = make_table(rows, BY, "markdown").splitlines()[2].split(" | ")[3].strip()
    assert best == "90.0 [59.6, 98.2]"


def test_nothing_is_bold_that_overlaps_with_any_other():
    """Even where the next best is clearly apart: intervals are not equally wide."""
    assert best_of(speeds((10.0, 10.0, 10.1), (9.0, 9.0, 9.1), (8.5, 4.4, 9.9)), BY, METRICS) == {(0, "AES")}
    assert best_of(speeds((10.0, 10.0, 10.1), (9.0, 9.0, 9.1), (8.5, 4.4, 12.6)), BY, METRICS) == set()


def speeds(*values: tuple[float, float, float]) -> list[Group]:
    """Agents with these mean speeds and intervals, and nothing else known of them."""
    nothing = dict.fromkeys((metric.name for metric in METRICS), Summary(*[math.nan] * 4))
    return [
        Group(("fog", f"a{k}"), 10, 0, {**nothing, "AES": Summary(mean, math.nan, low, high)})
        for k, (mean, low, high) in enumerate(values)
    ]


def test_values_without_spread_are_not_best_beyond_chance():
    """100 % of the way in 20 of 20 episodes was bold beside 16 of 20, whose share of successes was not."""
    assert best_of(speeds((10.0, 10.0, 10.0), (9.0, 8.9, 9.1)), BY, METRICS) == set()


def test_a_rate_that_is_not_zero_does_not_look_like_it():
    """One violation in 2,500 episodes was 0.0 %."""
    values = {metric.name: Summary(0.04, 2.0, 0.007, 0.226) for metric in METRICS}
    assert [cell(metric, values[metric.name]) for metric in METRICS if metric.name in ("VR", "AES")] == [
        "0.0 [0.0, 0.2]",
        "0.04 [0.01, 0.23]",
    ]


def test_json_has_columns_of_numbers_as_numbers(rows):
    for k, row in enumerate(rows):
        row["density"], row["redraws"], row["scenario"] = "12.5", str(k % 2), "7"
        row["first_event_s"], row["place"] = "0.5" if k % 2 else "", "007"
    by = ("scenario", "density", "redraws", "first_event_s", "place")
    lines = json.loads(make_table(rows, by, "json"))
    first, second = ([line[name] for name in by] for line in lines)
    assert first == ["7", 12.5, 0, "", "007"]
    assert second == ["7", 12.5, 1, "0.5", "007"]


def test_any_metric_can_be_shown(rows):
    assert named_metrics(["min-DTC", "sr", "min_DTC", "SR"]) == named_metrics(["min_DTC", "SR"])
    chosen = named_metrics(["VR", "interventions", "duration_s"])
    lines = make_table(rows, BY, "markdown", metrics=chosen).splitlines()
    assert [cell.strip() for cell in lines[0].split("|")[4:-1]] == [
        "VR (%) ↓",
        "interventions (%)",
        "duration_s (s) ↓",
    ]
    assert "VR_mean" in make_table(rows, BY, "csv", metrics=chosen)
    with pytest.raises(InputError, match=r"no metric 'interventons' \(did you mean 'interventions'\?\)"):
        named_metrics(["interventons"])


def test_latex_compiles_in_its_head(rows):
    text = make_table(rows, BY, "latex")
    lines = text.splitlines()
    assert lines[1] == "\\begin{tabular}{llrrrrrrrr}"
    assert [line for line in lines if line.startswith("\\") and "tabular" not in line] == [
        "\\toprule", "\\midrule", "\\midrule", "\\bottomrule",
    ]  # fmt: skip
    body = [line for line in lines if line.endswith("\\\\")]
    assert {line.replace("\\&", "").count("&") for line in body} == {9}
    assert "50\\%\\_off & bad\\&ugly" in text
    assert "\\textbf{90.0} {\\scriptsize [59.6, 98.2]}" in text
    assert "SR\\,$\\uparrow$" in lines[3]
    assert "& (\\%) &" in lines[4]
    assert "$-$20.0 {\\scriptsize (0.0)}" in text


def test_signs_of_a_name_are_shown_as_they_are(rows):
    for row in rows:
        row["agent"] = 'my.py:X(mode="a|b")' if row["agent"] == "good_one" else "~/c^\\_{x}"
    lines = make_table(rows, BY, "markdown").splitlines()
    assert len({len(line) for line in lines}) == 1
    assert {line.replace("\\|", "").count("|") for line in lines} == {11}
    assert 'X(mode="a\\|b")' in lines[2]
    latex = make_table(rows, BY, "latex")
    assert "\\textasciitilde{}/c\\textasciicircum{}\\textbackslash{}\\_\\{x\\}" in latex


def test_what_an_episode_does_not_say_is_shown_as_missing(rows):
    rows[0] = {**rows[0], "outcome": "", "priority": "", "error": "x"}
    lines = make_table(rows, ("priority",), "markdown").splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:]] == ["–", "minor", "major"]
    assert make_table(rows, ("priority",), "csv").splitlines()[1].startswith(",0,1,")


def test_nothing_is_best_without_a_competitor(rows):
    assert "**" not in make_table([row for row in rows if row["agent"] == "good_one"], BY, "markdown")


def test_any_column_can_be_grouped_by(rows):
    groups = measured(rows, ["agent", "priority"])
    assert [group.key for group in groups][:2] == [("good_one", "major"), ("good_one", "minor")]
    assert sum(group.episodes for group in groups) == 40
    fired = measured(rows, ["events_fired"])
    assert [(group.key, group.episodes) for group in fired] == [(("0",), 16), (("1",), 12), (("2",), 12)]
    with pytest.raises(InputError, match=r"no column 'priorty' .*mean 'priority'\?\); there are: scenario"):
        measured(rows, ["agent", "priorty"])
    with pytest.raises(InputError, match="no finished episode"):
        measured([], BY)


def test_columns_of_numbers_are_in_order_of_value_and_others_as_they_come(rows):
    densities = ["20", "5", "", "10.5", "100"]
    swept = [{**row, "traffic.density": densities[k % 5]} for k, row in enumerate(rows)]
    ordered = ["5", "10.5", "20", "100", ""]
    assert [g.key for g in measured(swept, ["traffic.density"])] == [(text,) for text in ordered]
    assert [g.key for g in measured(swept, ["agent", "traffic.density"])] == [
        (agent, text) for agent in ("good_one", "bad&ugly") for text in ordered
    ]
    swept[0]["traffic.density"] = "dense"
    assert [g.key[0] for g in measured(swept, ["traffic.density"])][:3] == ["dense", "5", ""]


def test_the_papers_rows_stand_beside_ours_of_the_same_algorithm():
    def group(agent: str) -> Group:
        return Group(("fog", agent), 1, 0, {})

    ours = [group(n) for n in ("sac", "planner", "rudc-t", "rudc-t-seed1", "rudc-t:outlook.course=false")]
    theirs = [group(f"{n} (paper)") for n in ("USL", "RUDC-T", "SAC")]
    assert [g.key[1] for g in beside(ours, theirs, 1, {})] == [
        "sac", "SAC (paper)", "planner", "rudc-t", "rudc-t-seed1", "RUDC-T (paper)",
        "rudc-t:outlook.course=false", "USL (paper)",
    ]  # fmt: skip
    assert paper_name("sac-lagrangian-seed2", {}) == "Lagrangian"
    learnt = {"out/mine": "sac", "out/mine:outlook.course=false": "sac", "lr=1/dsac-seed0": "dsac"}
    assert [paper_name(name, learnt) for name in learnt] == ["SAC", "", "DSAC"]


def test_the_papers_numbers_stand_beside_ours_and_do_not_compete(rows):
    table = make_table(rows, BY, "markdown", against="comparison")
    lines = [line for line in table.splitlines() if "(paper)" in line]
    assert len(lines) == 9, "the second scenario is not in the paper"
    assert not any("**" in line for line in lines)
    (ours,) = (line for line in lines if "RUDC-T (paper)" in line)
    assert "92.3 (1.2)" in ours
    assert "115.0 (4.6)" in ours
    assert "6.30 (4.30)" in ours
    with pytest.raises(InputError, match="group by scenario and agent"):
        make_table(rows, ["agent"], "markdown", against="comparison")
    with pytest.raises(InputError, match="no table 'tab3'"):
        make_table(rows, BY, "markdown", against="tab3")


@pytest.mark.parametrize("style", ["markdown", "latex", "csv", "json"])
def test_a_metric_that_the_paper_lacks_is_empty_there(rows, style):
    both = make_table(rows, BY, style, "comparison", named_metrics(["SR", "interventions"]))
    alone = make_table(rows, BY, style, "comparison", named_metrics(["SR"]))
    if style == "json":
        theirs = [group for group in json.loads(both) if "(paper)" in group["agent"]]
        assert len(theirs) == 9
        assert all(group["SR"]["mean"] and group["interventions"]["mean"] is None for group in theirs)
        return
    for long, short in zip(both.splitlines(), alone.splitlines(), strict=True):
        if "(paper)" in short:
            short = short.removesuffix(" \\\\").removesuffix(" |")
            assert long.startswith(short)
            assert set(long.removeprefix(short)) <= set("–-|,& \\")


def test_the_papers_tables_are_whole():
    sizes = {name: len(paper_groups(name, BY)) for name in TABLES}
    assert sizes == {"comparison": 18, "ablation": 12, "paper": 26}
    for group in paper_groups("paper", BY):
        assert set(group.metrics) == {metric.name for metric in METRICS}
        rates = sum(group.metrics[name].mean for name in ("SR", "FR", "VR"))
        # As printed, ESAC and RUDC w/o CBF add up to more and less than 100.
        assert 99.0 < rates < 107.0
