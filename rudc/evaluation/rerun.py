"""Episodes of a sweep run again: found by their rows, set up from its manifest, compared with the rows."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS, TIMING
from rudc.evaluation.folder import TRACEBACK, sweep_rows
from rudc.evaluation.kept import KeptScenarios, kept_settings
from rudc.evaluation.manifest import read_manifest, version_changes, versions
from rudc.evaluation.record import EpisodeRecord, as_text
from rudc.evaluation.rows import by_row, is_whole
from rudc.evaluation.tasks import Task
from rudc.hints import did_you_mean, listed
from rudc.imports import plugins, sources_digests
from rudc.scenario.model import Scalar, Scenario

HOW = "give SCENARIO:AGENT:SEED, or the number of a row of episodes.csv, from 1"


class Rerun(NamedTuple):
    """An episode of a sweep, ready to be run again."""

    number: int
    """number of its row, from 1"""
    row: Mapping[str, str]
    """without the columns that did not exist yet when it was written"""
    task: Task
    changes: tuple[str, ...]
    """what differs from when the sweep ran"""


def find_episode(folder: Path, which: str) -> Rerun:
    """The episode that `SCENARIO:AGENT:SEED` or the number of a row stands for. Raises SweepError."""
    sweep = Swept(folder)
    return sweep.episode(_number(sweep.rows, sweep.parameters, which, folder))


class Swept:
    """A sweep's folder, of which episodes can be run again. Raises SweepError where it is none."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._content = read_manifest(folder)
        self._scenarios = KeptScenarios(folder, self._content)
        swept = sweep_rows(folder)
        self.rows, self.parameters = by_row(swept.blocks()), swept.parameters
        """its rows; columns that did not exist yet when it was written are empty"""
        self._lacking = swept.lacking
        self._families: dict[str, _Family] = {}
        self._changes: dict[tuple[str, str], tuple[str, ...]] = {}

    def episode(self, number: int) -> Rerun:
        """The episode of a row, by its number from 1. Raises SweepError where the manifest cannot say what it
        was."""
        row = self.rows[number - 1]
        name, agent = row["scenario"], row["agent"]
        if name not in self._families:
            self._families[name] = self._family(name)
        family = self._families[name]
        wanted = tuple(row[parameter] for parameter in self.parameters)
        if wanted not in family.points:
            raise SweepError(f"the scenario {name!r} of {self._folder} is not swept over {', '.join(wanted)}")
        swept, scenario = family.points[wanted]
        if (name, agent) not in self._changes:
            self._changes[name, agent] = tuple(_changes(self._content, family, agent))
        said = {name: text for name, text in row.items() if name not in self._lacking}
        return Rerun(number, said, Task(scenario, swept, agent, int(row["seed"])), self._changes[name, agent])

    def _family(self, name: str) -> _Family:
        family = self._scenarios.read(name)
        said = self._content["configuration"]["scenarios"][name]
        given = family.model_copy(update={"sweep": said["values"].get("sweep", {})})  # not the copies' paths
        points = {
            tuple(as_text(swept.get(parameter)) for parameter in self.parameters): (swept, scenario)
            for swept, (_, scenario) in zip(given.points(), family.grid(), strict=True)
        }
        return _Family(points, family.digest == said["digest"])


class _Family(NamedTuple):
    """A scenario of a sweep, with all its swept values."""

    points: Mapping[tuple[str, ...], tuple[Mapping[str, Scalar], Scenario]]
    """by the text of its swept values, which are those that the sweep was given"""
    same: bool
    """whether it still means what it meant when the sweep ran"""


class Difference(NamedTuple):
    """A column in which an episode came out differently from its row."""

    column: str
    then: str
    now: str

    @property
    def size(self) -> float:
        """Of two numbers, how far apart they are; nan for anything else."""
        try:
            return abs(float(self.then) - float(self.now))
        except ValueError:
            return math.nan

    def __str__(self) -> str:
        return f"{self.column}: {self.then or 'nothing'} then, {self.now or 'nothing'} now"


def differences(row: Mapping[str, str], record: EpisodeRecord) -> list[Difference]:
    """Columns in which an episode came out differently from its row. Left out are timing, columns that the
    row does not have and, where it has an error, those that are empty because of it.
    """
    said = {**row, "error": row["error"].partition(TRACEBACK)[0]}
    names = [name for name in COLUMNS if name in said and name not in TIMING]
    pairs = (Difference(name, said[name], record.text(name)) for name in names)
    return [d for d in pairs if d.then != d.now and (d.then or not said["error"])]


def _number(rows: Sequence[Mapping[str, str]], parameters: Sequence[str], which: str, folder: Path) -> int:
    """The number of the row that is meant."""
    if not rows:
        raise SweepError(f"{folder} has no rows: no episode of it has ended; finish it with --resume")
    if is_whole(which):
        if not 1 <= int(which) <= len(rows):
            raise SweepError(f"{folder} has rows 1 to {len(rows)}, not {which}")
        return int(which)
    scenario, _, rest = which.partition(":")
    agent, _, seed = rest.rpartition(":")
    if not (scenario and agent and is_whole(seed)):
        raise SweepError(f"which episode is {which[:80]!r}? {HOW}")
    wanted = {"scenario": scenario, "agent": agent, "seed": str(int(seed))}
    found = [k for k, row in enumerate(rows, 1) if all(row[name] == v for name, v in wanted.items())]
    if len(found) > 1:
        shown = "; ".join(
            f"row {k}: {', '.join(f'{name}={rows[k - 1][name]}' for name in parameters)}" for k in found[:8]
        )
        raise SweepError(f"{len(found)} episodes are {which}; give the number of one's row ({shown})")
    if found:
        return found[0]
    for name, value in wanted.items():
        known = list(dict.fromkeys(row[name] for row in rows))
        if value not in known:
            there = did_you_mean(value, known) or f"; there are: {listed(known)}"
            raise SweepError(f"{folder} has no episode of {name} {value!r}{there}")
    raise SweepError(f"{folder} has no episode {which}")


def _changes(content: Mapping[str, Any], family: _Family, agent: str) -> list[str]:
    """What differs now: scenario, agent, code that is not RUDC's, versions; also between the sweep's rows."""
    found = []
    if not family.same:
        found.append("the scenario, or a file that it names, means something else now")
    settings = json.loads(json.dumps(kept_settings(agent)))
    then = content["configuration"].get("agents", {}).get(agent, settings)
    found += agent_changes(agent, then, settings)
    if content["configuration"].get("imported", {}) != sources_digests():
        found.append("--import names other files, or they have changed since")
    found += _plugin_changes(content["configuration"].get("plugins", {}), plugins())
    then = content["versions"]
    found += [
        f"{name} {then[name]} -> {now}" for name, now in versions().items() if then.get(name, now) != now
    ]
    if told := version_changes(content):
        found.append(f"its rows come from several versions: {', '.join(told)}")
    return found


def agent_changes(agent: str, then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """A line for each thing in which an agent's settings (`agent_settings`) differ: its source, a file, or
    anything else.
    """
    found = []
    if then.get("source") != now.get("source"):
        found.append(f"the source of the agent {agent} has changed since")
    for part, how in (("imports", "imports"), ("reads", "reads"), ("files", "is given")):
        before, here = then.get(part, {}), now.get(part, {})
        for name in {**before, **here}:
            if name not in before:
                found.append(f"the agent {agent} {how} {name}, of which manifest.json says nothing")
            elif name not in here:
                found.append(f"the agent {agent} no longer {how} {name}")
            elif before[name] != here[name]:
                found.append(f"{name}, which the agent {agent} {how}, has changed since")
    known = ("source", "imports", "reads", "files")
    rest = [{key: value for key, value in told.items() if key not in known} for told in (then, now)]
    if rest[0] != rest[1]:
        found.append(f"the agent {agent} has other settings now")
    return found


def _plugin_changes(then: Mapping[str, Mapping[str, str]], now: Mapping[str, Mapping[str, str]]) -> list[str]:
    """A line for each package with plug-ins that only one side has, or that has changed."""
    found = []
    for name in dict.fromkeys([*then, *now]):
        if name not in now:
            found.append(f"the package {name}, which offers plug-ins, is not installed here")
        elif name not in then:
            found.append(f"the package {name}, which offers plug-ins, is installed here only")
        elif then[name] != now[name]:
            files = [key for key in {**then[name], **now[name]} if then[name].get(key) != now[name].get(key)]
            found.append(f"the package {name}, which offers plug-ins, has changed since: {listed(files)}")
    return found
