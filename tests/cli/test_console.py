"""What is said while a sweep or a training runs, and tables on narrow screens."""

import io
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from rudc.cli import metrics_table
from rudc.cli.console import SILENCE_S, SweepBar, SweepLines, console
from rudc.cli.main import _drop_odd_sizes
from rudc.cli.metrics_table import print_metrics
from rudc.cli.train import TrainBar, TrainLines
from rudc.evaluation.columns import COLUMNS, rates_of
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.tables import measured


def record(outcome, agent="follower+ttcbf", seed=0):
    return EpisodeRecord(
        {
            "scenario": "random_destination", "agent": agent, "seed": seed, "outcome": outcome, "steps": 100,
            "route_completion": 0.5, "mean_speed_mps": 7.77, "episode_reward": 111.1, "min_dtc_m": 1.23,
            "decision_ms_mean": 0.5,
        }
    )  # fmt: skip


TASK = SimpleNamespace(scenario=SimpleNamespace(name="fog"), agent="sumo")


def test_lines_say_how_it_goes_so_far(capsys):
    lines = SweepLines()
    lines.begin(4, 0, [])
    for outcome in ("success", "collision", "frozen", "success"):
        lines.advance(TASK, record(outcome))
    said = capsys.readouterr().err.splitlines()
    assert said[1].startswith("1/4 episodes, SR 100 %, VR 0 %, ")
    assert said[-1].startswith("4/4 episodes, SR 50 %, VR 25 %, ")


def test_the_bar_says_how_it_goes_so_far():
    bar = SweepBar()
    bar.begin(3, 3, [])
    bar.advance(TASK, EpisodeRecord.failed("fog", "sumo", 0, "broke"))
    assert bar._progress.tasks[0].description == "1 failed, fog, sumo"
    bar.advance(TASK, record("wrong_way"))
    assert bar._progress.tasks[0].description == "1 failed, SR 0 %, VR 100 %, fog, sumo"


def test_how_it_goes_is_told_from_counts(monkeypatch):
    """What the bar looks through does not grow with the episodes."""
    asked = []
    monkeypatch.setattr(
        "rudc.evaluation.columns.rates_of", lambda counts: asked.append(len(counts)) or rates_of(counts)
    )
    bar = SweepBar()
    bar.begin(40, 40, [])
    for _ in range(20):
        bar.advance(TASK, record("success"))
        bar.advance(TASK, record("off_road"))
    assert max(asked) == 2
    assert bar._progress.tasks[0].description == "SR 50 %, VR 50 %, fog, sumo"


def test_what_users_write_is_no_markup(rudc, tmp_path, monkeypatch):
    (tmp_path / "gate.yaml").write_text(
        "name: gate\ndescription: 'stops at [/gate], :car: and [a, b]'\n"
        "out_of_distribution: 'a [red] light'\nsweep: {ego.route.from: ['[north]', '[/x]']}\n"
    )
    answer = rudc("scenario", "list", "gate.yaml")
    assert answer.status == 0, answer.err
    for text in ("stops at [/gate], :car: and [a, b]", "OOD: a [red] light", "ego.route.from: [north], [/x]"):
        assert text in answer.out
    screen = io.StringIO()
    monkeypatch.setattr(
        "rudc.cli.console.console", lambda to_stderr: Console(file=screen, force_terminal=True)
    )
    bar = SweepBar()
    bar.begin(3, 0, [])
    bar.advance(SimpleNamespace(scenario=TASK.scenario, agent="my.py:Own(name='[/a]')"), record("success"))
    bar._progress.refresh()
    bar.close()
    assert "Own(name='[/a]')" in screen.getvalue()


def test_names_of_agents_become_no_pictures(capsys):
    name = "my.py:Car:outlook.course=true"
    console(to_stderr=True).print(name, markup=False)
    assert capsys.readouterr().err == f"{name}\n"


@pytest.mark.parametrize(
    ("command", "where"),
    [
        (("search", "random_destination", "-a", "broken.py:Broken", "-n", 7, "-w", 1, "-o", "out"),
         "failed: more; see the column `error` of evaluations.csv"),
        (("sweep", "random_destination", "-a", "broken.py:Broken", "-n", 7, "-w", 1, "-o", "out"),
         "failed: more; see the column `error` of episodes.csv"),
        (("sweep", "--verify", "swept", "--share", 1, "-w", 1), "failed: more"),
    ],
)  # fmt: skip
def test_where_further_failures_stand_is_said(rudc, tmp_path, command, where):
    agent = tmp_path / "broken.py"
    agent.write_text(
        "class Broken:\n    def reset(self, scene, seed): self.n = 0\n"
        "    def act(self, scene): return 0.0, 0.0\n"
    )
    swept = ("sweep", "random_destination", "-a", "broken.py:Broken", "-n", 7, "--set", "episode.timeout=1")
    if "--verify" in command:
        assert rudc(*swept, "-w", 1, "-o", "swept").status == 0
    agent.write_text(agent.read_text().replace("return", "1 / 0; return"))
    answer = rudc(*command)
    assert answer.status == 1
    assert [line for line in answer.err.splitlines() if line.startswith("failed: more")] == [where]


def _training(seed_rounds):
    """What the watchers look at of a training of 10 rounds of 100 decisions."""
    asked = SimpleNamespace(steps=1000 - 100 * seed_rounds)
    return SimpleNamespace(rounds=10, round_steps=100, seed_rounds=seed_rounds, training=asked)


def test_training_speaks_off_a_terminal(capsys, monkeypatch):
    config = _training(seed_rounds=2)
    now = [0.0]
    monkeypatch.setattr("rudc.cli.train.time", SimpleNamespace(monotonic=lambda: now[0]))
    lines = TrainLines(config)  # pyright: ignore[reportArgumentType]
    assert capsys.readouterr().err == ""
    lines.advance(0)
    assert capsys.readouterr().err == "training: 800 steps, after 200 of a reference driver\n"
    lines.advance(100)
    assert capsys.readouterr().err == ""
    now[0] = SILENCE_S + 10.0
    lines.advance(200)
    assert capsys.readouterr().err == "0/800 steps, 5/s\n"
    lines.advance(400)
    assert capsys.readouterr().err == ""
    lines.progress({"steps": 200, "episodes": 0, "wall_s": 80.0})
    assert capsys.readouterr().err == "200/800 steps, no episode ended, 80 s\n"


def test_the_reference_drivers_steps_are_counted_apart(capsys, monkeypatch):
    config = _training(seed_rounds=2)
    now = [0.0]
    monkeypatch.setattr("rudc.cli.train.time", SimpleNamespace(monotonic=lambda: now[0]))
    lines = TrainLines(config)  # pyright: ignore[reportArgumentType]
    lines.advance(0)
    now[0] = SILENCE_S + 10.0
    lines.advance(100)
    assert "\n100/200 steps of the reference driver, " in capsys.readouterr().err
    bar = TrainBar(config)  # pyright: ignore[reportArgumentType]
    task = bar._progress.tasks[0]
    bar.advance(0)
    bar.advance(100)
    assert (task.completed, task.total, task.description) == (0, 800, "100/200 steps of the reference driver")
    bar.advance(300)
    assert (task.completed, task.total, task.description) == (100, 800, "")
    bar.progress({"steps": 100, "episodes": 0})
    bar.advance(400)
    assert task.description == "no episode ended"
    bar.close()


@pytest.mark.parametrize("seed_rounds", [0, 2])
def test_a_training_that_goes_on_is_not_starting(seed_rounds):
    """Its first round ends beyond the reference driver's steps: without one, and resumed after it."""
    config = _training(seed_rounds)
    bar = TrainBar(config)  # pyright: ignore[reportArgumentType]
    task = bar._progress.tasks[0]
    bar.advance(200)
    assert (task.completed, task.description) == (200 - 100 * seed_rounds, "starting")
    bar.advance(300)
    assert task.description == ""
    bar.close()


BY = ("scenario", "agent")
ROWS = [
    dict(zip(COLUMNS, record(outcome, agent, seed).row(), strict=True))
    for agent in ("gap-acceptance+ttcbf", "rudc-t")
    for seed, outcome in enumerate(["success", "success", "frozen", "collision"])
]


@pytest.fixture
def shown(monkeypatch, capsys):
    """The table on a screen of some width, and what is said beside it."""

    def show(width, rows=ROWS):
        screen = Console(file=io.StringIO(), width=width, highlight=False)
        monkeypatch.setattr(metrics_table, "console", lambda: screen)
        print_metrics(measured(rows, BY), BY)
        return screen.file.getvalue().splitlines(), capsys.readouterr().err

    return show


def test_a_wide_screen_shows_everything_in_a_line_each(shown):
    lines, said = shown(200)
    assert len(lines) == 3
    assert "decision (ms)" in lines[0]
    assert lines[1].startswith("random_destination  gap-acceptance+ttcbf  4  50.0 [15.0, 85.0]")
    assert said == ""


def test_a_mean_of_fewer_episodes_than_its_row_has_is_named(shown):
    """Where nobody was met there is no gap, and n does not show it."""
    alone = [{**row, "min_dtc_m": ""} if row["seed"] in "03" else row for row in ROWS]
    _, said = shown(200, [*ROWS[:4], *alone[4:]])
    assert said == "min-DTC of random_destination, rudc-t: from 2 of 4 episodes\n"
    _, said = shown(200, alone)
    assert said.endswith("ttcbf: from 2 of 4 episodes; other means from fewer than n: 1\n")
    _, said = shown(200, [{**row, "min_dtc_m": ""} for row in ROWS])
    assert said == ""  # its cells say so


@pytest.mark.parametrize("width", [80, 90, 100, 120, 140])
def test_a_narrow_screen_breaks_no_number_and_says_what_is_missing(shown, width):
    lines, said = shown(width)
    assert max(map(len, lines)) <= width
    assert sum("50.0 [15.0, 85.0]" in line for line in lines) == 2
    assert sum("25.0 [4.6, 69.9]  " in line for line in lines) == 2
    assert any(line.startswith("random_destination") for line in lines)
    head = "".join(lines[:2])
    for name in ("AER", "RC", "AES", "min-DTC"):
        assert (name in head) != (name in said)


def test_off_a_terminal_columns_may_be_told(rudc, tmp_path, monkeypatch):
    """Else nothing is cut off or left out."""
    shutil.copytree(Path(__file__).parents[2] / "results" / "by-chance", "chance")
    assert max(map(len, rudc("table", "chance").out.splitlines())) > 120
    monkeypatch.setenv("COLUMNS", "100")
    answer = rudc("table", "chance")
    assert max(map(len, answer.out.splitlines())) <= 100
    assert "too narrow for RC, AER, decision" in answer.err


def test_columns_that_say_no_width_are_passed_over(rudc, monkeypatch):
    shown = rudc("agent", "list")
    monkeypatch.setenv("COLUMNS", "0")
    assert rudc("agent", "list") == shown
    assert "Commands" in rudc("--help").out
    for columns in ("\u00b2", "9" * 5000, "wide"):
        monkeypatch.setenv("COLUMNS", columns)
        _drop_odd_sizes()
        assert "COLUMNS" not in os.environ, columns[:9]


def test_long_names_get_a_line_of_their_own(shown):
    long = "rudc-t:correction.d_safe=0.3,correction.slack.gain=0.05,correction.residual=off"
    lines, _ = shown(100, [{**row, "agent": f"{long},{row['agent']}"} for row in ROWS])
    assert f"random_destination, {long},rudc-t" in lines
    assert sum("50.0 [15.0, 85.0]" in line for line in lines) == 2
