"""Rows of several sweeps as of one: parts of a sweep that were driven apart, or sweeps to compare."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rudc.arrays import Index
from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.folder import sweep_rows
from rudc.evaluation.manifest import agent_digests, read_manifest
from rudc.evaluation.rows import Columns, SweepRows

FOLDER = "folder"
"""name of the column that says from which folder a row is, as it was given"""
Digests = Mapping[str, str]
"""name -> digest"""


def joined_rows(folders: Sequence[Path], by: Sequence[str], warnings: list[str]) -> SweepRows:
    """The rows of several sweeps' folders, with a column `folder`; of one folder, its rows as they are.

    `by`: the columns that will group them. Unless `folder` is one of these, no two folders may have the same
    episode; and where `scenario` is, a scenario must be the same in all folders that have it: SweepError says
    which is not. `warnings` gets what else differs: agents and versions.
    """
    together = FOLDER not in by
    if len(folders) == 1 and together:
        return sweep_rows(folders[0])
    names, places = [str(folder) for folder in folders], [folder.resolve() for folder in folders]
    if twice := [name for name, place in zip(names, places, strict=True) if places.count(place) > 1]:
        raise SweepError(f"{twice[-1]} is given more than once")
    contents = {name: read_manifest(folder) for name, folder in zip(names, folders, strict=True)}
    scenarios = {name: _scenarios(content) for name, content in contents.items()}
    if together:
        if "scenario" in by and (text := _unlike("scenario", scenarios)):
            raise SweepError(f"{text}; --by {FOLDER},... keeps their rows apart")
        if text := _unlike("agent", {name: agent_digests(content) for name, content in contents.items()}):
            warnings.append(text)
    if changed := _several_versions(contents):
        warnings.append(f"rows come from several versions: {', '.join(changed)}")
    found = {name: sweep_rows(folder) for name, folder in zip(names, folders, strict=True)}
    parameters = tuple(dict.fromkeys(key for rows in found.values() for key in rows.parameters))
    others = dict.fromkeys(name for rows in found.values() for name in rows.names)
    own = (name for name in others if name not in COLUMNS and name not in parameters)
    columns = (FOLDER, *COLUMNS, *own, *parameters)

    def blocks() -> Iterator[Columns]:
        for name, rows in found.items():
            for block in rows.blocks():
                nothing = [""] * len(block["seed"])
                told = {**block, FOLDER: [name] * len(nothing)}
                yield {column: told.get(column, nothing) for column in columns}

    lacking = frozenset.union(*(rows.lacking for rows in found.values()))
    read = _each_once(blocks, scenarios, parameters) if together else blocks
    told = [rows.algorithms for rows in found.values()]
    algorithms = {
        agent: name
        for of in told
        for agent, name in of.items()
        if all(other.get(agent, name) == name for other in told)
    }
    return SweepRows(columns, parameters, read, lacking, algorithms)


def _each_once(
    blocks: Callable[[], Iterator[Columns]], scenarios: Mapping[str, Digests], parameters: Sequence[str]
) -> Callable[[], Iterator[Columns]]:
    """The same blocks. Raises SweepError after the last one for an episode that two folders have (recognised
    by a 64-bit hash of its identity)."""

    def checked() -> Iterator[Columns]:
        keys = [np.zeros(0, np.int64)]
        for block in blocks():
            keys.append(_keys(block, scenarios, parameters)[0])
            yield block
        ordered = np.sort(np.concatenate(keys))
        if (again := ordered[1:][ordered[1:] == ordered[:-1]]).size:
            there = dict[str, list[str]]()
            for block in blocks():
                found, places = _keys(block, scenarios, parameters)
                for k in map(int, places[np.isin(found, again)]):
                    episode = f"{block['scenario'][k]}, {block['agent'][k]}, seed {block['seed'][k]}"
                    there.setdefault(episode, []).append(block[FOLDER][k])
            episode, found_in = next(iter(there.items()))
            named = " and ".join(dict.fromkeys(found_in))
            raise SweepError(f"the episode {episode} is in {named}; give one of them, or --by {FOLDER},...")

    return checked


def _keys(block: Columns, scenarios: Mapping[str, Digests], parameters: Sequence[str]) -> tuple[Index, Index]:
    """(n,) a hash of what tells each episode that ran from others, and (n,) where it stands in the block."""
    places = np.flatnonzero([not error for error in block["error"]])
    digests = (
        scenarios[folder].get(name, name)
        for folder, name in zip(block[FOLDER], block["scenario"], strict=True)
    )
    named = (block[name] for name in ("agent", "seed", *parameters))
    keys = np.fromiter(map(hash, zip(digests, *named, strict=True)), np.int64, len(block["seed"]))
    return keys[places], places


def _scenarios(content: Mapping[str, Any]) -> Digests:
    return {name: told["digest"] for name, told in content["configuration"]["scenarios"].items()}


def _unlike(what: str, digests: Mapping[str, Digests]) -> str:
    """The first name that has another digest in two folders, in words; empty if there is none."""
    first: dict[str, str] = {}
    for folder, named in digests.items():
        for name, digest in named.items():
            other = first.setdefault(name, folder)
            if digests[other][name] != digest:
                return f"the {what} {name!r} is not the same in {other} and {folder}"
    return ""


def _several_versions(contents: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What differs between the versions with which rows were made: `name one, other`."""
    made = [versions for c in contents.values() for versions in (c["versions"], *c.get("resumed_with", []))]
    by_name: dict[str, dict[str, None]] = {}
    for versions in made:
        for name, version in versions.items():
            by_name.setdefault(name, {})[version] = None
    return [f"{name} {', '.join(found)}" for name, found in by_name.items() if len(found) > 1]
