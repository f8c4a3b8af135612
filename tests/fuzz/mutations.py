"""Ways to damage texts, bytes and trees of values."""

from __future__ import annotations

import copy
import math
import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_]{3,}")
NUMBERS = (
    "0", "-0", "-1", "1e308", "-1e308", "1e-300", "1e18", "inf", "-inf", "nan", ".inf", ".nan", "", "0x10",
    "1_0",
    "99999999999", "9223372036854775808", "1" * 400, "0.0000001", "1e3", "17", "3.5", "-120", "1e9", "true",
    "٣",
)  # fmt: skip
"""as text, in the place of a number"""
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 7, 0.5, 1e308, -1e308, 1e-300, 1e18, math.inf, -math.inf, math.nan, 2**63,
    10**30,
    "", "x", "x" * 300, "left", "random", "0", "nan", "\U0001f697", "\x00", "../..", "a/b", [], {}, [1], [[]],
    [1, 2], {"uniform": [1, 2]}, {"uniform": [2, 1]}, {"normal": {"mean": 1e300, "std": 1e300}},
    {"choice": []}, {"x": 1}, [None], ["left", 3], {"": ""}, [[[[[[]]]]]],
)  # fmt: skip
"""in the place of any value of a tree"""
Tree = Any


def scratched_text(rng: random.Random, text: str) -> str:
    """A text with one to three small damages."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        text = rng.choice(_TEXT)(rng, text)
    return text


def scratched_bytes(rng: random.Random, data: bytes) -> bytes:
    """Bytes with some of them changed, cut out, doubled or put in."""
    if not data:
        return rng.randbytes(rng.randint(0, 64))
    for _ in range(rng.choice((1, 1, 2, 5))):
        at, length = rng.randrange(len(data) + 1), rng.choice((1, 1, 4, 16, 300))
        data = rng.choice((
            data[:at] + rng.randbytes(length) + data[at + length :],
            data[:at] + bytes(length) + data[at + length :],
            data[:at] + data[at + length :],
            data[:at] + rng.randbytes(length) + data[at:],
            data[: at + length] + data[at:],
            data[:at],
        ))  # fmt: skip
    return data


def another_number(rng: random.Random, text: str) -> str:
    """A text with one of its numbers replaced."""
    return _replaced(rng, text, NUMBER, NUMBERS)


def another_word(rng: random.Random, text: str) -> str:
    """A text with one of its words replaced by another of them."""
    return _replaced(rng, text, WORD, sorted(set(WORD.findall(text))) or ("word",))


def changed_tree(rng: random.Random, tree: Tree, others: Sequence[Tree] = ()) -> Tree:
    """A tree of lists and dictionaries with one to three values replaced (by parts of `others`, too),
    removed, doubled, renamed or wrapped.
    """
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        places = list(_places(tree))
        if not places:
            return rng.choice(VALUES)
        holder, key = rng.choice(places)
        _change(rng, holder, key, others)
    return tree


def _change(rng: random.Random, holder: Any, key: Any, others: Sequence[Tree]) -> None:
    deed = rng.choice(("value", "value", "value", "remove", "double", "rename", "wrap", "graft", "add"))
    if deed == "value":
        holder[key] = copy.deepcopy(rng.choice(VALUES))
    elif deed == "remove":
        del holder[key]
    elif deed == "wrap":
        holder[key] = rng.choice(([holder[key]], {"value": holder[key]}, str(holder[key])))
    elif deed == "graft" and others:
        donor, at = rng.choice(list(_places(rng.choice(others))))
        holder[key] = copy.deepcopy(donor[at])
    elif isinstance(holder, list):
        holder.insert(key, copy.deepcopy(holder[key]))
    elif deed == "rename":
        holder[rng.choice((f"{key}s", str(key)[:-1], str(key).upper(), "name", "kind"))] = holder.pop(key)
    else:
        holder[rng.choice(("kind", "when", "extra", "sweep", "seed"))] = copy.deepcopy(rng.choice(VALUES))


def _places(tree: Tree) -> list[tuple[Any, Any]]:
    """Holder and key of every value of a tree."""
    found: list[tuple[Any, Any]] = []
    waiting = [tree]
    while waiting:
        holder = waiting.pop()
        pairs = (
            holder.items()
            if isinstance(holder, dict)
            else enumerate(holder)
            if isinstance(holder, list)
            else ()
        )
        for key, value in pairs:
            found.append((holder, key))
            waiting.append(value)
    return found


def _replaced(rng: random.Random, text: str, pattern: re.Pattern[str], by: Sequence[str]) -> str:
    found = list(pattern.finditer(text))
    if not found:
        return text
    at = rng.choice(found)
    return text[: at.start()] + rng.choice(by) + text[at.end() :]


def _cut(rng: random.Random, text: str) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + text[at + rng.randint(1, 12) :]


def _put(rng: random.Random, text: str) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(("{", "}", "[", "]", ":", ": ", ",", "-", "&a ", "*a", "!!", "|", ">",
    "%", "@",
        "\t", "\n", "'", '"', "#", "<<: ", "?", "\x00", "\ufeff", "é", "<", "/>", "=", " ", "\r",
        "\u2028"))  + text[at:]  # fmt: skip


def _line(deed: Callable[[random.Random, list[str], int], None]) -> Callable[[random.Random, str], str]:
    def change(rng: random.Random, text: str) -> str:
        lines = text.split("\n")
        deed(rng, lines, rng.randrange(len(lines)))
        return "\n".join(lines)

    return change


def _remove(_rng: random.Random, lines: list[str], at: int) -> None:
    del lines[at]


def _double(_rng: random.Random, lines: list[str], at: int) -> None:
    lines.insert(at, lines[at])


def _move(rng: random.Random, lines: list[str], at: int) -> None:
    lines.insert(rng.randrange(len(lines)), lines.pop(at))


def _indent(rng: random.Random, lines: list[str], at: int) -> None:
    lines[at] = rng.choice((f"  {lines[at]}", f" {lines[at]}", lines[at].lstrip(), f"- {lines[at]}"))


def _end(rng: random.Random, text: str) -> str:
    return text[: rng.randrange(len(text) + 1)]


_TEXT: tuple[Callable[[random.Random, str], str], ...] = (
    _cut, _put, _end, another_number, another_number, another_word, another_word,
    _line(_remove), _line(_double), _line(_move), _line(_indent),
)  # fmt: skip


def instead(path: Path, deed: str) -> None:
    """Put something else where a file was: `empty`, `folder`, `loop`, `null`; nothing for other deeds."""
    if deed == "empty":
        path.touch()
    elif deed == "folder":
        path.mkdir()
    elif deed == "loop":
        path.symlink_to(path)
    elif deed == "null":
        path.symlink_to("/dev/null")
