"""CONTRIBUTING.md's recipes, followed in a copy of the house."""

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(
    r"^```python\n# (?P<file>\S+?),? (?P<how>\(new\)|in \w+|at its end)\n(?P<code>.*?)^```",
    (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
    re.M | re.S,
)
SCENARIO = """
name: spill
description: Oil is spilt.
extends: dense_left_turn
events: [{kind: oil_spill, friction: 0.3, when: {ego_distance_to_junction: {below: 30}}}]
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """A copy, with all that the recipes add."""
    folder = tmp_path_factory.mktemp("house")
    shutil.copytree(ROOT / "rudc", folder / "rudc", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("scenarios", "sumo_networks", "results"):
        (folder / name).symlink_to(ROOT / name)
    for file, how, code in BLOCKS:
        path = folder / file
        if how == "(new)":
            assert not path.exists()
            path.write_text(code, encoding="utf-8")
        elif how == "at its end":
            path.write_text(f"{path.read_text(encoding='utf-8')}\n\n{code}", encoding="utf-8")
        else:
            table = how.removeprefix("in ")
            text = path.read_text(encoding="utf-8")
            end = text.index("\n)\n", re.search(rf"^{table}\b", text, re.M).start()) + 1
            path.write_text(text[:end] + code + text[end:], encoding="utf-8")
    (folder / "spill.yaml").write_text(SCENARIO, encoding="utf-8")
    return folder


def run(house, *arguments):
    env = {**os.environ, "PYTHONPATH": str(house)}
    command = [sys.executable, *map(str, arguments)]
    ended = subprocess.run(command, cwd=house, capture_output=True, text=True, check=False, env=env)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_there_is_a_recipe_for_each():
    assert [file for file, *_ in BLOCKS] == [
        "my_agent.py", "rudc/scenario/events/oil_spill.py",
        "rudc/evaluation/columns.py", "rudc/env/action.py",
    ]  # fmt: skip


def test_agent_event_and_metric(house):
    run(house, "-m", "rudc", "scenario", "validate", "spill.yaml")
    agent = "my_agent.py:Creep(speed=9)"
    run(house, "-m", "rudc", "sweep", "spill.yaml", "-a", agent, "-n", 2, "-w", 1, "-o", "out")
    with (house / "out/episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["agent"] for row in rows] == [agent, agent]
    assert all(float(row["waste"]) == max(float(row["duration_s"]) - 10.0, 0.0) for row in rows)
    assert {row["events_fired"] for row in rows} == {"1"}
    assert "waste" in run(house, "-m", "rudc", "table", "out", "--metrics", "waste", "--format", "csv")


def test_action_kind(house):
    run(
        house, "-c",
        "import gymnasium, rudc, numpy as np\n"
        "env = gymnasium.make(rudc.ENV_ID, action='gentle')\n"
        "_, info = env.reset(seed=0)\n"
        "env.step(np.ones(2, np.float32))\n"
        "from rudc.env.action import read_action\n"
        "kind, scene = read_action('gentle'), info['scene']\n"
        "a = np.array([0.3, -0.8])\n"
        "np.testing.assert_allclose(kind.normalised(kind.physical(a, scene), scene), a, atol=1e-6)\n",
    )  # fmt: skip
