"""The README's examples run: its bash blocks as a user would type them, its python blocks, its YAML.

Blocks without a language are not run: set-up, long training, output.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"^```(bash|python|yaml)\n(.*?)^```", README.read_text(encoding="utf-8"), re.M | re.S)


def _blocks(language: str) -> list[str]:
    return [text for kind, text in BLOCKS if kind == language]


def test_there_are_examples_of_each_kind():
    assert {kind for kind, _ in BLOCKS} == {"bash", "python", "yaml"}


@pytest.mark.parametrize("script", _blocks("bash"))
def test_commands_run_from_another_folder(script, tmp_path):
    scripts = Path(sys.executable).parent
    env = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"}
    run = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr


def test_python_runs_in_order(tmp_path):
    code = "\n".join(_blocks("python"))
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("text", _blocks("yaml"))
def test_yaml_is_a_valid_scenario(text, tmp_path):
    from rudc.scenario import load_scenario

    path = tmp_path / "my_scenario.yaml"
    path.write_text(text, encoding="utf-8")
    assert load_scenario(path).name == "my_scenario"
