"""A search's folder: manifest, rows, and what is there already when a search goes on."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.folder import keep_traceback, settled, with_versions
from rudc.evaluation.manifest import (
    FORMAT,
    agent_digests,
    agent_reads,
    as_json,
    manifest,
)
from rudc.evaluation.own_networks import keep_networks, with_copies
from rudc.evaluation.record import EpisodeRecord, as_text
from rudc.evaluation.rows import by_row, undamaged
from rudc.evaluation.search.space import Space
from rudc.evaluation.store import RowFile, format_row
from rudc.evaluation.tasks import SweepPlan
from rudc.files import make_folder, take_lock, write_atomically
from rudc.scenario.model import Scenario
from rudc.scenario.networks import is_network_path

WEIGHT = "weight"
"""column: density of the episode's values as declared over that with which they were drawn"""


@dataclass(frozen=True)
class SearchPlan:
    """Everything that decides a search's rows."""

    scenario: Scenario
    agent: str
    episodes: int
    seed: int
    space: Space

    def __post_init__(self) -> None:
        self.sweep()  # refuses what a sweep refuses

    def sweep(self) -> SweepPlan:
        """The sweep of as many episodes, all drawn as the scenario declares."""
        return SweepPlan((self.scenario,), (self.agent,), self.episodes, self.seed)


class SearchFolder:
    """Where one search keeps its results. A context: while it is open no other may write there."""

    def __init__(self, path: Path, plan: SearchPlan) -> None:
        self.path = path
        self.scenario = plan.scenario
        """on the folder's copy of its network, once it is open"""
        self.agent_digest = ""
        self.agent_reads: dict[str, str] = {}
        self.warnings: list[str] = []
        self.rows: dict[int, dict[str, str]] = {}
        """seed -> row, of the episodes that are there"""
        self._plan = plan
        self._keys = tuple(plan.space.axes)
        self._file = RowFile(path / "evaluations.csv", [*COLUMNS, *self._keys, WEIGHT])
        self._lock: int | None = None
        self._manifest = ""
        """text that is to be written before the first row"""

    def __enter__(self) -> SearchFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def open(self, resume: bool) -> None:
        """Lock the folder for this search. Raises InputError when it is in use or cannot be made, SweepError
        when something else is in it.
        """
        new = self._content()  # refuses an unknown agent, before there is a folder
        make_folder(self.path)
        self._lock = take_lock(self.path, self.warnings)
        content = settled(self.path, new, resume, "go on with the search", self._accepted)
        self.scenario = with_copies(self.scenario, keep_networks(self._plan.sweep(), self.path))
        self.agent_digest = agent_digests(content)[self._plan.agent]
        self.agent_reads = agent_reads(content, self._plan.agent)
        self._read()
        left = len(self.rows) < self._plan.episodes
        content = with_versions(self.path, content, new["versions"] if left else None, self.warnings)
        self._manifest = as_json(content)

    def _accepted(self, old: Mapping[str, Any]) -> Mapping[str, Any]:
        """The manifest that is there. Raises SweepError when the folder holds no search."""
        if old["format"] != FORMAT or "search" not in old["configuration"]:
            raise SweepError(f"{self.path} holds no search of this version of RUDC; give another --out")
        return old

    def _content(self) -> dict[str, Any]:
        content = manifest(self._plan.sweep())
        content["configuration"]["search"] = {
            key: axis.model_dump(mode="json") for key, axis in self._plan.space.axes.items()
        }
        content["versions"]["cma"] = importlib.metadata.version("cma")
        return content

    def _read(self) -> None:
        blocks = (dict(zip(self._file.header, cells, strict=True)) for cells in self._file.blocks())
        rows = by_row(undamaged(blocks, (), self._file.path))
        last = self._plan.seed + self._plan.episodes
        self.rows = {int(row["seed"]): row for row in rows}
        if stray := [seed for seed in self.rows if not self._plan.seed <= seed < last]:
            raise SweepError(
                f"{self._file.path} has a row of seed {stray[0]}, which is not of this search; delete it"
            )
        self._file.rewrite(format_row(list(row.values())) for row in rows)  # a kill leaves part of one

    def known(self, seed: int, values: Mapping[str, float], weight: float) -> bool:
        """Whether an episode has a row; if so, the row gets this weight, which depends on how many of its
        batch are asked for. Raises SweepError where that row has other values.
        """
        if seed not in self.rows:
            return False
        if [self.rows[seed][key] for key in self._keys] != self._told(values):
            raise SweepError(
                f"{self._file.path}: the row of seed {seed} is not what this search asks for there: rows "
                "were edited, or made with other versions; give another --out"
            )
        self.rows[seed][WEIGHT] = as_text(weight)
        return True

    def add(self, record: EpisodeRecord, values: Mapping[str, float], weight: float) -> None:
        """Append an episode; a traceback goes to a file that the row names. Raises StorageError."""
        self._keep_manifest()
        if record.traceback:
            record = keep_traceback(self.path, str(record.seed), record)
        row = [*record.row(), *self._told(values), as_text(weight)]
        self._file.append(row)
        self.rows[record.seed] = dict(zip(self._file.header, row, strict=True))

    def _keep_manifest(self) -> None:
        """Write the manifest, once what is there has been found to belong to this search."""
        if self._manifest:
            write_atomically(self.path / "manifest.json", self._manifest)
            self._manifest = ""

    def _told(self, values: Mapping[str, float]) -> list[str]:
        return [as_text(values[key]) for key in self._keys]

    def complete(self, violations: Sequence[int]) -> None:
        """Sort the rows, and write files for the violations, which are given by their seeds in order."""
        self._keep_manifest()
        self._file.rewrite(format_row(list(self.rows[seed].values())) for seed in sorted(self.rows))
        folder = self.path / "failures"
        make_folder(folder)
        lines = [["file", *self._file.header]]
        for seed in violations:
            row = self.rows[seed]
            name = f"{self.scenario.name}-{seed}"
            write_atomically(folder / f"{name}.yaml", self._scenario_of(row, name, folder).to_yaml())
            lines.append([f"failures/{name}.yaml", *row.values()])
        write_atomically(self.path / "failures.csv", "".join(map(format_row, lines)))

    def _scenario_of(self, row: Mapping[str, str], name: str, folder: Path) -> Scenario:
        """The episode's scenario, its network named as seen from the folder that it will lie in."""
        fixed = self._plan.space.fixed(self.scenario, {key: float(row[key]) for key in self._keys})
        told = f"{row['outcome']} of {row['agent']} at seed {row['seed']}"
        network = fixed.network
        if is_network_path(network):
            network = os.path.relpath(network, folder)
        return fixed.model_copy(update={"name": name, "description": told, "network": network})
