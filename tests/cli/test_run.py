"""One episode: what of a scenario it takes, and what it writes."""

import resource
import subprocess
import sys
from functools import partial

import pytest

from rudc.cli.run import _refuse_torn
from rudc.data import data_folder
from rudc.errors import StorageError
from rudc.world.world import World

SHORT = ("--set", "episode.timeout=0.5")
SWEPT = (
    "name: swept\nevents: [{kind: hard_brake, deceleration: {uniform: [6, 8]}}]\n"
    "sweep: {traffic.density: [5, 10], events.0.deceleration: [3, 4], ego.may_cross_centre: [true, false]}\n"
)


def test_a_sweep_in_a_file_is_said_not_to_be_driven(rudc, tmp_path):
    (tmp_path / "swept.yaml").write_text(SWEPT)
    for command in (("run", "swept.yaml", "-a", "follower", *SHORT), ("scenario", "preview", "swept.yaml")):
        answer = rudc(*command)
        assert answer.status == 0
        assert answer.err.splitlines()[0] == (
            "swept sweeps traffic.density (5, 10), events.0.deceleration (3, 4), "
            "ego.may_cross_centre (true, false); this is one episode, with traffic.density=20.0, "
            "events.0.deceleration={uniform: [6.0, 8.0]}, ego.may_cross_centre=false: "
            "`rudc sweep` drives the grid, `--set traffic.density=VALUE` chooses a value"
        )


def test_a_value_chosen_of_a_sweep_is_driven_and_the_rest_said(rudc, tmp_path):
    (tmp_path / "swept.yaml").write_text(SWEPT)
    command = ("run", "swept.yaml", "-a", "follower", *SHORT)
    chosen = [f"--set={key}" for key in ("traffic.density=5", "events.0.deceleration=3")]
    answer = rudc(*command, *chosen)
    assert answer.err.startswith("swept sweeps ego.may_cross_centre (true, false); this is one episode")
    assert rudc(*command, *chosen, "--set", "ego.may_cross_centre=true").err == ""
    assert rudc(*command, "--quiet").err == ""


RUN = ("run", "random_destination", "-a", "follower")
PREVIEW = ("scenario", "preview", "random_destination")
PLACES = [
    (*RUN, "--video", "{}.gif"),
    (*RUN, "--replay", "{}.html"),
    (*RUN, "--steps", "{}.csv"),
    (*RUN, "--fcd", "{}.xml"),
    (*PREVIEW, "--out", "{}.png"),
    (*PREVIEW, "--animate", "--out", "{}.gif"),
    ("scenario", "schema", "--out", "{}.json"),
    ("network", "check", "four_way", "--out", "{}.png"),
    ("network", "build", data_folder("sumo_networks") / "four_way", "--out", "{}.net.xml"),
    ("residual", "collect", "--out", "{}.safetensors"),
    ("replay", "nowhere", "--episode", 1, "--out", "{}.html"),
    ("report", "nowhere", "--replays", 1, "--out", "{}.html"),
]


@pytest.mark.parametrize("command", PLACES, ids=lambda command: f"{command[0]} {command[1]} {command[-2]}")
def test_a_place_that_cannot_be_written_is_wrong_input_and_nothing_is_driven(
    rudc, tmp_path, monkeypatch, command
):
    def never(*_args, **_kwargs):
        raise AssertionError("driven, though what comes of it cannot be kept")

    monkeypatch.setattr(World, "reset", never)
    (tmp_path / "file").write_text("")
    ending = command[-1].removeprefix("{}")
    (tmp_path / f"folder{ending}").mkdir()
    before = sorted(tmp_path.iterdir())
    for place, reason in (
        ("folder", f"error: cannot write folder{ending}: it is a folder; name a file"),
        ("file/in", "error: file is a file; give another folder"),
        ("new/" + "x" * 250, "File name too long; name another file"),
        ("/proc/in", "error: cannot write /proc/in"),
    ):
        answer = rudc(*command[:-1], command[-1].format(place))
        assert answer.status == 2, (place, answer.err)
        assert reason in answer.err
        assert answer.out == ""
        assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("command", "wrong", "said"),
    [
        ((*RUN, "--steps"), "s.xls", "a table of decisions is a .csv file, not 's.xls'"),
        (
            (*RUN, "--fcd"),
            "f.json",
            "SUMO's floating car data is a .xml, .xml.gz, .csv or .parquet file, not 'f.json'",
        ),
        (("scenario", "schema", "--out"), "s.yaml", "a JSON Schema is a .json file, not 's.yaml'"),
        (
            ("network", "build", data_folder("sumo_networks") / "four_way", "--out"),
            "n.xml",
            "a network is a .net.xml file, not 'n.xml'",
        ),
        (("residual", "collect", "--out"), "d.npz", "a set of samples is a .safetensors file, not 'd.npz'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_ending_that_promises_what_is_not_written_is_refused(rudc, tmp_path, command, wrong, said):
    answer = rudc(*command, wrong)
    assert answer.status == 2
    assert answer.err == f"error: {said}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("first", "second", "both"),
    [
        (("--steps", "s.csv"), ("--fcd", "in/../s.csv"), "--steps and --fcd"),
        (("--steps", "one"), ("--fcd", "one"), "--steps and --fcd"),
    ],
)
def test_one_file_for_two_outputs_is_refused(rudc, tmp_path, first, second, both):
    answer = rudc(*RUN, *SHORT, *first, *second)
    assert answer.status == 2
    assert answer.err == f"error: {both} both name {second[1]}: give each a file of its own\n"
    assert list(tmp_path.iterdir()) == []


def test_a_path_that_sumo_takes_for_a_port_is_refused(rudc, tmp_path):
    answer = rudc(*RUN, *SHORT, "--fcd", "14:37/f.xml")
    assert answer.status == 2
    assert answer.err == (
        f"error: --fcd: SUMO cannot write to {tmp_path}/14:37/f.xml, which has a colon in it; "
        "name another place\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_name_without_an_ending_promises_nothing(rudc, tmp_path):
    assert rudc(*RUN, *SHORT, "--steps", "steps", "--fcd", "/dev/null").status == 0
    assert rudc(*RUN, *SHORT, "--steps", "/dev/null", "--fcd", "/dev/null").status == 0
    assert (tmp_path / "steps").is_file()


@pytest.mark.parametrize(
    ("ending", "begins"),
    [("xml", b"<?xml"), ("xml.gz", b"\x1f\x8b"), ("csv", b"timestep"), ("parquet", b"PAR1")],
)
def test_sumo_writes_the_kinds_that_are_allowed(rudc, tmp_path, ending, begins):
    assert rudc(*RUN, *SHORT, "--fcd", f"fcd.{ending}").status == 0
    assert (tmp_path / f"fcd.{ending}").read_bytes().startswith(begins)


def test_a_disk_that_is_full_while_sumo_writes_is_a_failure_of_the_work(tmp_path):
    limited = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (8_000, 8_000))
    answer = subprocess.run(
        [sys.executable, "-m", "rudc", *RUN, "--set", "episode.timeout=1", "--fcd", tmp_path / "fcd.xml"],
        capture_output=True, text=True, check=False, preexec_fn=limited,
    )  # fmt: skip
    assert answer.returncode == 1
    assert answer.stderr.endswith("fcd.xml: it stops in the middle; is the disk full?\n")


@pytest.mark.parametrize(
    ("ending", "whole", "torn"),
    [
        ("xml", b"<a/>\n</fcd-export>\n", b"<a/>\n</fcd-ex"),
        ("csv", b"1.65;sv5\n", b"1.65;sv5\n1.65;s"),
        ("parquet", b"PAR1xyPAR1", b"PAR1xy"),
    ],
)
def test_a_torn_file_of_sumos_is_told_from_a_whole_one(tmp_path, ending, whole, torn):
    path = tmp_path / f"fcd.{ending}"
    path.write_bytes(whole)
    _refuse_torn(path)
    path.write_bytes(torn)
    with pytest.raises(StorageError, match="it stops in the middle"):
        _refuse_torn(path)


def test_steps_make_their_folder(rudc, tmp_path):
    assert rudc(*RUN, *SHORT, "--steps", "new/steps.csv").status == 0
    assert (tmp_path / "new" / "steps.csv").read_text().startswith("time_s,")
