"""CONTRIBUTING.md's recipes, followed in a copy of the house, and all else that its table counts."""

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.caching import UserProvidedCacheLocator

from rudc.evaluation.compiled import KERNELS, compile_kernels
from rudc.kernels import _folder
from tests.additions import ADDED, END, NEW, ROOT, Change
from tests.blocks import run_apart

TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
BLOCKS = [
    Change(*found)
    for found in re.findall(
        r"^```python\n# (?P<file>\S+?),? (?P<how>\(new\)|in \w+|at its end)\n(?P<code>.*?)^```",
        TEXT,
        re.M | re.S,
    )
]
TABLE = dict(re.findall(r"^\| (.*?) \| (.*?) \|$", TEXT.split("## What it takes")[1], re.M))
"""what is added -> how many files it takes"""
RECIPES = {"an event": BLOCKS[1:2], "a metric": BLOCKS[2:3], "an action kind": BLOCKS[3:4]}
"""row of the table -> what its recipe touches"""
COMPILED = "compiled"
"""folder of the copy for its compiled kernels"""
SCENARIO = """
name: spill
description: Oil is spilt.
extends: dense_left_turn
events: [{kind: oil_spill, friction: 0.3, when: {ego_distance_to_junction: {below: 30}}}]
"""


def carry_out(path, how, code):
    if how == NEW:
        assert not path.exists()
        path.write_text(code, encoding="utf-8")
        return
    text = path.read_text(encoding="utf-8")
    if how == END:
        at, code = len(text), f"\n\n{code}"
    elif how.startswith("in "):
        at = text.index("\n)\n", re.search(rf"^{how[3:]}\b", text, re.M).start()) + 1
    else:
        at = text.index(how.removeprefix("after ")) + len(how.removeprefix("after "))
    path.write_text(text[:at] + code + text[at:], encoding="utf-8")


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """A copy, with all that the recipes add."""
    folder = tmp_path_factory.mktemp("house")
    shutil.copytree(ROOT / "rudc", folder / "rudc", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("scenarios", "sumo_networks", "results"):
        (folder / name).symlink_to(ROOT / name)
    for change in (*BLOCKS, *(change for changes in ADDED.values() for change in changes)):
        carry_out(folder / change.file, change.how, change.code)
    (folder / "spill.yaml").write_text(SCENARIO, encoding="utf-8")
    bring_compiled(folder)
    return folder


def bring_compiled(house):
    """The kernels, of which no recipe changes any: compiled code lies in a folder named by its source's."""
    compile_kernels()
    named, ours = UserProvidedCacheLocator.get_suitable_cache_subpath, Path(_folder())
    for module in ("rudc.kernels", *KERNELS):
        file = Path(*module.split(".")).with_suffix(".py")
        theirs = house / COMPILED / ours.name / named(str(house / file))
        shutil.copytree(ours / named(str(ROOT / file)), theirs, dirs_exist_ok=True)


def its(house):
    """What lets a process take the copy for RUDC."""
    return {"PYTHONPATH": str(house), "NUMBA_CACHE_DIR": str(house / COMPILED)}


def run(house, *arguments):
    env = {**os.environ, **its(house)}
    command = [sys.executable, *map(str, arguments)]
    ended = subprocess.run(command, cwd=house, capture_output=True, text=True, check=False, env=env)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_there_is_a_recipe_for_each():
    assert [change.file for change in BLOCKS] == [
        "my_agent.py", "rudc/scenario/events/oil_spill.py",
        "rudc/evaluation/columns.py", "rudc/env/action.py",
    ]  # fmt: skip


AGENT = "my_agent.py:Creep(speed=9)"
SLOW = "creep+ttcbf:correction.speed_limit=true,correction.speed_limit_most=5"


@pytest.fixture(scope="module")
def said(house):
    """What commands with all of it say, in one process."""
    agents = ("creep", SLOW, f"{SLOW},correction.solver=sparse")
    return run_apart(
        ("rudc", "scenario", "validate", "spill.yaml"),
        ("rudc", "sweep", "spill.yaml", "-a", AGENT, "-n", 2, "-w", 1, "-o", "out"),
        (
            "rudc", "sweep", "random_destination", "--set", "traffic.density=0", "-n", 1, "-w", 1,
            *(part for agent in agents for part in ("-a", agent)), "--engine", "one-by-one", "-o", "creep",
        ),
        ("rudc", "table", "out", "--metrics", "waste", "--format", "csv"),
        folder=house, **its(house),
    )  # fmt: skip


def test_agent_event_and_metric(house, said):
    with (house / "out/episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["agent"] for row in rows] == [AGENT, AGENT]
    assert all(float(row["waste"]) == max(float(row["duration_s"]) - 10.0, 0.0) for row in rows)
    assert {row["events_fired"] for row in rows} == {"1"}
    assert any("waste" in line for line in said.splitlines()[-3:]), said


def touched(changes):
    """Files, as the table says it."""
    new = {change.file for change in changes if change.how == NEW}
    entries = {change.file for change in changes} - new
    own = {1: "1", 2: "2"}.get(len(new), "")
    more = {0: "", 1: "an entry", 2: "2 entries"}[len(entries)]
    return f"{own} and {more}" if own and more else own or str(len(entries))


@pytest.mark.parametrize(("row", "changes"), [*RECIPES.items(), *ADDED.items()])
def test_the_table_says_how_many_files_were_touched(row, changes):
    assert re.split(r", or |, else ", TABLE[row])[-1 if row == "a solver" else 0] == touched(changes)


def test_all_rows_of_the_table_are_measured():
    assert TABLE.keys() - {"to add"} == {*RECIPES, *ADDED}


@pytest.mark.usefixtures("said")
def test_driver_barrier_solver_and_engine(house):
    """Driven by `creep`, whom a barrier holds to 5 m/s, by another solver, one episode after the other."""
    with (house / "creep/episodes.csv").open(newline="") as file:
        speeds = [float(row["mean_speed_mps"]) for row in csv.DictReader(file)]
    assert speeds[1] < 5.1 < speeds[0]  # it starts faster
    assert speeds[2] == pytest.approx(speeds[1], abs=1e-3)


LEARN = """
class Watcher:
    def advance(self, steps): pass
    def progress(self, row): pass
    def note(self, text): pass

if __name__ == "__main__":
    import sys
    from pathlib import Path
    import gymnasium
    import numpy as np
    import rudc
    from rudc.agents.registry import make_agent
    from rudc.env.action import read_action
    from rudc.training.config import TrainConfig
    from rudc.training.trainer import train

    small = {
        "training.steps": 25, "training.seed_steps": 25, "training.learning_starts": 16, "training.envs": 1,
        "training.round_decisions": 25, "training.evaluation_episodes": 0,
        "training.curriculum": None, "learner.batch_size": 16,
        "learner.policy.hidden": 8, "learner.critic.hidden": 8,
    }
    for name in sys.argv[1:]:
        assert train(TrainConfig.of(name, small), Path("out", name), Watcher())
        print(name, make_agent(f"out/{name}").inner.config.correction.kind)

    env = gymnasium.make(rudc.ENV_ID, action="gentle")
    _, info = env.reset(seed=0)
    env.step(np.ones(2, np.float32))
    kind, scene = read_action("gentle"), info["scene"]
    a = np.array([0.3, -0.8])
    np.testing.assert_allclose(kind.normalised(kind.physical(a, scene), scene), a, atol=1e-6)
    print(kind.kind)
"""


@pytest.fixture(scope="module")
def learnt(house):
    """What learn.py says, line by line. Workers read it, too: what needs torch stands where they do not
    import it.
    """
    (house / "learn.py").write_text(LEARN, encoding="utf-8")
    return run(house, "learn.py", "plain", "limited", "recovering").splitlines()


def test_learners(learnt):
    assert learnt[:3] == ["plain none", "limited none", "recovering hand_over"]


def test_action_kind(learnt):
    """Its inverse is one: learn.py sees to that."""
    assert learnt[3:] == ["gentle"]
