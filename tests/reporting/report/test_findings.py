"""What a report says in sentences."""

import pytest

from rudc.evaluation.columns import COLUMNS, METRICS
from rudc.evaluation.metrics import group_metrics
from rudc.evaluation.unfinished import Asked
from rudc.reporting.report.episodes import Episodes, event_counts
from rudc.reporting.report.findings import findings
from rudc.reporting.report.pairs import differences
from tests.reporting.report.made_up import row


@pytest.mark.parametrize(("count", "ends"), [(8, "s6 (0 %), s7 (0 %)."), (11, "s7 (0 %), ... (11 in all).")])
def test_scenarios_left_out_of_a_list_are_counted(count, ends):
    told = Episodes.of([row(scenario=f"s{k}", events_fired="0") for k in range(count)], ())
    data = {"scenarios": told.scenarios, "events": event_counts(told, {})}
    _, said = findings(told, [], data, None)
    assert said.startswith(
        "In fewer than half of the episodes anything scripted happened: s0 (0 %), s1 (0 %)"
    )
    assert said.endswith(ends)


def test_events_are_said_to_happen_only_where_rows_say_so():
    often = "In every scenario with events, they happened in at least half of the episodes."
    for fired, said in (("1", [often]), ("", [])):
        told = Episodes.of([row(events_fired="1"), row(scenario="t", events_fired=fired)], ())
        data = {"scenarios": told.scenarios, "events": event_counts(told, {"s": ["fog"], "t": ["fog"]})}
        assert findings(told, [], data, None)[1:] == said


@pytest.mark.parametrize(
    ("failed", "where"), [("", "every scenario"), ("fell over", "all scenarios that it drove")]
)
def test_an_agent_is_praised_for_what_it_drove(failed, where):
    rows = [
        dict.fromkeys(COLUMNS, "") | row("success", scenario=s, seed=str(k)) for s in "st" for k in range(3)
    ]
    if failed:
        rows = [{**r, "outcome": "", "error": failed} if r["scenario"] == "t" else r for r in rows]
    told = Episodes.of(rows, ())
    rates = [[[100.0, 90.0, 100.0]], [None if failed else [100.0, 90.0, 100.0]]]
    data = {"scenarios": told.scenarios, "agents": told.agents, "events": [], "heat": {"SR": rates}}
    said = findings(told, group_metrics(rows, ("agent",), METRICS), data | {"pairs": differences(told)}, None)
    assert said[-1] == f"{told.agents[0]} succeeds in every episode of {where}."


def test_agents_that_succeed_equally_often_are_all_named():
    ends = {"a": "success", "b": "success", "c": "frozen"}
    blank = dict.fromkeys(COLUMNS, "")
    rows = [{**blank, **row(ends[a], agent=a, seed=str(k))} for a in ends for k in range(20)]
    told = Episodes.of(rows, ())
    data = {"scenarios": told.scenarios, "agents": told.agents, "events": [], "pairs": differences(told)}
    groups = group_metrics(rows, ("agent",), METRICS)
    said = findings(told, groups, data, None)
    assert said[1] == "a, b succeed equally often over all scenarios, none more often: SR 100.0 %."
    assert said[2].startswith("a against b, in the same episodes: SR +0.0 points [")
    assert said[3].startswith("a against c, in the same episodes: SR +100.0 points [")
    said = findings(told, groups[1:], data, None)
    assert said[1].startswith("b succeeds most often over all scenarios: SR 100.0 [")
    said = findings(told, groups[1:2], data, None)
    assert said[1].startswith("b over all scenarios: SR 100.0 ["), "one alone is not the best of any"


@pytest.mark.parametrize(("count", "said"), [(5, True), (6, False)])
def test_a_difference_is_chance_if_either_of_its_tests_says_so(count, said):
    """Of five pairs that all go one way the interval is clear of zero, and McNemar's p 0.0625."""
    blank = dict.fromkeys(COLUMNS, "")
    ends = {"a": "success", "b": "frozen"}
    rows = [{**blank, **row(ends[a], agent=a, seed=str(k))} for a in ends for k in range(count)]
    told = Episodes.of(rows, ())
    data = {"scenarios": told.scenarios, "agents": told.agents, "events": [], "pairs": differences(told)}
    line = findings(told, group_metrics(rows, ("agent",), METRICS), data, None)[2]
    assert ("which may be chance (McNemar's p = 0.062)" in line.partition(";")[0]) == said


def test_agents_are_ranked_by_the_episodes_that_all_finished():
    blank = dict.fromkeys(COLUMNS, "")
    ends = {("a", "s"): "success", ("b", "s"): "success", ("b", "t"): "frozen"}
    rows = [
        {**blank, **row(ends[agent, place], agent=agent, scenario=place, seed=str(k))}
        for agent, place in ends
        for k in range(10)
    ]

    def ranking(rows):
        told = Episodes.of(rows, ())
        data = {"scenarios": ["s"], "agents": told.agents, "events": [], "pairs": differences(told)}
        return findings(
            told,
            group_metrics(rows, ("agent",), METRICS),
            data,
            Asked(("s", "t"), ("a", "b"), range(10), 40, ()),
        )[1:]

    assert ranking(rows)[0] == (
        "a, b succeed equally often in the 10 episodes that all finished, none more often: SR 100.0 %."
    )
    (said,) = ranking(rows[:10] + rows[20:])
    assert said.endswith("none of the same episodes yet, so they are not ranked.")
