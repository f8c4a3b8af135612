"""A file is bounded before anything is built of it."""

import time
import tracemalloc

import pytest

from rudc.cli.options import parse_overrides
from rudc.errors import InputError, ScenarioError
from rudc.scenario import load_scenario


def aliases(levels):
    """Lists of ten aliases of lists of ten aliases: 10^levels values in a few lines."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, levels)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (aliases(7), r"bomb.yaml:4:\d+: more than 10000 values, counting what its aliases stand for"),
        ("a: " + "[" * 600, r"bomb.yaml:1:33: nested more than 30 deep"),
        ("a: [" + "1, " * 20_000 + "1]", r"bomb.yaml:1:\d+: more than 10000 values"),
        ("a: " + "x" * 5_000_000, r"bomb.yaml:1:1: longer than 200000 characters"),
        ("a: " + "ä" * 400_002, r"bomb.yaml:1:1: longer than 200000 characters"),  # cut in an ä
    ],
    ids=["aliases", "deep", "many", "long", "long in other letters"],
)
def test_too_much_is_said_at_once(tmp_path, text, told):
    path = tmp_path / "bomb.yaml"
    path.write_text(text, encoding="utf-8")
    began = time.process_time()
    with pytest.raises(ScenarioError, match=told):
        load_scenario(path)
    assert time.process_time() - began < 2.0
    tracemalloc.start()  # which takes several times as long
    try:
        with pytest.raises(ScenarioError, match=told):
            load_scenario(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 50e6


def test_values_on_the_command_line_are_bounded_too():
    with pytest.raises(InputError, match="nested more than 30 deep"):
        parse_overrides(["traffic.density=" + "[" * 200])
    with pytest.raises(InputError, match="is too long"):
        parse_overrides(["traffic.density=" + "1" * 300_000])


def test_a_key_that_is_given_twice_is_refused():
    with pytest.raises(InputError, match=r"traffic\.density is given twice"):
        parse_overrides(["traffic.density=10", "traffic.density=30"])


def test_a_few_aliases_are_welcome(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(
        "name: own\nextends: random_destination\n"
        "traffic: {density: &twenty 20, impatience: 0.5}\nsweep: {traffic.density: [10, *twenty]}\n"
    )
    assert load_scenario(path).sweep == {"traffic.density": (10, 20)}
