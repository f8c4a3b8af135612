"""Several sweeps in one table: parts of one, or two to compare."""

import csv
import shutil
from pathlib import Path

import pytest

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.errors import SweepError
from rudc.evaluation.folder import sweep_rows
from rudc.evaluation.joined import joined_rows
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tables import make_table
from rudc.evaluation.tasks import SweepPlan

BY = ("scenario", "agent")


def table(*folders, by=BY, warnings=None):
    return make_table(joined_rows(folders, by, [] if warnings is None else warnings), by, "csv")


def rewritten(file, name, value):
    """Give each row another value in a column."""
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    with file.open("w") as lines:
        out = csv.DictWriter(lines, rows[0].keys(), lineterminator="\n")
        out.writeheader()
        out.writerows({**row, name: value} for row in rows)


def test_parts_of_a_sweep_give_its_table(fakes, make_plan, tmp_path):
    run_sweep(make_plan(episodes=6), tmp_path / "whole", fakes.Runner)
    for part in (0, 1):
        run_sweep(make_plan(episodes=3, seed=3 * part), tmp_path / f"part{part}", fakes.Runner)
    assert table(tmp_path / "part0", tmp_path / "part1") == table(tmp_path / "whole")


def test_an_agent_named_by_its_folder_stands_beside_the_papers_row_of_its_algorithm(
    fakes, make_plan, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(shipped_checkpoints()["sac"], "mine/first")
    scenarios = make_plan(names=("dense_left_turn",)).scenarios
    for seed, folder in ((0, Path("a")), (3, Path("b"))):
        agents = ("mine/first", "mine/first+ttcbf", "planner")
        run_sweep(SweepPlan(scenarios, agents, 3, seed), folder, fakes.Runner)
    for folders in ([Path("a")], [Path("a"), Path("b")]):
        text = make_table(joined_rows(folders, BY, []), BY, "csv", "comparison")
        drove = [line.split(",")[1] for line in text.splitlines()]
        assert drove[1:5] == ["mine/first", "SAC (paper)", "mine/first+ttcbf", "planner"]


def test_swept_values_stand_in_columns_of_both(fakes, make_plan, tmp_path):
    plain = make_plan()
    swept = make_plan(names=("dense_left_turn",)).scenarios[0]
    swept = swept.model_copy(update={"sweep": {"traffic.density": (10.0, 20.0)}})
    others = SweepPlan((swept,), plain.agents, 3, 0)
    run_sweep(plain, tmp_path / "a", fakes.Runner)
    run_sweep(others, tmp_path / "b", fakes.Runner)
    run_sweep(SweepPlan((*plain.scenarios, swept), plain.agents, 3, 0), tmp_path / "c", fakes.Runner)
    by = ("scenario", "traffic.density", "agent")
    assert joined_rows([tmp_path / "a", tmp_path / "b"], by, []).parameters == ("traffic.density",)
    assert table(tmp_path / "a", tmp_path / "b", by=by) == table(tmp_path / "c", by=by)


def test_an_episode_counts_once(fakes, make_plan, tmp_path):
    run_sweep(make_plan(episodes=3), tmp_path / "a", fakes.Runner)
    run_sweep(make_plan(episodes=3, seed=2), tmp_path / "b", fakes.Runner)
    told = r"the episode random_destination, sumo, seed 2 is in .*a and .*b; give one of them, or --by folder"
    with pytest.raises(SweepError, match=told):
        table(tmp_path / "a", tmp_path / "b")
    apart = table(tmp_path / "a", tmp_path / "b", by=("folder", "agent")).splitlines()
    assert [line.split(",")[0] for line in apart[1:]] == [str(tmp_path / name) for name in "aabb"]
    with pytest.raises(SweepError, match="a is given more than once"):
        table(tmp_path / "a", tmp_path / "a")


def test_episodes_that_failed_stand_in_no_others_way(fakes, make_plan, tmp_path):
    for folder in ("a", "b"):
        run_sweep(make_plan(episodes=3), tmp_path / folder, fakes.Runner)
    rewritten(tmp_path / "b" / "episodes.csv", "outcome", "")
    rewritten(tmp_path / "b" / "episodes.csv", "error", "lost")
    assert table(tmp_path / "a", tmp_path / "b").count(",3,3,") == 2


def test_what_only_has_the_name_in_common(fakes, make_plan, tmp_path):
    """Rows of a scenario count together only where it is the same; other agents and versions are told."""
    plan = make_plan()
    denser = plan.scenarios[0].varied({"traffic.density": 35})
    run_sweep(plan, tmp_path / "a", fakes.Runner)
    run_sweep(SweepPlan((denser,), plan.agents, 3, 0), tmp_path / "b", fakes.Runner)
    told = r"the scenario 'random_destination' is not the same in .*a and .*b; --by folder,"
    with pytest.raises(SweepError, match=told):
        table(tmp_path / "a", tmp_path / "b")
    assert table(tmp_path / "a", tmp_path / "b", by=("agent",)).count(",6,0,") == 2
    assert table(tmp_path / "a", tmp_path / "b", by=("folder", *BY)).count(",3,0,") == 4
    manifest = tmp_path / "b" / "manifest.json"
    text = (
        manifest.read_text().replace('"sumo": {', '"sumo": {"other": 1, ').replace('"code": "', '"code": "x')
    )
    manifest.write_text(text)
    warnings = []
    table(tmp_path / "a", tmp_path / "b", by=("agent",), warnings=warnings)
    assert "the agent 'sumo' is not the same in" in warnings[0]
    assert "rows come from several versions: code " in warnings[1]


@pytest.mark.parametrize("column", ["agent", "scenario"])
def test_rows_that_were_driven_elsewhere_are_refused(fakes, make_plan, tmp_path, column):
    """Rows of two sweeps were put into one file by hand: its manifest knew nothing of half of them."""
    run_sweep(make_plan(agents=("sumo",)), tmp_path, fakes.Runner)
    rewritten(tmp_path / "episodes.csv", column, "polite")
    told = rf"has rows of the {column} 'polite', of which manifest\.json says nothing; leave them"
    with pytest.raises(SweepError, match=told):
        table(tmp_path)
    (tmp_path / "manifest.json").unlink()
    assert "polite" in table(tmp_path)


def test_one_folder_is_read_as_it_is(fakes, make_plan, tmp_path):
    run_sweep(make_plan(), tmp_path, fakes.Runner)
    assert joined_rows([tmp_path], BY, []).names == sweep_rows(tmp_path).names
    assert table(tmp_path, by=("folder", "agent")).count(f"{tmp_path},") == 2
    with pytest.raises(SweepError, match="given more than once"):
        table(tmp_path, tmp_path / "." / ".." / tmp_path.name, by=("folder", "agent"))
