"""Damaged scenario files: `rudc scenario validate`, and a moment's drive of those that it lets pass."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import yaml

from rudc.scenario import load_scenario, shipped_scenarios
from tests.fuzz.fuzzer import Case, Fuzzer
from tests.fuzz.mutations import another_number, changed_tree, scratched_bytes, scratched_text

FILE = "mutant.yaml"
RARE = Path(__file__).with_name("rare.yaml")
"""a file with the keys that no shipped scenario has"""
COMMANDS = (
    ("scenario", "validate", FILE),
    ("run", FILE, "--agent", "gap-acceptance+ttcbf", "--set", "episode.timeout=0.3", "--quiet"),
)


def prepare(_folder: Path) -> Callable[[random.Random, Path], Case]:
    """Of the shipped scenarios and a RARE one, as they stand and with all that they extend."""
    texts = [path.read_text(encoding="utf-8") for path in (*shipped_scenarios().values(), RARE)]
    trees = [load_scenario(source).data() for source in (*shipped_scenarios(), RARE)]

    def make(rng: random.Random, folder: Path) -> Case:
        kind = rng.choice(("text", "number", "tree", "graft", "cross", "bytes", "bomb"))
        path = folder / FILE
        if kind == "bytes":
            path.write_bytes(scratched_bytes(rng, rng.choice(texts).encode()))
        elif kind in ("tree", "graft"):
            tree = changed_tree(rng, rng.choice(trees), trees if kind == "graft" else ())
            path.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        else:
            made = {
                "text": lambda: scratched_text(rng, rng.choice(texts)),
                "number": lambda: another_number(rng, yaml.safe_dump(rng.choice(trees), sort_keys=False)),
                "cross": lambda: _crossed(rng, rng.choice(texts), rng.choice(texts)),
                "bomb": lambda: _bomb(rng),
            }[kind]()
            path.write_bytes(made.encode("utf-8", "replace"))
        return Case(kind, COMMANDS)

    return make


def _crossed(rng: random.Random, one: str, other: str) -> str:
    """Lines of two files in turn."""
    first, second = one.splitlines(), other.splitlines()
    return "\n".join([*first[: rng.randrange(len(first))], *second[rng.randrange(len(second)) :], ""])


def _bomb(rng: random.Random) -> str:
    """Little text that means much."""
    size = rng.choice((3, 9, 30, 300, 3000, 30_000))
    return rng.choice((
        "\n".join(["a0: &a0 [x, x, x]", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1,
        min(size, 40)))]),
        "name: x\nevents: " + "[" * size,
        "name: x\nevents: " + "{a: " * size,
        "name: x\n" + "sweep: {traffic.density: [" + ", ".join(map(str, range(size))) + "]}",
        "name: x\nsweep: {" + ", ".join(f"{key}: [1, 2, 3, 4, 5, 6, 7, 8, 9]" for key in (
            "traffic.density", "ego.speed", "ego.distance", "traffic.impatience",
            "traffic.warm_up")[: min(size, 5)]) + "}",
        "name: x\nevents:\n" + "- {kind: hard_brake, vehicle: leader, deceleration: 4}\n" * size,
        "name: " + "x" * size,
        "name: x\ntraffic: {density: " + "1" * size + "}",
        "&a name: *a",
        "name: x\nextends: mutant",
        "name: x\nextends: [mutant.yaml]",
        "name: x\nextends: mutant.yaml",
        "<<: &a {<<: *a}",
        "name: x\nnetwork: mutant.yaml",
        "name: x\nnetwork: /dev/null",
        "name: x\nnetwork: .",
        "name: x\nevents: [{kind: accident, vehicles: ["
        + ", ".join(["{lane: west_out_1, at: 12}"] * size)
        + "]}]",
        f"name: x\nego: {{speed: {{choice: [{', '.join(['5'] * size)}]}}}}",
    ))  # fmt: skip


FUZZER = Fuzzer("scenarios", 100_000, prepare)
