"""What `rudc table` and `rudc report` say of a sweep that is not finished."""

import csv
import json
from pathlib import Path

import pytest

from rudc.evaluation.unfinished import lacking
from tests.reporting.report.made_up import made_up_sweep

GOES_ON = "`rudc sweep --resume --out {}` goes on with it"


def cut(folder, rows, rest=""):
    """Leave the first rows of a folder's file, and what comes after them."""
    file = Path(folder, "episodes.csv")
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[: rows + 1]) + rest)
    return lines


@pytest.fixture
def swept(tmp_path):
    """2 scenarios x 2 agents x 8 seeds."""
    return made_up_sweep(tmp_path / "swept", 32, scenarios=2, agents=2)


def test_a_table_says_what_lacks_beside_its_data(rudc, swept):
    whole = rudc("table", "swept", "--json")
    assert whole.err == ""
    _, *lines = cut(swept, 11)
    second = json.loads((swept / "manifest.json").read_text())["configuration"]["scenarios"].keys()
    none = f"none yet of the scenario {list(second)[1]}"
    said = f"warning: swept is not finished: 11 of 32 episodes are there, {none}"
    for form in (("--json",), ("-f", "csv"), ("-f", "markdown"), ("--quiet",)):
        answer = rudc("table", "swept", *form)
        assert answer.err.splitlines()[:1] == [f"{said}; {GOES_ON.format('swept')}"]
        assert "finished" not in answer.out
    assert [group["episodes"] for group in json.loads(rudc("table", "swept", "--json").out)] == [8, 3]
    cut(swept, 8, lines[8][:30])
    assert rudc("table", "swept").err.splitlines()[0] == (
        f"warning: swept is not finished: 8 of 32 episodes are there, {none}, none yet of the agent "
        f"follower; episodes.csv ends within a line, which is left out; {GOES_ON.format('swept')}"
    )


def test_each_of_several_folders_is_looked_at(rudc, swept, tmp_path):
    made_up_sweep(tmp_path / "other", 8, scenarios=1, agents=2)
    cut(swept, 31)
    answer = rudc("table", "swept", "other", "--by", "folder,agent", "-f", "csv")
    assert answer.err.count("warning: ") == 1
    assert "swept is not finished: 31 of 32 episodes are there; " in answer.err


def test_rows_of_episodes_that_failed_are_there_once(swept):
    file = swept / "episodes.csv"
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    failed = rows[-1] | {"outcome": "", "error": "lost"}
    more = rows[0] | {"seed": "1000"}  # of another sweep, put there by hand
    for kept, said in ((rows[:-1], ""), (rows[:-2], "31 of 32 episodes are there;")):
        with file.open("w") as out:
            table = csv.DictWriter(out, rows[0].keys(), lineterminator="\n")
            table.writeheader()
            table.writerows([*kept, failed, failed, more])
        assert (said in lacking(swept)) if said else lacking(swept) == ""


def test_a_folder_that_does_not_say_what_was_asked_for(swept):
    (swept / "manifest.json").unlink()
    _, *lines = cut(swept, 30)
    assert lacking(swept) == ""
    cut(swept, 3, lines[3][:30])
    assert lacking(swept) == f"{swept}: episodes.csv ends within a line, which is left out"


def test_a_report_does_not_contradict_itself(rudc, swept):
    _, *lines = cut(swept, 11)
    assert rudc("report", "swept").status == 0
    text = (swept / "report.html").read_text()
    assert "11 of 32 episodes so far, of 2 scenarios × 2 agents × 8 seeds; none yet of the scenario " in text
    assert "8 episodes of each scenario and agent were asked for, seeds 0 to 7; 11 of 32 are there so" in text
    assert "this command runs those that are there again" in text
    for word in ("all of them again", "every scenario.", "all scenarios:"):
        assert word not in text
    (swept / "episodes.csv").write_text("".join([_, *lines]))
    assert rudc("report", "swept").status == 0
    text = (swept / "report.html").read_text()
    assert "32 episodes: 2 scenarios × 2 agents × 8 seeds." in text
    assert "8 episodes of each scenario and agent, seeds 0 to 7. With" in text
    assert "this command runs all of them again" in text
