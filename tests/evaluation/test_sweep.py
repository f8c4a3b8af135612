"""Sweeps: the same files whatever the workers, after a kill, after trouble; and what is refused."""

import errno
import json
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from rudc.errors import InputError, PartFailedError, SimulationError, StorageError, SweepError
from rudc.evaluation import folder as folder_module
from rudc.evaluation.columns import COLUMNS, TIMING
from rudc.evaluation.folder import read_sweep, sweep_rows
from rudc.evaluation.rerun import find_episode
from rudc.evaluation.store import RowFile, format_row, read_table
from rudc.evaluation.sweep import ENGINES, Engine, run_sweep
from rudc.evaluation.tables import measured
from rudc.evaluation.tasks import SweepPlan
from rudc.scenario import find_scenarios

FILES = ("manifest.json", "metrics.csv")


def episodes(folder: Path) -> list[dict[str, str]]:
    """Rows of episodes.csv without what depends on the machine."""
    rows = read_table(folder / "episodes.csv")
    return [{name: text for name, text in row.items() if name not in TIMING} for row in rows]


def assert_same(a: Path, b: Path) -> None:
    assert sorted(p.name for p in a.iterdir()) == sorted(p.name for p in b.iterdir())
    assert episodes(a) == episodes(b)
    for name in FILES:
        assert (a / name).read_bytes() == (b / name).read_bytes(), name


@pytest.fixture(autouse=True)
def _steady_code_version(monkeypatch):
    """Others may edit the checkout while tests run."""
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v0")


def test_files_do_not_depend_on_the_number_of_workers(fakes, make_plan, tmp_path):
    plan = make_plan(("random_destination", "density_sweep"), episodes=4)
    one = run_sweep(plan, tmp_path / "one", fakes.Runner, workers=1)
    run_sweep(plan, tmp_path / "three", partial(fakes.Runner, 0.01), workers=3)
    assert_same(tmp_path / "one", tmp_path / "three")
    assert len(one.rows) == (1 + 5) * 2 * 4
    assert [row["scenario"] for row in one.rows][:8] == ["random_destination"] * 8
    assert [row["traffic.density"] for row in one.rows[8:16]] == ["10"] * 8
    assert [row["seed"] for row in one.rows[:5]] == ["0", "1", "2", "3", "0"]
    header = (tmp_path / "one" / "episodes.csv").read_text().splitlines()[0].split(",")
    assert header == [*COLUMNS, "traffic.density"]
    metrics = read_table(tmp_path / "one" / "metrics.csv")
    assert [(row["traffic.density"], row["agent"]) for row in metrics][:4] == [
        ("", "sumo"), ("", "follower"), ("10", "sumo"), ("10", "follower"),
    ]  # fmt: skip
    assert all(row["episodes"] == "4" and row["errors"] == "0" for row in metrics)


def test_a_sweep_killed_at_any_moment_and_resumed_gives_the_same_files(fakes, tmp_path):
    plan = fakes.slow_plan()
    script = [sys.executable, fakes.__file__, str(tmp_path / "killed")]
    rows = tmp_path / "killed" / "episodes.csv"
    for enough in (2, 11):
        process = subprocess.Popen([*script, "0.05", "2"])
        deadline = time.monotonic() + 300
        while not rows.exists() or rows.read_bytes().count(b"\n") <= enough:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)
        process.kill()
        process.wait()
        with rows.open("ab") as file:  # as a kill in the middle of a write would leave it
            file.write(b"density_sweep,sumo,1")
    assert len(read_sweep(tmp_path / "killed")[0]) >= 11
    assert not (tmp_path / "killed" / "metrics.csv").exists()
    run_sweep(plan, tmp_path / "killed", fakes.Runner, workers=2, resume=True)
    run_sweep(plan, tmp_path / "whole", fakes.Runner)
    whole, killed = (
        json.loads((tmp_path / name / "manifest.json").read_text()) for name in ("whole", "killed")
    )
    killed.pop("resumed_with", None)  # there when someone edits the checkout meanwhile
    whole["versions"]["code"] = killed["versions"]["code"] = ""
    assert whole == killed
    for name in ("whole", "killed"):
        (tmp_path / name / "manifest.json").write_text("")
    assert_same(tmp_path / "whole", tmp_path / "killed")


def test_resuming_a_finished_sweep_changes_nothing(fakes, make_plan, tmp_path):
    plan = make_plan()
    run_sweep(plan, tmp_path / "out", fakes.Runner)
    shutil.copytree(tmp_path / "out", tmp_path / "before")
    run_sweep(plan, tmp_path / "out", fakes.no_runner, resume=True)
    assert_same(tmp_path / "before", tmp_path / "out")
    assert (tmp_path / "out" / "episodes.csv").read_bytes() == (
        tmp_path / "before" / "episodes.csv"
    ).read_bytes()


def test_keys_of_a_resumed_sweep_may_come_in_another_order(fakes, tmp_path):
    swept = {"traffic.density": [10, 20], "episode.timeout": [30, 40]}
    plans = [
        SweepPlan(tuple(find_scenarios(["random_destination"], overrides=dict(given))), ("sumo",), 1, 0)
        for given in (swept.items(), reversed(swept.items()))
    ]
    run_sweep(plans[0], tmp_path, fakes.Runner)
    before = read_table(tmp_path / "episodes.csv")
    run_sweep(plans[1], tmp_path, fakes.no_runner, resume=True)
    after = read_table(tmp_path / "episodes.csv")
    assert list(after[0]) == [*COLUMNS, *swept]
    assert sorted(map(str, after)) == sorted(map(str, before))


def test_failed_episodes_have_a_row_and_are_run_again_on_resume(fakes, make_plan, tmp_path):
    plan = make_plan(agents=("sumo",), episodes=3)
    result = run_sweep(plan, tmp_path / "out", partial(fakes.Troubled, "fail", tmp_path))
    (wrong,) = result.errors
    assert (wrong["seed"], wrong["outcome"], wrong["error"]) == ("1", "", "SUMO failed, badly")
    (metrics,) = read_table(tmp_path / "out" / "metrics.csv")
    assert (metrics["episodes"], metrics["errors"]) == ("2", "1")
    run_sweep(plan, tmp_path / "out", fakes.Runner, resume=True)
    run_sweep(plan, tmp_path / "clean", fakes.Runner)
    assert_same(tmp_path / "out", tmp_path / "clean")


@pytest.mark.parametrize("between", ["  ", "\n"], ids=["two blanks", "a line break"])
def test_an_agents_name_may_have_any_blanks_in_it(fakes, make_plan, tmp_path, between):
    (tmp_path / "my.py").write_text(
        "class Slow:\n    reset = act = lambda *_: None\n    def __init__(self, speed, gain): pass\n"
    )
    name = f"{tmp_path / 'my.py'}:Slow(speed=3,{between}gain=2)"
    plan = make_plan(agents=("follower", name))
    rows = run_sweep(plan, tmp_path / "out", fakes.Runner).rows
    assert len(rows) == 6
    assert find_episode(tmp_path / "out", "4").changes == ()
    (tmp_path / "out" / "metrics.csv").unlink()
    assert run_sweep(plan, tmp_path / "out", fakes.no_runner, resume=True).rows == rows
    with pytest.raises(SweepError, match="is given more than once"):
        make_plan(agents=(name, name.replace("\n", " ")))


def test_a_missing_row_is_run_again(fakes, make_plan, tmp_path):
    plan, rows = make_plan(), tmp_path / "out" / "episodes.csv"
    run_sweep(plan, tmp_path / "whole", fakes.Runner)
    shutil.copytree(tmp_path / "whole", tmp_path / "out")
    lines = rows.read_text().splitlines(keepends=True)
    rows.write_text("".join(lines[:3] + lines[4:]))
    run_sweep(plan, tmp_path / "out", fakes.Runner, resume=True)
    assert_same(tmp_path / "whole", tmp_path / "out")


def test_more_episodes_can_be_added_and_fewer_are_refused(fakes, make_plan, tmp_path):
    few, more = make_plan(episodes=3), make_plan(episodes=5)
    run_sweep(few, tmp_path / "grown", fakes.Runner)
    run_sweep(more, tmp_path / "grown", fakes.Runner, resume=True)
    run_sweep(more, tmp_path / "whole", fakes.Runner)
    assert_same(tmp_path / "grown", tmp_path / "whole")
    with pytest.raises(SweepError, match="episodes: 5 there, 3 here"):
        run_sweep(few, tmp_path / "grown", fakes.Runner, resume=True)


def as_written_before(folder: Path) -> None:
    """Make a finished folder what the first version would have left of the same episodes."""
    rows = [{**row, "violation": ""} for row in read_table(folder / "episodes.csv")]
    apart = ("origin", "destination", "turn", "priority", "redraws", "density", "sv_collisions")
    lost = ("engaged_steps", "events_fired", "first_event_s", "first_event_visible_s")
    episodes = [name for name in rows[0] if name not in (*apart, *lost)]
    for name, header in (
        ("episodes.csv", episodes),
        ("conditions.csv", ["scenario", "agent", "seed", "traffic.density", *apart]),
    ):
        RowFile(folder / name, header).rewrite(format_row([row[column] for column in header]) for row in rows)
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps({**manifest, "format": 1}))


def test_a_folder_of_an_earlier_version_reads_and_is_not_gone_on_with(fakes, make_plan, tmp_path):
    plan = make_plan(("density_sweep",))
    now = run_sweep(plan, tmp_path, fakes.Runner).rows
    as_written_before(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    rows, parameters = read_sweep(tmp_path)
    assert parameters == ("traffic.density",)
    assert list(rows[0]) == [*COLUMNS, "traffic.density"]
    for old, new in zip(rows, now, strict=True):
        assert (old["interventions"], old["engaged_steps"]) == ("", new["interventions"])
        counted = ("interventions", "engaged_steps")
        assert {k: v for k, v in old.items() if k not in counted} == {
            k: v for k, v in new.items() if k not in counted
        }
    with pytest.raises(SweepError, match=r"another version of RUDC, without engaged_steps, .*another --out"):
        run_sweep(plan, tmp_path, fakes.Runner, resume=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_engine_that_loses_episodes_is_found_out(fakes, make_plan, tmp_path, monkeypatch):
    def half(tasks, workers, limit_s, make_runner):
        run = make_runner()
        yield from ((task, run(task)) for task in tasks[::2])

    monkeypatch.setitem(ENGINES, "half", Engine(half))
    plan = make_plan()
    with pytest.raises(SimulationError, match=r"without 3 of 6 episodes, the first: .*, seed 1;"):
        run_sweep(plan, tmp_path / "out", fakes.Runner, engine="half")
    assert len(read_sweep(tmp_path / "out")[0]) == 3
    assert len(run_sweep(plan, tmp_path / "out", fakes.Runner, resume=True).rows) == 6


def test_a_column_that_is_not_known_here_is_no_swept_parameter(fakes, make_plan, tmp_path):
    """Of somebody's own, read without it; of a later version of RUDC, wherever it stands there."""
    made = run_sweep(make_plan(("density_sweep",), ("sumo",), 2), tmp_path, fakes.Runner).rows
    header = [*COLUMNS, "waste", "traffic.density"]
    header.insert(5, "later")
    lines = [{**row, "waste": str(k / 10), "later": "x"} for k, row in enumerate(made)]
    RowFile(tmp_path / "episodes.csv", header).rewrite(
        format_row([row[name] for name in header]) for row in lines
    )
    rows, parameters = read_sweep(tmp_path)
    assert parameters == ("traffic.density",)
    assert list(rows[0]) == [*COLUMNS, "later", "waste", "traffic.density"]
    assert rows == lines
    assert len(measured(sweep_rows(tmp_path), ["scenario", *parameters])) == len(rows) // 2
    assert len(measured(sweep_rows(tmp_path), ["waste"])) == len(rows)
    assert find_episode(tmp_path, "2").row == rows[1]
    (tmp_path / "manifest.json").unlink()
    assert read_sweep(tmp_path)[1] == ("later", "waste", "traffic.density")


def test_rows_that_lack_a_column_are_never_mixed_with_others(fakes, make_plan, tmp_path):
    rows = run_sweep(make_plan(), tmp_path, fakes.Runner).rows
    header = [name for name in COLUMNS if name != "density"]
    RowFile(tmp_path / "episodes.csv", header).rewrite(
        format_row([row[name] for name in header]) for row in rows
    )
    assert read_sweep(tmp_path)[0][0]["density"] == ""
    with pytest.raises(SweepError, match="another version of RUDC, without density: its rows and new ones"):
        run_sweep(make_plan(), tmp_path, fakes.Runner, resume=True)


def test_a_folder_with_something_in_it_is_refused(fakes, make_plan, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SweepError, match=r"not empty \(notes.txt\); add --resume .* or give another --out"):
        run_sweep(make_plan(), tmp_path, fakes.Runner)
    with pytest.raises(SweepError, match="not the folder of a sweep"):
        run_sweep(make_plan(), tmp_path, fakes.Runner, resume=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1


def test_an_agent_that_is_not_there_leaves_no_folder(fakes, make_plan, tmp_path):
    with pytest.raises(InputError, match="did you mean 'planner'"):
        run_sweep(make_plan(agents=("plannr",)), tmp_path / "out", fakes.Runner)
    assert not (tmp_path / "out").exists()


def test_where_no_folder_can_be_is_said(fakes, make_plan, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file is a file; give another folder"):
        run_sweep(make_plan(), tmp_path / "file", fakes.Runner)
    with pytest.raises(InputError, match=r"cannot be made a folder \(Not a directory\); give another folder"):
        run_sweep(make_plan(), tmp_path / "file" / "x", fakes.Runner)
    monkeypatch.setattr("rudc.files.os.access", lambda *_: False)
    with pytest.raises(InputError, match=r"no permission.*; give another folder"):
        run_sweep(make_plan(), tmp_path / "locked", fakes.Runner)


def test_another_configuration_is_refused_and_what_differs_is_said(fakes, make_plan, tmp_path):
    run_sweep(make_plan(episodes=2), tmp_path, fakes.Runner)
    before = (tmp_path / "episodes.csv").read_bytes()
    with pytest.raises(SweepError, match="episodes: 2 there, 1 here"):
        run_sweep(make_plan(episodes=1), tmp_path, fakes.Runner, resume=True)
    with pytest.raises(SweepError, match="seed: 0 there, 5 here"):
        run_sweep(make_plan(episodes=2, seed=5), tmp_path, fakes.Runner, resume=True)
    with pytest.raises(SweepError, match="agents: follower only there"):
        run_sweep(make_plan(agents=("sumo",), episodes=2), tmp_path, fakes.Runner, resume=True)
    plan = make_plan(episodes=2)
    denser = plan.scenarios[0].varied({"traffic.density": 35})
    with pytest.raises(SweepError, match=r"random_destination\.values\.traffic\.density: 20.* there, 35"):
        run_sweep(SweepPlan((denser,), plan.agents, 2, 0), tmp_path, fakes.Runner, resume=True)
    assert (tmp_path / "episodes.csv").read_bytes() == before


def test_other_versions_are_recorded_and_warned_of(fakes, make_plan, tmp_path, monkeypatch):
    run_sweep(make_plan(), tmp_path, fakes.Runner)
    before = (tmp_path / "manifest.json").read_bytes()
    told = []

    class Listener:
        def begin(self, total, finished, warnings):
            told.extend(warnings)

        def advance(self, task, record):
            pass

    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v1")
    run_sweep(make_plan(), tmp_path, fakes.Runner, resume=True, progress=Listener())
    assert (tmp_path / "manifest.json").read_bytes() == before  # nothing was left to run
    assert not told
    run_sweep(make_plan(episodes=4), tmp_path, fakes.Runner, resume=True, progress=Listener())
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v2")
    run_sweep(make_plan(episodes=4), tmp_path, fakes.Runner, resume=True, progress=Listener())
    content = json.loads((tmp_path / "manifest.json").read_text())
    assert content["versions"]["code"] == "v0"
    assert [entry["code"] for entry in content["resumed_with"]] == ["v1"]
    assert len(told) == 2
    assert "code v0 -> v1" in told[0]


def test_two_sweeps_cannot_write_to_one_folder(fakes, make_plan, tmp_path):
    with folder_module.SweepFolder(tmp_path, make_plan()) as first:
        first.open(resume=False)
        with pytest.raises(InputError, match="another rudc is writing"):
            run_sweep(make_plan(), tmp_path, fakes.Runner, resume=True)
    run_sweep(make_plan(), tmp_path, fakes.Runner, resume=True)


def test_a_full_disk_ends_the_sweep_and_keeps_what_is_there(fakes, make_plan, tmp_path, monkeypatch):
    plan = make_plan(episodes=5)
    real, written = RowFile._write, []

    def full(file, data):
        written.append(data)
        if len(written) <= 8:
            return real(file, data)
        real(file, data[:5])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(RowFile, "_write", full)
        with pytest.raises(StorageError, match=r"the disk is full\. .* are kept; .* with --resume"):
            run_sweep(plan, tmp_path / "out", fakes.Runner)
    assert len(read_sweep(tmp_path / "out")[0]) == 8
    run_sweep(plan, tmp_path / "out", fakes.Runner, resume=True)
    run_sweep(plan, tmp_path / "whole", fakes.Runner)
    assert_same(tmp_path / "whole", tmp_path / "out")


def test_workers_that_cannot_start_leave_a_folder_that_can_be_resumed(fakes, make_plan, tmp_path):
    with pytest.raises(SimulationError, match="cannot start"):
        run_sweep(make_plan(), tmp_path / "out", fakes.no_runner)
    run_sweep(make_plan(), tmp_path / "out", fakes.Runner, resume=True)


def test_an_engine_that_raises_is_named_and_what_it_did_is_kept(make_plan, fakes, tmp_path, monkeypatch):
    def half(tasks, workers, limit_s, make_runner):
        yield tasks[0], make_runner()(tasks[0])
        raise RuntimeError("no more")

    monkeypatch.setitem(ENGINES, "half", Engine(half))
    with pytest.raises(
        PartFailedError, match=r"engine half raised RuntimeError: no more \(test_sweep.py:\d+\)"
    ):
        run_sweep(make_plan(), tmp_path / "out", fakes.Runner, engine="half")
    assert len(read_sweep(tmp_path / "out")[0]) == 1


@pytest.mark.parametrize(
    ("scenarios", "agents", "told"),
    [
        (("fog",), "planner", "`agents` of a sweep is a tuple of them, not 'planner': ('planner',)"),
        ("fog", ("planner",), "`scenarios` of a sweep is a tuple of them, not 'fog': find_scenarios("),
        (("fog",), ("planner", object), "give one of your own a name, rudc.register_agent("),
        (("fog",), (b"planner",), "an agent is given by its name, not as b'planner'"),
    ],
)
def test_one_thing_instead_of_several_is_refused(scenarios, agents, told):
    with pytest.raises(InputError) as caught:
        SweepPlan(scenarios if isinstance(scenarios, str) else tuple(find_scenarios(scenarios)), agents, 1, 0)
    assert told in str(caught.value)


def test_names_are_no_scenarios():
    with pytest.raises(SweepError, match=r"'fog' is no scenario: find_scenarios\(\[NAME, ...\]\) gives"):
        SweepPlan(("fog",), ("planner",), 1, 0)
    with pytest.raises(InputError, match=r"scenarios are given as a list of names: \['fog'\], not 'fog'"):
        find_scenarios("fog")


def test_nonsense_is_refused(make_plan, fakes, tmp_path):
    for wrong, match in (
        ({"names": ()}, "at least one scenario"),
        ({"agents": ()}, "at least one agent"),
        ({"agents": ("sumo", "sumo")}, "given more than once"),
        ({"episodes": 0}, "at least one episode"),
        ({"seed": -1}, "cannot be negative"),
    ):
        with pytest.raises(SweepError, match=match):
            make_plan(**wrong)
    with pytest.raises(SweepError, match="at least one worker"):
        run_sweep(make_plan(), tmp_path, fakes.Runner, workers=0)
