"""The seven metrics of groups of episodes."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rudc.errors import InputError
from rudc.evaluation.columns import COLUMNS, METRICS, TIMING, Column, metric_of
from rudc.evaluation.metrics import Tally, average, group_metrics
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rows import by_column


def row(outcome="success", agent="sumo", **numbers):
    numbers = {"steps": 10, "route_completion": 0.5, "decision_ms_mean": 1.0, **numbers}
    record = EpisodeRecord({"scenario": "s", "agent": agent, "seed": 0, "outcome": outcome, **numbers})
    return dict(zip(COLUMNS, record.row(), strict=True))


def failed():
    return dict(zip(COLUMNS, EpisodeRecord.failed("s", "sumo", 0, "broke").row(), strict=True))


def test_columns_are_those_of_the_contract():
    assert ",".join(COLUMNS) == (
        "scenario,agent,seed,outcome,steps,duration_s,route_completion,mean_speed_mps,episode_reward,"
        "min_dtc_m,interventions,engaged_steps,mean_correction,infeasible_steps,mean_sigma,max_sigma,"
        "decision_ms_mean,decision_ms_max,fault,hit,events_fired,first_event_s,first_event_visible_s,error,"
        "origin,destination,turn,priority,redraws,density,sv_collisions"
    )
    assert set(TIMING) < set(COLUMNS)
    assert [m.name for m in METRICS] == ["SR", "FR", "RC", "AES", "AER", "VR", "min_DTC"]


@given(st.lists(st.sampled_from(["success", "frozen", "collision", "off_road", "wrong_way"]), min_size=1))
def test_every_episode_ends_in_exactly_one_way(outcomes):
    (group,) = group_metrics([row(outcome) for outcome in outcomes], ["scenario"])
    rates = {name: group.metrics[name].mean for name in ("SR", "FR", "VR")}
    assert sum(rates.values()) == pytest.approx(100.0)
    assert rates["SR"] == pytest.approx(100 * outcomes.count("success") / len(outcomes))
    assert rates["FR"] == pytest.approx(100 * outcomes.count("frozen") / len(outcomes))


def test_means_are_in_their_units_and_leave_out_what_is_not_there():
    rows = [row(route_completion=0.25, min_dtc_m=2.0), row(route_completion=0.75, min_dtc_m=math.nan)]
    (group,) = group_metrics(rows, ["scenario"])
    assert group.metrics["RC"].mean == pytest.approx(50.0)
    assert group.metrics["min_DTC"].mean == 2.0
    assert math.isnan(group.metrics["AES"].mean)
    assert group.metrics["decision"].mean == 1.0


def test_failed_episodes_are_counted_and_enter_no_metric():
    (group,) = group_metrics([row("success"), failed(), row("collision")], ["scenario"])
    assert (group.episodes, group.errors) == (2, 1)
    assert group.metrics["SR"].mean == 50.0
    (none,) = group_metrics([failed()], ["scenario"])
    assert (none.episodes, none.errors) == (0, 1)
    assert all(math.isnan(value) for value in none.metrics["SR"])
    assert math.isnan(none.metrics["decision"].mean)


def test_no_rows_have_no_groups():
    assert group_metrics([], ["scenario"]) == group_metrics([], ()) == []


def test_groups_come_in_the_order_of_their_first_row():
    rows = [row(agent="b"), row("frozen", agent="a"), row(agent="b")]
    groups = group_metrics(rows, ["scenario", "agent"])
    assert [group.key for group in groups] == [("s", "b"), ("s", "a")]
    assert [group.episodes for group in groups] == [2, 1]
    assert np.isclose(groups[1].metrics["FR"].mean, 100.0)


def test_a_failed_record_has_one_line_of_error_and_no_numbers():
    cells = dict(zip(COLUMNS, EpisodeRecord.failed("s", "a", 4, "one\n two,  three ").row(), strict=True))
    assert cells.pop("error") == "one two, three"
    assert {name: text for name, text in cells.items() if text} == {
        "scenario": "s",
        "agent": "a",
        "seed": "4",
    }


def test_any_column_with_a_mean_is_a_metric():
    rows = [
        row(steps=10, interventions=4, mean_correction=0.1),
        row(steps=30, interventions=0, mean_correction=0.5),
    ]
    share, size, speed = (metric_of(name) for name in ("interventions", "mean_correction", "aes"))
    assert share is not None
    assert size is not None
    assert speed is METRICS[3]
    summary = group_metrics(rows, (), [share])[0].metrics[share.name]
    assert (summary.mean, average(share, rows)) == (10.0, 10.0)
    assert (summary.low, summary.high) == (0.0, 100.0)  # Student's of two reaches beyond
    assert average(size, rows) == pytest.approx((10 * 0.1 + 30 * 0.5) / 40)
    assert math.isnan(average(size, [row()]))
    gaps, rewards = [row(min_dtc_m=0.1), row(min_dtc_m=1.4)], [row(episode_reward=-5), row(episode_reward=3)]
    assert group_metrics(gaps, (), [METRICS[6]])[0].metrics["min_DTC"].low == 0.0  # no gap is smaller
    assert group_metrics(rewards, (), [METRICS[4]])[0].metrics["AER"].low < -5.0
    short, times = metric_of("duration_s"), [row(duration_s=0.5), row(duration_s=9.0), row(duration_s=1.0)]
    assert short is not None
    assert group_metrics(times, (), [short])[0].metrics[short.name].low == 0.0
    assert metric_of("agent") is None
    assert metric_of("nothing") is None


def test_blocks_of_rows_say_what_all_of_them_say():
    rows = [
        row(
            ["success", "collision", "frozen"][k % 3], agent=f"a{k % 4}", episode_reward=k * 0.37, steps=k + 1
        )
        for k in range(97)
    ] + [failed()]
    metrics = (*METRICS, metric_of("interventions"))
    tally = Tally(("agent",), metrics)
    for begin in range(0, 98, 10):
        tally.add(by_column(rows[begin : begin + 10], COLUMNS))
    assert repr(tally.groups()) == repr(group_metrics(rows, ("agent",), metrics))
    assert [g.key for g in tally.groups()] == [("a0",), ("a1",), ("a2",), ("a3",), ("sumo",)]


@pytest.mark.parametrize(
    ("value", "average", "says"),
    [
        (np.array([1.0, 2.0]), None, "a value is a number, a text, true, false or None, got '[1. 2.]'"),
        ("a\nb", None, "a text is one line, got"),
        ("x", "episodes", "what has an average is a number, got 'x'"),
        (True, "episodes", "what has an average is a number, got 'True'"),
        (-1e12, "episodes", "what has an average is between -1e+12 and 1e+12, got '-1000000000000.0'"),
    ],
)
def test_what_no_cell_can_say_is_refused_by_the_columns_name(value, average, says):
    with pytest.raises(InputError, match=re.escape(f"column 'mine': {says}")):
        Column("mine", "of mine", lambda _: value, average=average).value(None)


@pytest.mark.parametrize(
    ("value", "cell"),
    [("a, b", "a, b"), (np.float32(1.5), 1.5), (np.bool_(True), True), (np.int64(3), 3), (math.nan, None)],
)
def test_numpys_numbers_and_texts_with_commas_are_cells(value, cell):
    found = Column("mine", "of mine", lambda _: value).value(None)
    assert (found, type(found)) == (cell, type(cell))


def test_rows_may_be_what_pandas_makes_of_the_file():
    rows = [row(agent="planner", min_dtc_m=1.5, events_fired=3), row("collision"), failed()]
    numbers = {"steps", "min_dtc_m", "decision_ms_mean", "route_completion", "events_fired"}
    read = [
        {name: math.nan if not cell else float(cell) if name in numbers else cell for name, cell in r.items()}
        for r in rows
    ]
    first, second = (group_metrics(given, ("agent", "events_fired")) for given in (rows, read))
    assert next((g.key, g.episodes, g.errors) for g in second) == (("planner", "3"), 1, 0)
    assert repr(second) == repr(first)
