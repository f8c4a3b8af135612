"""Whatever a file says, it becomes a scenario or a list of problems with their places; nothing else leaks."""

import re
import tempfile
from pathlib import Path

import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.errors import ScenarioError
from rudc.scenario import load_scenario, shipped_scenarios
from rudc.scenario.dotted import with_value
from rudc.world.fitting import misfits

TEXTS = [path.read_text() for path in shipped_scenarios().values()]
WHOLE = [
    load_scenario(name).data()
    for name in ("perfect_storm", "blocked_left_turn", "density_sweep", "jaywalkers")
]
WORDS = st.sampled_from(
    [
        "uniform",
        "normal",
        "choice",
        "random",
        "leader",
        "kind",
        "when",
        "left",
        "on",
        "mean",
        "values",
        "<<",
        "lane",
    ]
)
SCALARS = (
    st.none() | st.booleans() | st.integers(-50, 50) | st.floats(-1e3, 1e3) | WORDS | st.text(max_size=3)
)
VALUES = st.recursive(
    SCALARS | st.floats(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=6,
)


def leaves(data, path=""):
    """Dotted keys of every value in a file."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in pairs:
        if "." not in str(key):
            yield f"{path}{key}"
            yield from leaves(value, f"{path}{key}.")


def outcome(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text(text, encoding="utf-8")
        try:
            scenario = load_scenario(path, fit=misfits)
        except ScenarioError as error:
            for line in str(error).splitlines():
                place = re.match(r".*?s\.yaml:(\d+):(\d+): \S", line)
                assert place, line
                assert 1 <= int(place[1]) <= text.count("\n") + 1, line
        else:
            for seed in range(3):
                scenario.plan(seed)
            path.write_text(scenario.to_yaml(), encoding="utf-8")
            assert load_scenario(path).digest == scenario.digest


@settings(max_examples=100)
@given(st.data())
def test_a_value_replaced_by_any_other(data):
    whole = data.draw(st.sampled_from(WHOLE))
    key = data.draw(st.sampled_from(list(leaves(whole))))
    changed, _ = with_value(whole, key, data.draw(VALUES))
    outcome(yaml.safe_dump(changed, sort_keys=False))


@settings(max_examples=80)
@given(
    st.sampled_from(TEXTS),
    st.integers(0),
    st.integers(0, 9),
    st.text(max_size=3) | st.sampled_from("{}[]:,-&*!|>%@`\t\n'\""),
)
def test_a_text_with_a_scratch(text, at, length, scratch):
    at %= len(text)
    scratched = text[:at] + scratch + text[at + length :]
    outcome(scratched.encode("utf-8", "ignore").decode())
