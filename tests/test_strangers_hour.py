"""A stranger's first hour, as README and examples/ tell it: each command must work as it stands.

In this process, which has imported what each would import anew; as they type it: README's first command, in
test_readme.py.
"""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rudc.imports import import_source
from tests.blocks import run_here

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """An empty folder with a copy of the examples."""
    folder = tmp_path_factory.mktemp("desk")
    shutil.copytree(EXAMPLES, folder / "examples")
    return folder


@pytest.fixture(scope="module")
def mine(desk):
    """Their own scenario, `mine.yaml`."""
    rudc(desk, "scenario", "new", "mine")


def rudc(desk, *arguments):
    """What a command says."""
    return run_here(["rudc", *map(str, arguments)], desk)


def run(desk, *arguments):
    command = [sys.executable, *map(str, arguments)]
    env = {**os.environ, "OMP_NUM_THREADS": "1"}
    ended = subprocess.run(command, cwd=desk, capture_output=True, text=True, check=False, env=env)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def outcomes(desk, out):
    """(agent, outcome) of a sweep's rows."""
    with (desk / out / "episodes.csv").open(newline="") as file:
        return [(row["agent"], row["outcome"]) for row in csv.DictReader(file)]


def test_first_sweep_and_its_table(desk):
    first = ("sweep", "dense_left_turn", "-a", "gap-acceptance+ttcbf", "-n", 2, "-o", "out/first")
    rudc(desk, *first)
    assert "gap-acceptance+ttcbf" in rudc(desk, "table", "out/first", "--format", "markdown")


@pytest.mark.usefixtures("mine")
def test_own_scenario(desk):
    rudc(desk, "scenario", "validate", "mine.yaml")
    rudc(desk, "scenario", "preview", "mine.yaml", "--out", "mine.png")
    assert (desk / "mine.png").stat().st_size > 10_000
    rudc(desk, "run", "mine.yaml", "--agent", "gap-acceptance", "--seed", 1)


@pytest.mark.usefixtures("mine")
def test_own_agent_beside_rudc_t(desk):
    agent = "examples/own_agent.py:Patient(gap_s=3)"
    rudc(desk, "sweep", "mine.yaml", "-a", agent, "-a", "rudc-t", "-n", 2, "-o", "out/own")
    found = outcomes(desk, "out/own")
    assert {name for name, _ in found} == {agent, "rudc-t"}
    assert all(outcome for _, outcome in found)


def test_own_network(desk):
    pytest.importorskip("sumo")
    rudc(desk, "network", "build", "examples/osm_crossing")
    rudc(desk, "scenario", "validate", "examples/osm_crossing/crossing.yaml")
    rudc(
        desk, "sweep", "examples/osm_crossing/crossing.yaml", "-a", "gap-acceptance", "-n", 2, "-o", "out/osm"
    )
    assert all(outcome for _, outcome in outcomes(desk, "out/osm"))


@pytest.mark.slow
@pytest.mark.usefixtures("mine")
def test_an_agent_trained_elsewhere(desk):
    pytest.importorskip("stable_baselines3")
    model = run(desk, "examples/sb3_agent.py", "--steps", 100, "--every", 100, "--episodes", 1).strip()
    agent = f"examples/sb3_agent.py:Sb3Agent(path={model!r})"
    rudc(desk, "sweep", "mine.yaml", "-a", agent, "-n", 1, "-w", 1, "-o", "out/sb3")
    assert all(outcome for _, outcome in outcomes(desk, "out/sb3"))
    manifest = json.loads((desk / "out/sb3/manifest.json").read_text())
    assert manifest["configuration"]["agents"][agent]["files"].keys() == {"path"}


@pytest.mark.slow
def test_a_model_that_was_never_evaluated_is_kept(tmp_path):
    pytest.importorskip("stable_baselines3")
    example = import_source(str(EXAMPLES / "sb3_agent.py"))
    assert example.train(20, tmp_path, every=1000, episodes=1).is_file()
