"""The README's examples run: its bash blocks, its python blocks, its YAML.

The first command is run as a user types it, with short episodes, the others in this process, which has
imported what each would import anew, with fewer episodes. Blocks without a language are not run: set-up, long
training, output.
"""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rudc.env.action import Adjustment, Direct
from rudc.env.intersection import IntersectionEnv
from rudc.env.tracking import steering
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.world.world import World
from tests.blocks import blocks_of, run_commands, run_python, run_script, smaller

README = Path(__file__).parents[1] / "README.md"
BLOCKS = blocks_of(README)


def _texts(language: str) -> list[str]:
    return [block.text for block in BLOCKS if block.language == language]


def test_there_are_examples_of_each_kind():
    assert {block.language for block in BLOCKS} == {"bash", "python", "yaml"}


@pytest.mark.parametrize("script", _texts("bash"))
def test_commands_run_from_another_folder(script, tmp_path):
    first, _, others = script.partition("\n") if script == _texts("bash")[0] else ("", "", script)
    run_script(f"{first} --set episode.timeout=8" if first else "", tmp_path)
    run_commands(smaller(others), tmp_path)


def test_python_runs_in_order(tmp_path):
    run_python("\n".join(_texts("python")), tmp_path)


@pytest.mark.parametrize("text", _texts("yaml"))
def test_yaml_is_a_valid_scenario(text, tmp_path):
    path = tmp_path / "my_scenario.yaml"
    path.write_text(text, encoding="utf-8")
    assert load_scenario(path).name == "my_scenario"


def test_zero_of_an_action_means_what_it_says():
    (told,) = re.findall(r"`0, 0` brakes at (\S+) m/s2", README.read_text(encoding="utf-8"))
    with World(load_network("four_way")) as world:
        world.reset(load_scenario("random_destination").plan(0))
        scene, zero = world.scene(), np.zeros(2)
    assert Direct().physical(zero, scene).tolist() == [-float(told), 0.0]
    assert Adjustment().physical(zero, scene).tolist() == [0.0, steering(scene)]
    assert inspect.signature(IntersectionEnv).parameters["action"].default == "direct"


def test_links_lead_somewhere_and_the_picture_moves():
    links = re.findall(r"\]\(([^)#]+)\)", README.read_text(encoding="utf-8"))
    assert len(links) > 15
    assert [link for link in links if not (README.parent / link).exists()] == []
    picture = README.parent / next(link for link in links if link.endswith(".webp"))
    assert picture.stat().st_size < 1_500_000
    with Image.open(picture) as film:
        assert film.n_frames > 50
