"""Wrong input: exit status 2, one clear message on stderr, no traceback."""

import subprocess
import sys
from pathlib import Path

import pytest

SWEEP = ("sweep", "random_destination", "--agent", "follower", "--episodes", "1", "--out", "out")
SEARCH = ("search", "random_destination", "--agent", "follower", "--out", "out")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (
            ("sweep", "random_destination", "-a", "gap_acceptance", "-o", "x"),
            "did you mean 'gap-acceptance'?",
        ),
        (("sweep", "random_destinaton", "-a", "sumo", "-o", "x"), "random_destination"),
        (("sweep", "random_destination", "-o", "x"), "give at least one --agent NAME"),
        (("sweep", "-a", "sumo", "-o", "x"), "which scenarios?"),
        ((*SWEEP, "--engine", "locl"), "no engine 'locl' (did you mean 'local'?)"),
        (("sweep", "random_destination", "-a", "sumo"), "--out DIR"),
        ((*SWEEP, "--episode-limit", "inf"), "at most 1e+08 s, three years; not inf"),
        ((*SEARCH, "--over", "traffic.densty=[5, 30]"), "--over: traffic.densty: unknown key (did you mean"),
        ((*SEARCH, "--over", "traffic.density=5"), "--over traffic.density=5: expected KEY=[LOW, HIGH]"),
        ((*SEARCH, "--over", "traffic.density=[30, 5]"), "low 30 is above high 5"),
        ((*SEARCH, "--over", "traffic.density=[5, 5]"), "--over traffic.density: not a number with a low"),
        ((*SEARCH, "--over", "traffic.density=[5, 9999]"), "traffic.density"),
        ((*SEARCH, "--over", "ego.route=[1, 2]"), "ego.route"),
        (
            ("search", "plain.yaml", "-a", "follower", "-o", "x"),
            "draws no number that could be searched over",
        ),
        (("search", "density_sweep", "-a", "follower", "-o", "x"), "--over 'traffic.density=[low, high]'"),
        (("search", "random_destination", "-a", "follower"), "--out DIR"),
        (("search", "random_destination", "-a", "folower", "-o", "x"), "did you mean 'follower'?"),
        ((*SEARCH, "-a", "sumo"), "2 agents were named; `rudc search` takes one"),
        (("run", "random_destination", "--agent", ""), "the name of an agent is empty"),
        (("run", "random_destination", "--agent", "sumo+ecbf"), "SUMO itself drives"),
        (
            ("run", "random_destination", "--set", "traffic.densty=30"),
            "--set: traffic.densty: unknown key (did",
        ),
        ((*SWEEP, "--set", "traffic.densty=[3, 30]"), "--set: traffic.densty: unknown key (did you mean"),
        (("scenario", "preview", "fog", "--set", "ego.speed=-1"), "--set: ego.speed: -1 m/s is not between"),
        (("run", "random_destination", "--set", "traffic.density"), "expected KEY=VALUE"),
        (("run", "random_destination", "--video", "film.avi"), "a film is a .gif, .webp or .mp4"),
        (("run", "nowhere.yaml"), "nowhere.yaml: no such file"),
        (("agent", "show", "folower"), "did you mean 'follower'?"),
        (("scenario", "validate", "nowhere.yaml"), "no such file"),
        (("scenario", "validate", "fog", "--seed", 3), "give --seeds, too"),
        (
            ("residual", "collect", "--agent", "follower", "--action", "direct", "--out", "x.safetensors"),
            "--agent drives with its own: give one of them",
        ),
        (("residual", "evaluate", "x.safetensors", "--action", "nonsense"), "'nonsense'"),
        (("scenario", "new", "bad name"), "'bad name' cannot be a scenario's name: expected letters"),
        (("scenario", "new", "sub/mine"), "'sub/mine' cannot be a scenario's name"),
        (("scenario", "new", "sub/mine.yaml"), "; give the folder by --in DIR"),
        (("scenario", "new", "123"), "YAML reads it as another thing than text"),
        (("network", "check", "four_wya"), "did you mean 'four_way'?"),
        (("network", "build", "nowhere"), "no such folder"),
        (("table", "nowhere"), "is it the folder of a sweep?"),
    ],
)
def test_wrong_input_is_answered_with_what_is_wrong(rudc, tmp_path, arguments, expected):
    (tmp_path / "plain.yaml").write_text("name: plain\nnetwork: four_way\nego: {speed: 8, distance: 40}\n")
    answer = rudc(*arguments)
    assert answer.status == 2
    assert expected in answer.err
    assert answer.err.startswith("error: ")
    assert "Traceback" not in answer.err
    assert answer.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["plain.yaml"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("sweeep",),
        ("sweep", "--epsodes", "3"),
        ("sweep", "x", "--episodes", "zero"),
        ("table", "x", "-f", "word"),
    ],
)
def test_wrong_usage_has_the_same_status(rudc, arguments):
    answer = rudc(*arguments)
    assert answer.status == 2
    assert "Usage: rudc" in answer.err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("table", "x", "-f", "html"), "'-f': 'html' is not one of 'csv', 'markdown', 'latex'."),
        (
            ("table", "x", "--against", "me"),
            "'--against': 'me' is not one of 'comparison', 'ablation', 'paper'.",
        ),
        (("run", "fog", "--seed", "abc"), "'--seed': expected a whole number"),
        (("run", "fog", "--seed", "-1"), "'--seed': must be at least 0"),
        (("scenario", "validate", "fog", "--seeds", "1.5"), "'--seeds': expected a whole number"),
        (("sweep", "fog", "--episode-limit", "long"), "'--episode-limit': expected a number"),
        (("search", "a", "b", "-a", "sumo", "-o", "x"), "`rudc search` takes one SCENARIO; too many: b"),
        (("agent", "list", "b", "c"), "`rudc agent list` takes options only; too many: b c"),
    ],
)
def test_wrong_usage_is_told_in_plain_words(rudc, arguments, expected):
    answer = rudc(*arguments)
    assert answer.status == 2
    assert expected in " ".join(answer.err.split())
    for theirs in ("Value error", "Input should", "argument(s)"):
        assert theirs not in answer.err


def test_settings_are_refused_in_plain_words(rudc):
    answer = rudc("train", "sac", "-o", "x", "--set", "training.steps=many")
    assert (answer.status, "training.steps: expected a whole number\n" in answer.err) == (2, True)


@pytest.mark.parametrize("path", ["~/there", "--out=~/there"])
def test_a_home_that_the_shell_left_is_found(rudc, tmp_path, monkeypatch, path):
    """In quotes and behind `--out=` the shell leaves `~` as it is: it became a folder of that name."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    option = () if "=" in path else ("--out",)
    answer = rudc("sweep", "random_destination", "-a", "follower", "-n", 1, "-w", 1, "-q", *option, path)
    assert answer.status == 0, answer.err
    assert [entry.name for entry in tmp_path.iterdir()] == ["home"]
    assert rudc("table", "~/there").status == 0
    missing = rudc("scenario", "validate", "~/x.yaml")
    assert f"error: {tmp_path / 'home' / 'x.yaml'}: no such file" in missing.err


def test_all_mistakes_in_a_file_at_once_each_with_its_place(rudc, tmp_path):
    (tmp_path / "bad.yaml").write_text("name: bad\ntraffic: {densty: 3}\nevents:\n  - kind: hard_break\n")
    answer = rudc("scenario", "validate", "bad.yaml")
    assert answer.status == 2
    lines = answer.err.removeprefix("error: ").splitlines()
    assert [line.split(": ")[0] for line in lines] == ["bad.yaml:2:11", "bad.yaml:4:11"]


def test_what_does_not_fit_the_network_is_found_before_anything_runs(rudc, tmp_path):
    (tmp_path / "misfit.yaml").write_text(
        "name: misfit\nego: {route: {from: northeast, turn: left}}\nevents:\n"
        "  - {kind: lane_closure, lane: west_in_5, at: 5, length: 10}\n"
        "  - {kind: wrong_way, lane: east_in_0, at: 500, speed: 8, when: {simulation_time: {above: 3}}}\n"
        "  - {kind: pedestrian_crossing, arm: nort, at: 5, speed: 1.4, count: 1, from_side: left}\n"
    )
    for command in (("scenario", "validate", "misfit.yaml"), (*SWEEP[:1], "misfit.yaml", *SWEEP[2:])):
        answer = rudc(*command)
        assert answer.status == 2
        lines = answer.err.removeprefix("error: ").splitlines()
        assert [line.split(": ")[:2] for line in lines] == [
            ["misfit.yaml:2:21", "ego.route.from"],
            ["misfit.yaml:4:32", "events.0.lane"],
            ["misfit.yaml:5:44", "events.1.at"],
            ["misfit.yaml:6:38", "events.2.arm"],
        ]
        assert "cars have west_in_0, west_in_1 there" in lines[1]
    assert not (tmp_path / "out").exists()


def test_each_of_many_files_gets_a_line_and_all_that_is_wrong_is_said(rudc, tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "good.yaml").write_text("name: good\nsweep: {traffic.density: [10, 20]}\n")
    (folder / "bad.yaml").write_text("name: bad\nevents: [{kind: wrong_way, lane: ego_inn, at: 5}]\n")
    (folder / "late.yaml").write_text("name: late\ntraffic: {warm_up: 0.1}\nego: {distance: 119}\n")
    answer = rudc("scenario", "validate", "elsewhere/*.yaml", "gone.yaml", "fog")
    assert answer.status == 2
    assert answer.out.splitlines() == [
        "elsewhere/bad.yaml: 1 problem",
        "elsewhere/good.yaml: ok (0 events, 2 swept points)",
        "elsewhere/late.yaml: 1 problem",
        "fog: ok (2 events)",
    ]
    lines = answer.err.removeprefix("error: ").splitlines()
    assert lines[0].startswith("gone.yaml: no such file")
    assert lines[1].startswith("elsewhere/bad.yaml:2:34: events.0.lane: no lane 'ego_inn'")
    assert "did you mean 'ego_in'?" in lines[1]
    assert lines[2].startswith("elsewhere/late.yaml:3:17: ego.distance: 119 m do not fit on arm")
    assert len(lines) == 3


def test_a_folder_that_is_not_empty_is_refused_with_advice(rudc):
    assert rudc(*SWEEP).status == 0
    again = rudc(*SWEEP)
    assert again.status == 2
    assert "add --resume to finish the sweep in it, or give another --out" in again.err
    other = rudc(*SWEEP, "--resume", "--seed", "4")
    assert other.status == 2
    assert "seed: 0 there, 4 here" in other.err


def test_an_agent_that_is_named_twice_counts_once_and_that_is_said(rudc):
    more = ("--agent", "sumo", "--agent", "follower", "--quiet")
    answer = rudc(*SWEEP, *more)
    assert answer.status == 0
    assert answer.err == "warning: --agent names follower more than once; each counts once\n"


def test_a_scenario_that_is_given_twice_by_a_link_counts_once_and_that_is_said(rudc, tmp_path):
    (tmp_path / "a.yaml").write_text("name: a\nepisode: {timeout: 1}\n")
    (tmp_path / "link.yaml").symlink_to("a.yaml")
    for given in (("a.yaml", "link.yaml", "./a.yaml"), ("*.yaml",)):
        answer = rudc("sweep", *given, "-a", "follower", "-n", "1", "-w", "1", "-q", "-o", f"out{len(given)}")
        assert answer.status == 0
        said = [line for line in answer.err.splitlines() if "never arrive" not in line]
        assert said == ["warning: link.yaml and a.yaml are the same file, which counts once"]


def test_a_folder_that_cannot_be_is_wrong_input_whatever_it_is_for(rudc, tmp_path):
    (tmp_path / "file").write_text("")
    for command in (
        ("scenario", "schema", "--out", "file/schema.json"),
        ("scenario", "new", "mine", "--in", "file"),
        ("residual", "collect", "--out", "file/samples"),
        (*SWEEP[:-1], "file"),
    ):
        answer = rudc(*command)
        assert answer.status == 2
        assert "file is a file; give another folder" in answer.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_results_that_cannot_be_written_are_a_failure_of_the_work(rudc):
    answer = rudc("scenario", "schema", "--out", "/dev/full")
    assert answer.status == 1
    assert answer.err.startswith("error: cannot write /dev/full: the disk is full")


def test_output_that_cannot_be_written_is_said_without_a_traceback():
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "rudc", "scenario", "list"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert ended.returncode == 1
    assert ended.stderr.startswith("error: ")
    assert len(ended.stderr.splitlines()) == 1


@pytest.mark.parametrize("order", [("run", "random_destination"), ("scenario", "list")])
def test_where_import_stands_is_said(rudc, order):
    answer = rudc(*order, "--import", "f.py")
    assert answer.status == 2
    assert "No such option: --import; it must stand before the command: rudc --import FILE.py" in answer.err
