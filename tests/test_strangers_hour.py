"""A stranger's first hour, as README and examples/ tell it: each command must work as it stands.

In this process, which has imported what each would import anew. README's own commands, the first as they type
it: test_readme.py.
"""

import csv
import json
import shutil
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


@pytest.mark.usefixtures("mine")
def test_own_scenario(desk):
    rudc(desk, "scenario", "validate", "mine.yaml")
    rudc(desk, "scenario", "preview", "mine.yaml", "--out", "mine.png")
    assert (desk / "mine.png").stat().st_size > 10_000
    rudc(desk, "run", "mine.yaml", "--agent", "gap-acceptance", "--seed", 1)


@pytest.mark.slow
@pytest.mark.usefixtures("mine")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_an_agent_trained_elsewhere(desk):
    pytest.importorskip("stable_baselines3")
    few = ["--steps", "100", "--every", "100", "--episodes", "1"]
    model = run_here(["python", "examples/sb3_agent.py", *few], desk).strip()
    agent = f"examples/sb3_agent.py:Sb3Agent(path={model!r})"
    rudc(desk, "sweep", "mine.yaml", "-a", agent, "-n", 1, "-w", 1, "-o", "out/sb3")
    with (desk / "out/sb3/episodes.csv").open(newline="") as file:
        assert [bool(row["outcome"]) for row in csv.DictReader(file)] == [True]
    manifest = json.loads((desk / "out/sb3/manifest.json").read_text())
    assert manifest["configuration"]["agents"][agent]["files"].keys() == {"path"}


@pytest.mark.slow
def test_a_model_that_was_never_evaluated_is_kept(tmp_path):
    pytest.importorskip("stable_baselines3")
    example = import_source(str(EXAMPLES / "sb3_agent.py"))
    assert example.train(20, tmp_path, every=1000, episodes=1).is_file()
