"""Damaged sweep folders: what is wrong, and in which line, never a traceback nor a table of nonsense."""

import shutil
import tracemalloc

import pytest

from rudc.errors import SweepError
from rudc.evaluation.folder import read_sweep, sweep_rows
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tables import measured


@pytest.fixture(scope="module")
def finished(fakes, make_plan, tmp_path_factory):
    """A sweep of six episodes."""
    out = tmp_path_factory.mktemp("finished") / "out"
    run_sweep(make_plan(), out, fakes.Runner)
    return out


@pytest.fixture
def folder(finished, tmp_path):
    """A copy of it, to be damaged."""
    return shutil.copytree(finished, tmp_path / "out")


@pytest.mark.parametrize(
    "text",
    ["[]", "null", "3", "{}", "", "{", "[" * 100_000, '{"format": 2}', '{"format": 2, "configuration": []}',
     '{"format": "2", "configuration": {"scenarios": [], "agents": {}, "episodes": 1, "seed": 0}}'],
    ids=lambda text: text[:30] or "empty",
)  # fmt: skip
def test_a_manifest_that_is_none_is_refused(folder, fakes, make_plan, text):
    (folder / "manifest.json").write_text(text)
    with pytest.raises(SweepError, match=r"manifest\.json"):
        run_sweep(make_plan(), folder, fakes.Runner, resume=True)


def _cell(column, value):
    def change(lines):
        cells = lines[3].split(",")
        cells[lines[0].split(",").index(column)] = value
        lines[3] = ",".join(cells)

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_cell("outcome", "banana"), r":4: outcome: 'banana' is none; there are collision, "),
        (_cell("seed", "-1"), r":4: seed: '-1' is no number"),
        (_cell("steps", "many"), r":4: steps: 'many' is no number between "),
        (_cell("duration_s", "inf"), r":4: duration_s: 'inf' is no number between "),
        (
            _cell("mean_speed_mps", "-1e308"),
            r":4: mean_speed_mps: '-1e308' is no number between -1e\+12 and ",
        ),
        (_cell("error", "it failed"), r":4: outcome: '\w+' of an episode that has an error"),
        (_cell("origin", '"south'), r":4: not a row of a CSV file"),
        (_cell("origin", "a,b"), r":4: has \d+ cells, not \d+"),
        (lambda lines: lines.insert(5, lines[2]), r":6: the same episode as line 3"),
        (lambda lines: lines.insert(2, "garbage"), r":3: has 1 cells"),
        (lambda lines: lines.insert(2, "\udcff\udcfe"), r":3: not valid UTF-8"),
        (lambda lines: lines.insert(2, ""), r":3: has 0 cells"),
    ],
)
def test_a_damaged_row_is_named_by_its_line(folder, fakes, make_plan, change, told):
    path = folder / "episodes.csv"
    lines = path.read_text(encoding="utf-8").split("\n")
    change(lines)
    path.write_bytes("\n".join(lines).encode("utf-8", "surrogateescape"))
    with pytest.raises(SweepError, match=r"episodes\.csv" + told):
        read_sweep(folder)
    manifest = (folder / "manifest.json").read_bytes()
    with pytest.raises(SweepError, match=r"episodes\.csv" + told):
        run_sweep(make_plan(episodes=9), folder, fakes.Runner, resume=True)
    assert (folder / "manifest.json").read_bytes() == manifest  # refused, and so as it was


def test_numbers_of_episodes_that_failed_are_checked_too(folder):
    """Reports read them, whether or not the episode ran."""
    path = folder / "episodes.csv"
    lines = path.read_text(encoding="utf-8").split("\n")
    for column, value in (("outcome", ""), ("error", "it failed"), ("first_event_s", "first_event_s")):
        _cell(column, value)(lines)
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(
        SweepError, match=r"episodes\.csv:4: first_event_s: 'first_event_s' is no number between "
    ):
        read_sweep(folder)


def test_an_episode_that_failed_and_then_ran_twice_is_refused(folder):
    path = folder / "episodes.csv"
    lines = path.read_text(encoding="utf-8").split("\n")
    failed = lines[1].split(",")
    for column, value in (("outcome", ""), ("error", "it failed")):
        failed[lines[0].split(",").index(column)] = value
    path.write_text(
        "\n".join([lines[0], ",".join(failed), *lines[1:3], lines[1], *lines[3:]]), encoding="utf-8"
    )
    with pytest.raises(SweepError, match=r"episodes\.csv:5: the same episode as line 3"):
        read_sweep(folder)


def test_rows_of_a_folder_are_in_memory_a_block_at_a_time(folder, monkeypatch):
    """So a million take `rudc table` less than 500 MB: `python -m tests.benchmarks.scaling`."""
    monkeypatch.setattr("rudc.evaluation.store._BLOCK", 300_000)
    path, count = folder / "episodes.csv", 20_000
    head, first, *_ = path.read_text(encoding="utf-8").split("\n")
    cells = first.split(",")
    with path.open("w", encoding="utf-8") as file:
        file.write(head + "\n")
        for seed in range(count):
            file.write(",".join([*cells[:2], str(seed), *cells[3:]]) + "\n")
    size = path.stat().st_size
    tracemalloc.start()
    try:
        (group,) = measured(sweep_rows(folder), ("scenario", "agent"))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert group.episodes == count
    assert peak < 3 * size
