"""Episodes of a sweep found by what one types, set up again from its manifest."""

import json
import shutil

import pandas as pd
import pytest

from rudc.errors import SweepError
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.rerun import differences, find_episode
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.scenario import find_scenarios


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("rerun") / "swept"
    scenarios = find_scenarios(["random_destination"], overrides={"traffic.density": [10, 20]})
    run_sweep(SweepPlan(tuple(scenarios), ("follower", "follower+ttcbf"), 2, 5), out, EpisodeRunner)
    return out


def test_every_row_can_be_run_again_and_comes_out_the_same(folder):
    rows, _ = read_sweep(folder)
    run = EpisodeRunner()
    for number, row in enumerate(rows, 1):
        found = find_episode(folder, str(number))
        assert (found.number, found.row, found.changes) == (number, row, ())
        assert (found.task.agent, found.task.seed) == (row["agent"], int(row["seed"]))
        assert float(found.task.swept["traffic.density"]) == float(row["traffic.density"])
        if number % 4 == 1:
            assert differences(row, run(found.task)) == []
    run.close()


def test_an_agent_of_a_relative_path_is_missed_elsewhere_with_a_hint(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(
        "class Own:\n    def reset(self, scene, seed): pass\n    def act(self, scene): return 0, 0\n"
    )
    monkeypatch.chdir(tmp_path)
    scenarios = find_scenarios(["random_destination"], overrides={"episode.timeout": 0.5})
    run_sweep(SweepPlan(tuple(scenarios), ("own.py:Own",), 1, 0), tmp_path / "swept", EpisodeRunner)
    assert find_episode(tmp_path / "swept", "1").changes == ()
    monkeypatch.chdir("/")
    with pytest.raises(
        SweepError, match=r"no such file; own\.py:Own is named relative to the folder in which"
    ):
        find_episode(tmp_path / "swept", "1")


def test_a_row_that_says_otherwise_is_noticed(folder):
    run = EpisodeRunner()
    found = find_episode(folder, "1")
    record = run(found.task)
    run.close()
    other = differences({**found.row, "outcome": "frozen", "decision_ms_mean": "99"}, record)
    assert [str(difference) for difference in other] == [f"outcome: frozen then, {record.outcome} now"]


def test_a_cell_that_was_empty_and_is_not_now_is_noticed(folder, tmp_path):
    run = EpisodeRunner()
    found = find_episode(folder, "1")
    record = run(found.task)
    run.close()
    assert record.text("destination")
    (other,) = differences({**found.row, "destination": ""}, record)
    assert str(other) == f"destination: nothing then, {record.text('destination')} now"
    failed = {**dict.fromkeys(found.row, ""), "error": "fell over"}
    assert [d.column for d in differences(failed, record)] == ["error"]
    shutil.copytree(folder, tmp_path / "old")
    rows = pd.read_csv(folder / "episodes.csv", dtype=str, keep_default_na=False)
    rows.drop(columns="destination").to_csv(tmp_path / "old" / "episodes.csv", index=False)
    assert differences(find_episode(tmp_path / "old", "1").row, record) == []


@pytest.mark.parametrize(
    ("which", "says"),
    [
        ("random_destination:follower:5", "2 episodes are random_destination:follower:5"),
        ("random_destination:folower:5", "did you mean 'follower'"),
        ("random_destination:follower:9", "no episode of seed '9'; there are: 5, 6"),
        ("elsewhere:follower:5", "no episode of scenario 'elsewhere'"),
        ("0", "rows 1 to 8, not 0"),
        ("follower", "SCENARIO:AGENT:SEED"),
        ("\u00b3", "which episode is '\u00b3'?"),
        ("random_destination:follower:\u00b3", "which episode is"),
        pytest.param("9" * 5000, "which episode is", id="digits"),
    ],
)
def test_an_episode_that_is_not_there_is_refused_in_one_line(folder, which, says):
    with pytest.raises(SweepError, match=r"^[^\n]*$") as refused:
        find_episode(folder, which)
    assert says in str(refused.value)


def test_a_sweep_without_rows_says_so(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "empty")
    rows = tmp_path / "empty" / "episodes.csv"
    rows.write_text(rows.read_text().partition("\n")[0] + "\n")
    for which in ("1", "random_destination:follower:5"):
        with pytest.raises(SweepError, match="empty has no rows: no episode of it has ended"):
            find_episode(tmp_path / "empty", which)


def test_what_has_changed_since_is_told(folder, tmp_path):
    for name in ("episodes.csv", "manifest.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    content = json.loads((folder / "manifest.json").read_text())
    content["versions"]["numpy"] = "0.1"
    content["configuration"]["scenarios"]["random_destination"]["digest"] = "0" * 16
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    changes = find_episode(tmp_path, "1").changes
    assert len(changes) == 2
    assert "scenario" in changes[0]
    assert changes[1].startswith("numpy 0.1 -> ")


def test_an_event_that_nothing_brings_any_more_is_said_to_be_missing(folder, tmp_path):
    (tmp_path / "episodes.csv").write_bytes((folder / "episodes.csv").read_bytes())
    content = json.loads((folder / "manifest.json").read_text())
    content["configuration"]["scenarios"]["random_destination"]["values"]["events"] = [{"kind": "my_gust"}]
    content["configuration"]["imported"] = {"gusts.py": {}}
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(SweepError, match=r"events\.0\.kind: unknown kind of event 'my_gust'") as refused:
        find_episode(tmp_path, "1")
    assert "one of your own comes with `rudc --import FILE.py COMMAND ...`" in str(refused.value)
    assert str(refused.value).endswith(" and --import gusts.py")


@pytest.mark.parametrize("text", [None, "{", "[]", '{"configuration": {}}'])
def test_a_folder_of_something_else_is_refused(tmp_path, text):
    if text is not None:
        (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(SweepError, match="not the folder of a sweep"):
        find_episode(tmp_path, "1")


def test_a_plug_in_that_is_another_is_named(folder, tmp_path, monkeypatch):
    swept = tmp_path / "swept"
    shutil.copytree(folder, swept)
    content = json.loads((swept / "manifest.json").read_text())
    then = {"same": {"version": "1"}, "kit": {"version": "1", "kit/event.py": "a"}, "gone": {"version": "1"}}
    content["configuration"]["plugins"] = then
    (swept / "manifest.json").write_text(json.dumps(content))
    now = {"same": {"version": "1"}, "kit": {"version": "1", "kit/event.py": "b"}, "new": {"version": "1"}}
    monkeypatch.setattr("rudc.evaluation.rerun.plugins", lambda: now)
    assert find_episode(swept, "1").changes == (
        "the package kit, which offers plug-ins, has changed since: kit/event.py",
        "the package gone, which offers plug-ins, is not installed here",
        "the package new, which offers plug-ins, is installed here only",
    )
