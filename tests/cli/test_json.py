"""What programs read: `--json` of the commands that answer something, and nothing else on stdout."""

import json

import pytest

from rudc.evaluation.columns import COLUMNS
from rudc.scenario import load_scenario, shipped_scenarios


def read(answer):
    assert answer.status == 0, answer.err
    return json.loads(answer.out)


def test_scenarios(rudc):
    listed = {entry["name"]: entry for entry in read(rudc("scenario", "list", "--json"))}
    assert listed.keys() == shipped_scenarios().keys()
    assert listed["perfect_storm"]["events"][-1] == load_scenario("perfect_storm").events[-1].kind
    assert listed["density_sweep"]["sweep"] == {"traffic.density": [10, 20, 30, 40, 50]}
    whole = read(rudc("scenario", "show", "perfect_storm", "--json"))
    assert whole == json.loads(json.dumps(load_scenario("perfect_storm").data()))
    (section,) = read(rudc("scenario", "keys", "hard_brake", "--json"))
    units = {key["name"]: key["unit"] for key in section["keys"]}
    assert units["deceleration"] == "m/s2"


def test_what_is_wrong_with_files_is_in_it_and_in_the_exit_status(rudc, tmp_path):
    (tmp_path / "wrong.yaml").write_text("name: wrong\ntrafic: {}\n")
    answer = rudc("scenario", "validate", "sudden_brake", "wrong.yaml", "--seeds", 1, "--json")
    assert answer.status == 2
    fine, wrong = json.loads(answer.out)
    assert (fine["scenario"], fine["problems"], fine["events"]) == ("sudden_brake", [], 1)
    (firing,) = fine["firings"]
    assert firing["episodes"] == firing["fired"] == 1
    assert list(firing["begun_s"]) == ["0"]
    assert wrong["scenario"] == "wrong.yaml"
    assert any(text.startswith("wrong.yaml:2:1: trafic") for text in wrong["problems"])
    assert rudc("scenario", "validate", "sudden_brake", "--watch", "--json").status == 2


RIDERS = """
name: riders
network: four_way
ego: {distance: 30, speed: 12}
traffic: {density: 0}
events:
  - kind: vehicle_crossing
    arm: ego_in
    at: 10
    count: 3
    speed: 5
    when: {ego_distance_to_junction: {below: 13}}
"""


def test_whom_the_ego_hit_is_in_it(rudc, tmp_path):
    (tmp_path / "riders.yaml").write_text(RIDERS)
    (found,) = read(rudc("scenario", "validate", "riders.yaml", "--seeds", 2, "--json"))
    (told,) = found["ends"]
    hit = {"hit": "bicycle", "fault": "other", "sudden": True, "event": "event 1"}
    assert told["hits"] == {str(seed): hit for seed in told["seeds"]["collision"]} != {}


def test_networks(rudc, tmp_path):
    known = {entry["name"]: entry for entry in read(rudc("network", "list", "--json"))}
    checked = read(rudc("network", "check", "roundabout", "--json", "--out", "drawn.png"))
    assert checked == known["roundabout"]
    assert (tmp_path / "drawn.png").is_file()
    assert [arm["name"] for arm in checked["arms"]] == ["east", "north", "west", "south"]
    assert {"name": "ring_south_0", "id": "ring_south_east_0"}.items() <= next(
        lane for lane in checked["lanes"] if lane["name"] == "ring_south_0"
    ).items()
    straight = [m["least_radius_m"] for m in known["four_way"]["movements"] if m["turn"] == "straight"]
    assert None in straight  # no bend at all


def test_agents(rudc):
    shown = read(rudc("agent", "show", "follower+ttcbf", "--json"))
    assert shown["settings"]["correction"]["rule"] == "ttcbf"


def test_an_episode(rudc):
    (told,) = read(rudc("run", "sudden_brake", "--seed", 1, "--json"))
    assert told["outcome"] in ("success", "frozen", "collision")
    assert told["steps"] > 10
    assert told.keys() - {"events"} <= COLUMNS.keys()
    assert told["events"][0].startswith("1 (events.0) hard_brake: ")


def test_a_sweep_as_its_table(rudc):
    order = ("random_destination", "-a", "sumo", "-n", 1, "-w", 1, "-o", "out")
    answer = rudc("sweep", *order, "--json", "--quiet")
    (line,) = read(answer)
    assert (line["agent"], line["episodes"]) == ("sumo", 1)
    assert answer.err == ""
    assert read(rudc("table", "out", "--json")) == [line]


@pytest.mark.parametrize(
    "command",
    [("agent", "list"), ("scenario", "list"), ("network", "list"), ("scenario", "keys"), ("table", "out"),
     ("network", "check", "skewed_four_way", "--lanes"), ("scenario", "validate", "fog", "--seeds", 1),
     ("study", "list")],
)  # fmt: skip
def test_tables_fit_into_a_hundred_columns(rudc, monkeypatch, command):
    if command[0] == "table":
        agents = ("-a", "follower", "-a", "gap-acceptance+ttcbf", "--set", "episode.timeout=2")
        swept = rudc("sweep", "fog", "density_sweep", *agents, "-n", 1, "-w", 1, "-o", "out")
        over_all = swept.out.partition("\n\n")[2].splitlines()
        assert [line.split()[:2] for line in over_all[-2:]] == [
            ["follower", "6"],
            ["gap-acceptance+ttcbf", "6"],
        ]
    monkeypatch.setenv("COLUMNS", "100")
    answer = rudc(*command)
    assert answer.status == 0
    assert max(map(len, answer.out.splitlines())) <= 100
    assert "\x1b" not in answer.out
    assert "…" not in answer.out  # nothing is cut off
