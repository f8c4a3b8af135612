"""What helps while a scenario is written: validated as it changes, and shown moving."""

import json
import re

import pytest
from PIL import Image

from rudc.cli import validate as commands
from rudc.data import data_folder
from rudc.scenario import load_scenario, shipped_scenarios


def test_a_preview_moves(rudc, tmp_path):
    answer = rudc("scenario", "preview", "random_destination", "--animate", "--set", "episode.timeout=3")
    assert answer.status == 0, answer.err
    assert answer.out == "random_destination.gif\n"
    with Image.open(tmp_path / "random_destination.gif") as film:
        assert getattr(film, "n_frames", 1) > 10
    assert rudc("scenario", "preview", "random_destination", "--animate", "-o", "x.png").status == 2


def test_a_preview_shows_a_later_scene(rudc, tmp_path):
    scenes = {}
    for at in (0, 4):
        answer = rudc("scenario", "preview", "sudden_brake", "--seed", 3, "--at", at, "-o", f"{at}.png")
        assert answer.status == 0, answer.err
        scenes[at] = (tmp_path / f"{at}.png").read_bytes()
    first = rudc("scenario", "preview", "sudden_brake", "--seed", 3)
    assert (tmp_path / first.out.strip()).read_bytes() == scenes[0] != scenes[4]
    late = rudc("scenario", "preview", "sudden_brake", "--seed", 3, "--at", 99)
    assert late.status == 2
    assert re.fullmatch(r"error: --at 99: with seed 3 the episode ends at [\d.]+ s \(\w+\)\n", late.err), (
        late.err
    )
    assert rudc("scenario", "preview", "sudden_brake", "--at", 1, "--animate").status == 2


def test_a_file_is_validated_whenever_it_or_its_neighbour_changes(rudc, tmp_path, monkeypatch):
    mine, base = tmp_path / "mine.yaml", tmp_path / "base.yaml"
    base.write_text("name: base\nnetwork: four_way\n")
    mine.write_text("name: mine\nextends: base.yaml\n")
    changes = iter([
        lambda: mine.write_text("name: mine\nextends: base.yaml\ntrafic: {density: 20}\n"),
        lambda: None,
        lambda: mine.write_text("name: mine\nextends: base.yaml\ntraffic: {density: 20}\n"),
        lambda: base.write_text("name: base\nnetwork: four_wya\n"),
    ])  # fmt: skip

    def meanwhile(_seconds):
        change = next(changes, None)
        if change is None:
            raise KeyboardInterrupt
        change()

    monkeypatch.setattr(commands.time, "sleep", meanwhile)
    answer = rudc("scenario", "validate", "mine.yaml", "--watch")
    assert answer.status == 130
    lines = [line for line in answer.out.splitlines() if line.startswith("mine.yaml:")]
    assert lines[0] == "mine.yaml: ok (0 events)"
    assert lines[1] == "mine.yaml: 1 problem"
    assert lines[2].startswith("mine.yaml:3:1: trafic: unknown key (did you mean 'traffic'?)")
    assert lines[3] == "mine.yaml: ok (0 events)"
    assert "four_wya" in answer.out
    assert answer.err.count("watching") == 4


def test_it_is_said_how_many_points_of_a_large_sweep_were_set_up(rudc, tmp_path):
    (tmp_path / "large.yaml").write_text(
        "name: large\nsweep: {ego.speed: [5, 6, 7, 8, 9, 10], traffic.density: [5, 6, 7, 8, 9, 10]}\n"
    )
    answer = rudc("scenario", "validate", "large.yaml")
    assert answer.status == 0, answer.err
    line = re.fullmatch(
        r"large\.yaml: ok \(0 events, 36 swept points, of which (\d+) were set up\)\n", answer.out
    )
    assert line, answer.out
    assert 6 <= int(line[1]) <= 16


def test_an_event_that_comes_too_late_is_a_warning_and_no_problem(rudc, tmp_path):
    (tmp_path / "late.yaml").write_text(
        "name: late\nevents: [{kind: low_friction, friction: 0.5, when: {simulation_time: {above: 100}}}]\n"
    )
    answer = rudc("scenario", "validate", "late.yaml")
    assert answer.status == 0, answer.err
    first, second = answer.out.splitlines()
    assert first == "late.yaml: ok (1 event)"
    assert second.startswith("  warning: event 1 (events.0) low_friction can never happen")
    (told,) = json.loads(rudc("scenario", "validate", "late.yaml", "--json").out)
    assert (told["problems"], told["warnings"]) == ([], [second.removeprefix("  warning: ")])


def test_a_new_file_with_a_shipped_name_is_named_by_its_file(rudc, tmp_path):
    answer = rudc("scenario", "new", "sudden_brake", "--in", "mine", "--quiet")
    assert answer.status == 0
    assert answer.err == (
        "warning: `sudden_brake` alone is the shipped scenario; this one is named by its file, "
        "mine/sudden_brake.yaml\n"
    )
    assert load_scenario("sudden_brake").path == shipped_scenarios()["sudden_brake"]
    assert load_scenario("mine/sudden_brake.yaml").path == tmp_path / "mine" / "sudden_brake.yaml"
    assert rudc("scenario", "new", "mine", "--quiet").err == ""


@pytest.mark.parametrize(
    ("given", "name"), [("mine", "mine.yaml"), ("mine.yaml", "mine.yaml"), ("my.own.yml", "my.own.yml")]
)
def test_a_new_file_tells_editors_its_schema(rudc, tmp_path, given, name):
    assert rudc("scenario", "new", given).status == 0
    first, second, *_ = (tmp_path / name).read_text().splitlines()
    assert second == f"name: {name.rpartition('.')[0]}"
    assert first.startswith("# yaml-language-server: $schema=")
    assert (tmp_path / first.partition("=")[2]).is_file()


def test_arms_of_equal_right_are_called_so(rudc):
    told = rudc("network", "check", "four_way_equal").out
    assert told.count("equal") >= 4
    assert "minor" not in told
    assert "major" in rudc("network", "check", "four_way").out


def test_an_arm_that_nobody_comes_in_by_has_no_priority(rudc):
    crossing = data_folder("results") / "held-out-11" / "one_way_grid" / "one_way_grid.net.xml"
    table = rudc("network", "check", str(crossing)).out.split("\n\n")[1].splitlines()
    priorities = {line.split()[0]: line.split()[-1] for line in table[1:] if "warning" not in line}
    assert priorities == {"north": "-", "west": "-", "south": "major", "east": "minor"}


def test_a_misspelt_network_file_is_told_of_its_neighbour(rudc, tmp_path):
    (tmp_path / "mine.net.xml").write_text("<net/>")
    (tmp_path / "s.yaml").write_text("name: s\nnetwork: mien.net.xml\n")
    answer = rudc("scenario", "validate", "s.yaml")
    assert answer.status == 2
    assert "mien.net.xml (did you mean 'mine.net.xml'?)" in answer.err
