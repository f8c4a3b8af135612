"""The commands doing what they are for."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image

from rudc.agents.checkpoint import load_learnt, shipped_checkpoints
from rudc.data import data_folder
from rudc.errors import AgentError, StorageError
from rudc.evaluation.store import read_table
from rudc.learning.algorithms import ALGORITHMS
from rudc.scenario import EVENT_KINDS, load_scenario, shipped_scenarios
from rudc.training.calibration import Calibration, Limits
from rudc.training.folder import held

PYTHON = [sys.executable, "-m", "rudc"]


def test_help_needs_nothing_heavy():
    """But gymnasium, where `import rudc` registers the environment, and the numpy that it brings (0.1 s)."""
    code = (
        "import sys; sys.argv = ['rudc', '--help']\n"
        "from rudc.cli.main import main\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'scipy', 'pandas', 'matplotlib', 'torch', 'libsumo', 'pydantic', 'yaml'}\n"
        "heavy &= set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    for command in ("sweep", "run", "scenario", "network", "agent", "table"):
        assert command in result.stdout


def test_version(rudc):
    import rudc as package

    assert rudc("--version") == (0, f"{package.__version__}\n", "")


def test_from_a_new_scenario_to_a_picture_and_a_run(rudc, tmp_path):
    assert rudc("scenario", "new", "mine").status == 0
    assert json.loads((tmp_path / "rudc-scenario.schema.json").read_text())["title"]
    assert rudc("scenario", "new", "mine").status == 2
    answer = rudc("scenario", "validate", "mine.yaml")
    assert answer == (0, "mine.yaml: ok (1 event)\n", "")
    answer = rudc("scenario", "preview", "mine.yaml", "--seed", 2, "--out", "pictures/mine.png")
    assert answer.status == 0, answer.err
    with Image.open(tmp_path / "pictures" / "mine.png") as picture:
        assert min(picture.size) > 500
        assert len(picture.getcolors(1 << 24) or []) > 20
    answer = rudc(
        "run", "mine.yaml", "--agent", "gap-acceptance+ttcbf", "--seed", 1,
        "--set", "traffic.density=12", "--set", "episode.timeout=6",
        "--steps", "steps.csv", "--video", "film.gif", "--fcd", "fcd.xml",
    )  # fmt: skip
    assert answer.status == 0, answer.err
    shown = dict(line.split(maxsplit=1) for line in answer.out.splitlines())
    assert shown["scenario"] == "mine"
    assert shown["agent"] == "gap-acceptance+ttcbf"
    assert 9.0 < float(shown["density"]) < 15.0
    assert len(read_table(tmp_path / "steps.csv")) == int(shown["steps"])
    assert (tmp_path / "film.gif").stat().st_size > 10_000
    assert "<timestep" in (tmp_path / "fcd.xml").read_text()


@pytest.mark.parametrize(
    "name", ["perfect_storm", "jaywalkers", "road_works", "wrong_way_driver", "stalled_truck"]
)
def test_events_can_be_drawn_wherever_they_say_they_are(rudc, name):
    assert rudc("scenario", "preview", name, "--out", "picture.png").status == 0


def test_scenarios_are_listed_with_why_they_are_out_of_distribution(rudc):
    answer = rudc("scenario", "list")
    assert answer.status == 0
    assert "dense_left_turn" in answer.out
    assert answer.out.count("OOD:") >= 10
    assert "sweep of traffic.density: 10, 20, 30, 40, 50" in answer.out
    assert rudc("scenario", "list", "*left*").out.count("\n") < answer.out.count("\n")


def test_the_schema_is_json(rudc, tmp_path):
    text = rudc("scenario", "schema").out
    assert "properties" in json.loads(text)
    assert rudc("scenario", "schema", "--out", "a/b.json").status == 0
    assert (tmp_path / "a" / "b.json").read_text() == text


def test_a_scenario_is_shown_as_it_is_and_as_what_it_comes_to(rudc, tmp_path):
    answer = rudc("scenario", "show", "perfect_storm")
    assert answer == (0, shipped_scenarios()["perfect_storm"].read_text(), "")
    whole = rudc("scenario", "show", "perfect_storm", "--resolved").out
    (tmp_path / "whole.yaml").write_text(whole)
    assert "extends" not in whole
    assert "warm_up: 5.0" in whole
    assert load_scenario(tmp_path / "whole.yaml").digest == load_scenario("perfect_storm").digest
    assert "did you mean 'fog'" in rudc("scenario", "show", "fogg").err


def test_network_check_lists_the_names_of_lanes(rudc):
    lines = [line.split() for line in rudc("network", "check", "roundabout", "--lanes").out.splitlines()]
    assert ["south_in_0", "south_in_0", "120", "the", "stop", "line,", "outwards"] in lines
    assert ["south_to_east_0", ":ring_south_0_0", "24", "its", "beginning"] in lines
    assert ["ring_south_0", "ring_south_east_0", "25", "its", "beginning"] in lines


def test_keys_are_listed_with_units(rudc):
    said = rudc("scenario", "keys", "vehicle_crossing").out
    assert said.startswith("vehicle_crossing: Cyclists")
    assert [line.split()[0] for line in said.splitlines()[1:]] == [
        "key", "name", "when", "arm", "type", "size", "at", "speed", "count", "gap",
        "from_side", "pause", "pause.after", "pause.duration",
    ]  # fmt: skip
    assert "[number, number]" in rudc("scenario", "keys", "occlusion").out
    assert rudc("scenario", "keys", "hard_brak").status == 2
    assert "uniform" in rudc("scenario", "keys", "choice").out
    every = rudc("scenario", "keys", "events").out
    assert all(f"{kind}: " in every for kind in EVENT_KINDS)


def test_the_first_line_of_a_new_scenario_names_its_schema_for_editors(rudc, tmp_path):
    assert rudc("scenario", "new", "mine").status == 0
    first = (tmp_path / "mine.yaml").read_text().splitlines()[0]
    assert first == "# yaml-language-server: $schema=rudc-scenario.schema.json"
    assert (tmp_path / "rudc-scenario.schema.json").is_file()


def test_every_shipped_scenario_is_valid(rudc, monkeypatch):
    monkeypatch.setattr("rudc.evaluation.preflight.TRIED", 2)  # episodes set up of each; others drive them
    answer = rudc("scenario", "validate", "*")
    assert answer.status == 0, answer.err
    assert [line.split(":")[0] for line in answer.out.splitlines()] == list(shipped_scenarios())


def test_networks_are_listed_checked_and_built(rudc, tmp_path):
    listed = rudc("network", "list")
    assert listed.status == 0
    assert "roundabout" in listed.out
    answer = rudc("network", "check", "t_junction", "--out", "t.png")
    assert answer.status == 0
    assert "straight" in answer.out
    assert (tmp_path / "t.png").stat().st_size > 10_000
    source = Path(__file__).parents[2] / "sumo_networks" / "four_way"
    answer = rudc("network", "build", source, "--out", tmp_path / "built.net.xml")
    assert answer.status == 0, answer.err
    assert (tmp_path / "built.net.xml").read_bytes() == (source / "four_way.net.xml").read_bytes()


def test_agents_are_listed_and_shown(rudc, monkeypatch):
    monkeypatch.setitem(ALGORITHMS, "mine", ALGORITHMS["qpsl"])
    listed = rudc("agent", "list")
    assert max(map(len, listed.out.splitlines())) <= 100
    assert "NAME+ecbf" in listed.err
    assert f"rudc train NAME --out DIR trains {', '.join(ALGORITHMS)}; then --agent DIR" in listed.err
    described = {entry["name"]: entry for entry in json.loads(rudc("agent", "list", "--json").out)}
    assert {"planner", "rudc-t", "rudc-t-seed1", *ALGORITHMS} <= described.keys()
    assert all(name in listed.out for name in described)
    assert (described["qpsl"]["paper"], described["qpsl"]["status"]) == ("QPSL", "shipped")
    assert (described["mine"]["paper"], described["mine"]["status"]) == ("QPSL", "trainable")
    assert Path(described["rudc-e"]["checkpoint"]).name == "rudc-e"
    head, _, settings = rudc("agent", "show", "follower+ttcbf").out.partition("\n")
    assert head.startswith("follower+ttcbf: ")
    assert json.loads(settings)["correction"]["rule"] == "ttcbf"


@pytest.mark.slow
def test_an_agents_sigma_is_measured_and_stored_only_when_asked(rudc, tmp_path):
    folder = tmp_path / "mine"
    shutil.copytree(data_folder("results/checkpoints") / "rudc-wo-cbf", folder)
    before = (folder / "agent.json").read_text()
    order = ("agent", "calibrate", folder, "-n", 1, "--scenario", "random_destination")
    answer = rudc(*order)
    assert "decisions above those" in answer.out
    assert "not stored" in answer.err
    assert (folder / "agent.json").read_text() == before
    rudc(*order, "--write")
    again = [line for line in rudc(*order).out.splitlines() if "above" in line]
    shares = [float(line.split()[-2].removesuffix("%")) for line in again]
    assert shares == pytest.approx([5.0, 5.0], abs=0.6)  # of the same 100 decisions or so again
    assert rudc("agent", "calibrate", tmp_path / "nobody").status == 2


def test_a_shipped_agent_is_not_written_to_and_a_folder_of_its_name_is(rudc, tmp_path, monkeypatch):
    shipped = data_folder("results/checkpoints") / "rudc-wo-cbf"
    seen = []

    def calibrate(folder, *_args, **_options):
        seen.append(folder)
        raise AgentError("enough")

    monkeypatch.setattr("rudc.training.calibration.calibrate", calibrate)
    (tmp_path / "linked").symlink_to(shipped)
    for place in ("rudc-wo-cbf", shipped, "linked"):
        answer = rudc("agent", "calibrate", place, "--write")
        assert answer.status == 2
        assert f"{place} is a shipped agent, which --write leaves as it is" in answer.err
    assert not seen
    rudc("agent", "calibrate", "rudc-wo-cbf")
    shutil.copytree(shipped, tmp_path / "rudc-wo-cbf" / "checkpoint")
    rudc("agent", "calibrate", "rudc-wo-cbf", "--write")
    assert seen == [shipped, Path("rudc-wo-cbf/checkpoint")]


def calibrated() -> Calibration:
    limits, learnt = (
        {"paper": Limits((1.0, 2.0), None, None)},
        load_learnt(shipped_checkpoints()["rudc-wo-cbf"]),
    )
    return Calibration(limits, 240, 4, succeeded=False, explained=0.5, learnt=learnt)


def test_what_was_measured_is_not_lost_where_it_cannot_be_stored(rudc, tmp_path, monkeypatch):
    """Found out before anything is driven; if only later, what was found is told."""
    driven = []

    def calibrate(*_args, **_options):
        driven.append(1)
        return calibrated()

    def fail(*_):
        raise StorageError("nothing is written here")

    monkeypatch.setattr("rudc.training.calibration.calibrate", calibrate)
    shutil.copytree(shipped_checkpoints()["rudc-wo-cbf"], tmp_path / "mine")
    order = ("agent", "calibrate", tmp_path / "mine")
    with monkeypatch.context() as patch:
        patch.setattr("rudc.files.try_place", fail)
        assert rudc(*order).status == 0
        answer = rudc(*order, "--write")
    assert "nothing is written here" in answer.err
    assert len(driven) == 1
    monkeypatch.setattr("rudc.agents.checkpoint.save_learnt", fail)
    answer = rudc(*order, "--write")
    assert answer.status != 0
    assert "paper  measured" in answer.out
    assert "of 240 decisions" in answer.err


def test_a_checkpoint_is_not_calibrated_anew_while_its_training_goes_on(rudc, tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.training.calibration.calibrate", lambda *_args, **_options: calibrated())
    shutil.copytree(data_folder("results/checkpoints") / "rudc-wo-cbf", tmp_path / "mine" / "checkpoint")
    (tmp_path / "mine" / "config.json").write_text("{}")
    order = ("agent", "calibrate", tmp_path / "mine")
    with held(tmp_path / "mine", print):
        told = rudc(*order).err
        assert "of 240 decisions in all 4 episodes" in told
        assert rudc(*order, "--quiet").err == told[: told.index("of 240")]
        assert "warning: none of the episodes succeeded: sigma_l and" in told
        assert "another rudc is writing to" in rudc(*order, "--write").err
    assert rudc(*order, "--write").status == 0


@pytest.fixture(scope="module")
def swept(tmp_path_factory, rudc_once):
    """The folder of a small real sweep, and what the command printed."""
    out = tmp_path_factory.mktemp("swept") / "with spaces"
    agents = ("-a", "sumo", "-a", "follower")
    answer = rudc_once("sweep", "dense_left_turn", *agents, "-n", 3, "-w", 2, "-o", out)
    assert answer.status == 0, answer.err
    return out, answer


def test_a_sweep_prints_its_table_and_says_where_it_is(swept):
    out, answer = swept
    assert "SR (%)" in answer.out
    assert "min-DTC (m)" in answer.out
    assert answer.out.count("[") == 6
    assert "6/6 episodes" in answer.err
    assert str(out) in answer.err
    assert sorted(path.name for path in out.iterdir()) == [
        "episodes.csv", "manifest.json", "metrics.csv",
    ]  # fmt: skip


def test_table_reads_what_a_sweep_left(swept, rudc):
    out, _ = swept
    assert rudc("table", out, "--format", "csv").out.splitlines()[1].startswith("dense_left_turn,sumo,3,0,")
    assert "| dense_left_turn" in rudc("table", out, "-f", "markdown", "--against", "paper").out
    assert "\\toprule" in rudc("table", out, "-f", "latex").out
    assert rudc("table", out, "--against", "paper").err == ""
    by_priority = rudc("table", out, "--by", "agent,priority").out
    assert "major" in by_priority or "minor" in by_priority
    assert rudc("table", out, "--by", "agent, priority,agent").out == by_priority
    assert rudc("table", out, "--by", "agnt").status == 2
    assert "follower" in rudc("table", out).out


def test_a_sweep_of_none_of_the_papers_tasks_is_said_to_be_so(swept, rudc, tmp_path):
    out, _ = swept
    rows = (out / "episodes.csv").read_text().replace("dense_left_turn", "fog")
    (tmp_path / "fog").mkdir()
    (tmp_path / "fog" / "episodes.csv").write_text(rows)
    for style in ((), ("--format", "csv"), ("--json",)):
        answer = rudc("table", "fog", *style, "--against", "ablation")
        assert answer.status == 0
        assert answer.out == rudc("table", "fog", *style).out
        assert answer.err == (
            "nothing to put beside: the paper's tasks are random_destination and dense_left_turn, and none "
            "of them was driven\n"
        )


def test_a_reader_who_has_had_enough_is_no_error():
    reader = subprocess.Popen(
        [*PYTHON, "scenario", "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert reader.stdout is not None
    assert reader.stderr is not None
    reader.stdout.readline()
    reader.stdout.close()
    said = reader.stderr.read()
    reader.stderr.close()
    reader.wait(timeout=60)
    assert "Traceback" not in said


def test_ctrl_c_keeps_what_is_finished_ends_the_workers_and_leaves_with_130(tmp_path):
    out = tmp_path / "out"
    command = [
        *PYTHON,
        "sweep",
        "random_destination",
        "-a",
        "follower",
        "-n",
        "500",
        "-w",
        "2",
        "-o",
        str(out),
    ]
    process = subprocess.Popen(
        command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    rows = out / "episodes.csv"
    deadline = time.monotonic() + 60.0
    while not rows.exists() or rows.read_bytes().count(b"\n") < 3:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"interrupted; what is finished is kept in {out}: add --resume to go on" in said
    assert "Traceback" not in said
    assert 2 <= len(read_table(rows)) < 500
    assert _gone(process.pid)


def _gone(group: int) -> bool:
    """Whether no process of a group is left, or will be in a moment."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_failed_episodes_are_named_and_end_with_1(rudc, tmp_path):
    (tmp_path / "crowded.yaml").write_text(
        "name: crowded\nego: {route: {from: south, turn: straight}, distance: {uniform: [39, 41]}}\n"
        "events: [{kind: accident, vehicles: [{lane: south_in_0, at: 42}]}]\n"
    )
    answer = rudc("sweep", "crowded.yaml", "-a", "follower", "-n", 1, "-w", 1, "-o", "out")
    assert answer.status == 1
    assert "failed: crowded, follower, seed 0" in answer.err
    assert "1 of 1 episodes failed" in answer.err
    assert "tries them again; where you change code of your own to mend them, give a new --out" in answer.err
    (row,) = read_table(tmp_path / "out" / "episodes.csv")
    assert "no safe start" in row["error"]


def test_a_list_makes_a_grid_of_a_sweep(rudc, tmp_path):
    answer = rudc(
        "sweep", "random_destination", "-a", "sumo", "-n", 1, "-w", 1, "-o", "out",
        "--set", "traffic.density=[10, 20]", "--set", "episode.timeout=5",
    )  # fmt: skip
    assert answer.status == 0, answer.err
    rows = read_table(tmp_path / "out" / "episodes.csv")
    assert [(row["traffic.density"], row["outcome"]) for row in rows] == [("10", "frozen"), ("20", "frozen")]
    assert "traffic.density" in answer.out.splitlines()[0]
    table = rudc("table", "out", "--by", "traffic.density", "--metrics", "SR,duration_s")
    assert table.out.splitlines()[0].split() == ["traffic.density", "n", "SR", "(%)", "duration_s", "(s)"]
    other = rudc("sweep", "random_destination", "-a", "sumo", "-n", 1, "-o", "out", "--resume")
    assert other.status == 2
    assert "differs" in other.err
    run = rudc("run", "random_destination", "-a", "sumo", "--set", "episode.timeout=1e0")
    assert dict(line.split(maxsplit=1) for line in run.out.splitlines())["duration_s"] == "1.0"
