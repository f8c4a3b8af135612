"""Damaged networks: `rudc network check`, and a moment's drive on those that it lets pass."""

from __future__ import annotations

import os
import random
import re
from collections.abc import Callable
from pathlib import Path

from rudc.network.network import shipped_networks
from tests.fuzz.fuzzer import Case, Fuzzer
from tests.fuzz.mutations import NUMBERS, another_number, scratched_bytes, scratched_text

FILE = "mutant.net.xml"
SCENARIO = f"name: mutant\nextends: random_destination\nnetwork: {FILE}\nepisode: {{timeout: 1}}\n"
COMMANDS = (
    ("network", "check", FILE),
    ("run", "on_it.yaml", "--agent", "gap-acceptance+ttcbf", "--quiet"),
)
ELEMENT = re.compile(
    r"^ *<(?:lane|connection|request|junction|edge|roundabout|location|net|type)\b[^>]*>\n?", re.MULTILINE
)
ATTRIBUTE = re.compile(r' (\w+)="([^"]*)"')


def prepare(folder: Path) -> Callable[[random.Random, Path], Case]:
    """Of the shipped networks; what was tried out is remembered in `folder`, not in the user's."""
    texts = [path.read_text(encoding="utf-8") for path in shipped_networks().values()]
    os.environ["XDG_CACHE_HOME"] = str(folder)

    def make(rng: random.Random, place: Path) -> Case:
        kind = rng.choice(tuple(_DEEDS))
        (place / FILE).write_bytes(_DEEDS[kind](rng, rng.choice(texts)))
        (place / "on_it.yaml").write_text(SCENARIO, encoding="utf-8")
        return Case(kind, COMMANDS)

    return make


def _element(deed: Callable[[random.Random, str, str], str]) -> Callable[[random.Random, str], bytes]:
    """One to three elements changed: element, another -> what takes its place."""

    def change(rng: random.Random, text: str) -> bytes:
        for _ in range(rng.choice((1, 1, 2, 3))):
            found = list(ELEMENT.finditer(text))
            if not found:
                break
            at, other = rng.choice(found), rng.choice(found)
            text = text[: at.start()] + deed(rng, at[0], other[0]) + text[at.end() :]
        return text.encode()

    return change


def _attribute(rng: random.Random, element: str, other: str) -> str:
    """An element with one attribute removed, set to something wild, or to what another element says."""
    found = list(ATTRIBUTE.finditer(element))
    if not found:
        return element
    at = rng.choice(found)
    theirs = dict(ATTRIBUTE.findall(other)).get(at[1], "nobody")
    value = rng.choice(
        (None, theirs, theirs, theirs, rng.choice(NUMBERS), "\U0001f697", at[2][:-1], at[2] * 2)
    )
    return element[: at.start()] + ("" if value is None else f' {at[1]}="{value}"') + element[at.end() :]


_DEEDS: dict[str, Callable[[random.Random, str], bytes]] = {
    "element removed": _element(lambda rng, element, other: ""),
    "element doubled": _element(lambda rng, element, other: element + element),
    "element moved": _element(lambda rng, element, other: element + other),
    "attribute": _element(_attribute),
    "number": lambda rng, text: another_number(rng, text).encode(),
    "text": lambda rng, text: scratched_text(rng, text).encode("utf-8", "replace"),
    "bytes": lambda rng, text: scratched_bytes(rng, text.encode()),
}
FUZZER = Fuzzer("networks", 2_000, prepare, patience_s=240.0)
