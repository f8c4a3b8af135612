"""Damaged checkpoints: `rudc agent show`, and a moment's drive by those that it lets pass."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.arrays import Arrays
from rudc.learning.checkpoint import DESCRIPTION, WEIGHTS
from rudc.learning.parameters import fingerprint
from tests.fuzz.fuzzer import Case, Fuzzer
from tests.fuzz.mutations import (
    another_number,
    another_word,
    changed_tree,
    instead,
    scratched_bytes,
    scratched_text,
)

FOLDER = "agent"
COMMANDS = (
    ("agent", "show", FOLDER),
    ("run", "random_destination", "--agent", f"./{FOLDER}", "--set", "episode.timeout=0.3", "--quiet"),
)


def prepare(_folder: Path) -> Callable[[random.Random, Path], Case]:
    """Of the shipped checkpoints."""
    sources = list(shipped_checkpoints().values())
    described = [json.loads((source / DESCRIPTION).read_text(encoding="utf-8")) for source in sources]

    def make(rng: random.Random, place: Path) -> Case:
        kind = rng.choice(("tree", "tree", "graft", "number", "word", "text", "bytes", "weights", "header",
        "array", "array",
                           "array", "mixed", "files"))  # fmt: skip
        source, folder = rng.choice(sources), place / FOLDER
        folder.mkdir()
        for name in (DESCRIPTION, WEIGHTS):
            shutil.copyfile(source / name, folder / name)
        description = folder / DESCRIPTION
        text = description.read_text(encoding="utf-8")
        if kind in ("tree", "graft"):
            tree = changed_tree(rng, json.loads(text), described if kind == "graft" else ())
            description.write_text(json.dumps(tree), encoding="utf-8")
        elif kind in _TEXTS:
            description.write_bytes(_TEXTS[kind](rng, text))
        else:
            _DEEDS[kind](rng, folder, rng.choice(sources))
        return Case(kind, COMMANDS)

    return make


_TEXTS: dict[str, Callable[[random.Random, str], bytes]] = {
    "number": lambda rng, text: another_number(rng, text).encode(),
    "word": lambda rng, text: another_word(rng, text).encode(),
    "text": lambda rng, text: scratched_text(rng, text).encode("utf-8", "replace"),
    "bytes": lambda rng, text: scratched_bytes(rng, text.encode()),
}


def _weights(rng: random.Random, folder: Path, _other: Path) -> None:
    """Bytes of the weights; where the file can still be read, the description agrees with them."""
    path = folder / WEIGHTS
    path.write_bytes(scratched_bytes(rng, path.read_bytes()))
    if rng.random() < 0.7:
        try:
            _agree(folder, load_file(path))
        except Exception:  # what is in it cannot be read: that is the test
            return


def _header(rng: random.Random, folder: Path, _other: Path) -> None:
    """The part of the weights' file that says what is in it."""
    path = folder / WEIGHTS
    data = path.read_bytes()
    end = 8 + int.from_bytes(data[:8], "little")
    deed = rng.choice((scratched_text, another_number, another_word))
    header = deed(rng, data[8:end].decode()).encode("utf-8", "replace")
    said = rng.choice((len(header), len(header), len(header), end, 2**60, 0))
    path.write_bytes(said.to_bytes(8, "little") + header + data[end:])


def _array(rng: random.Random, folder: Path, _other: Path) -> None:
    """One array of another shape, kind or content, or none, or one more; the description agrees with it."""
    arrays = dict(load_file(folder / WEIGHTS))
    name = rng.choice(sorted(arrays))
    value = np.atleast_1d(arrays[name])
    wild = value.copy()
    wild.reshape(-1)[rng.randrange(value.size)] = rng.choice((np.nan, np.inf, -np.inf, 1e30))
    changed = rng.choice((
        None, wild, wild, value.T, value[..., :0], value.reshape(-1), value[None], np.concatenate([value,
        value], axis=-1),
        value.astype(np.float64), value.astype(np.float16), value.astype(np.int32), value.astype(bool),
        np.zeros(0, np.float32),
        np.float32(0.0) * value, value * np.float32(1e6), value[..., ::-1], value[:1], np.array(1.0,
        np.float32),
    ))  # fmt: skip
    if changed is None:
        del arrays[name]
    else:
        arrays[rng.choice((name, name, name, name, name + "x", "x", "", "policy/x"))] = np.ascontiguousarray(
            changed
        )
    (folder / WEIGHTS).write_bytes(save(arrays))
    _agree(folder, arrays)


def _mixed(rng: random.Random, folder: Path, other: Path) -> None:
    """The files of two agents; sometimes the description agrees with the weights."""
    name = rng.choice((DESCRIPTION, WEIGHTS))
    shutil.copyfile(other / name, folder / name)
    if rng.random() < 0.7:
        _agree(folder, load_file(folder / WEIGHTS))


def _files(rng: random.Random, folder: Path, _other: Path) -> None:
    """A file that is missing, empty, a folder, a link to itself, or not to be read."""
    path = folder / rng.choice((DESCRIPTION, WEIGHTS))
    path.unlink()
    deed = rng.choice(("missing", "empty", "folder", "loop", "null"))
    instead(path, deed)


def _agree(folder: Path, arrays: Arrays) -> None:
    description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
    description["weights"] = fingerprint(arrays)
    (folder / DESCRIPTION).write_text(json.dumps(description), encoding="utf-8")


_DEEDS: dict[str, Callable[[random.Random, Path, Path], None]] = {
    "weights": _weights, "header": _header, "array": _array, "mixed": _mixed, "files": _files,
}  # fmt: skip
FUZZER = Fuzzer("checkpoints", 5_000, prepare)
