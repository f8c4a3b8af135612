"""The examples run, as their heads say: here, and in tests/test_strangers_hour.py (`sb3_agent.py`).

`omnisafe_env.py` alone is run by hand.
"""

import csv
import json
import runpy
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from rudc.scenario.events import EVENT_KINDS, registry
from rudc.world.ego import DRY
from tests.blocks import run_apart
from tests.cli.conftest import rudc

__all__ = ["rudc"]  # the fixture that runs a command in an empty folder

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_own_agent_beside_ours(rudc):
    agent = f"{EXAMPLES}/own_agent.py:Patient(gap_s=3)"
    answer = rudc(
        "sweep", "dense_left_turn", "-a", agent, "-a", f"{agent}+ttcbf", "-a", "rudc-t", "-n", 2, "-o", "out"
    )
    assert answer.status == 0, answer.err
    settings = json.loads(Path("out/manifest.json").read_text())["configuration"]["agents"]
    assert settings[agent]["source"]
    assert list(settings) == [agent, f"{agent}+ttcbf", "rudc-t"]
    assert all(row["outcome"] for row in rows("out"))


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A folder with sweeps that an event and a barrier of ours are in."""
    folder, scenario = tmp_path_factory.mktemp("driven"), EXAMPLES / "gusts.yaml"
    event, barrier = (("rudc", "--import", EXAMPLES / f"own_{kind}.py") for kind in ("event", "barrier"))
    quick = ("-n", 1, "-w", 1)
    limit = "follower+ttcbf:correction.speed_limit=true,correction.speed_limit_most=5"
    free = ("random_destination", "--set", "traffic.density=0", "-a", "follower+ttcbf", "-a", limit)
    run_apart(
        (*event, "scenario", "validate", scenario),
        (*event, "scenario", "preview", scenario),
        (*event, "sweep", scenario, "-a", "follower", *quick, "-o", "gusts"),
        (*barrier, "sweep", *free, *quick, "-o", "limits"),
        folder=folder,
    )
    return folder


def rows(out):
    """Of a sweep."""
    with (Path(out) / "episodes.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_own_event(driven):
    assert [row["error"] for row in rows(driven / "gusts")] == [""]


def test_own_event_ends(monkeypatch):
    assert EVENT_KINDS, "found once a process: before their table is copied"
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))
    own = runpy.run_path(str(EXAMPLES / "own_event.py"))
    told = []
    stage = SimpleNamespace(time_s=0.0, set_friction=told.append)
    gust = own["GustEffect"](own["Gust"](kind="gust", friction=0.3, duration=2), "gust0")
    assert gust.begin(stage)
    over = []
    for stage.time_s in (1.9, 2.0):
        over.append(gust.is_over(stage))
    gust.end(stage)
    assert (over, told) == ([False, True], [0.3, DRY])


def test_own_barrier(driven):
    fast, slow = (float(row["mean_speed_mps"]) for row in rows(driven / "limits"))
    assert slow == pytest.approx(5.0, abs=0.15)  # it starts faster, and then holds 4.9
    assert fast > 6.0


def test_a_map_of_openstreetmap(rudc, tmp_path):
    pytest.importorskip("sumo")
    folder = tmp_path / "osm"
    shutil.copytree(EXAMPLES / "osm_crossing", folder)
    assert rudc("network", "build", folder).status == 0
    checked = rudc("network", "check", folder / "crossing.net.xml")
    assert checked.status == 0
    assert all(limit in checked.out for limit in (" 13.9 ", " 8.3 ", " 5.6 "))
    assert "warning" not in checked.err
    assert rudc("scenario", "validate", folder / "crossing.yaml").status == 0
    answer = rudc("sweep", folder / "crossing.yaml", "-a", "gap-acceptance", "-n", 2, "-o", "out")
    assert answer.status == 0, answer.err
    assert all(row["outcome"] for row in rows("out"))
