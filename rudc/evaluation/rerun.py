"""An episode of a sweep run again: found by its row, set up from the sweep's manifest, checked against it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from rudc.agents.registry import agent_settings
from rudc.errors import SweepError
from rudc.evaluation.columns import COLUMNS, TIMING
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.manifest import read_manifest, versions
from rudc.evaluation.record import EpisodeRecord, as_text
from rudc.evaluation.tasks import Task
from rudc.hints import did_you_mean
from rudc.scenario.model import Scenario

HOW = "give SCENARIO:AGENT:SEED, or the number of a row of episodes.csv, from 1"


class Rerun(NamedTuple):
    """An episode of a sweep, ready to be run again."""

    number: int
    """of its row, from 1"""
    row: Mapping[str, str]
    task: Task
    changes: tuple[str, ...]
    """what is another than when the sweep ran"""


def find_episode(folder: Path, which: str) -> Rerun:
    """The episode that `SCENARIO:AGENT:SEED` or the number of a row stands for. Raises SweepError."""
    content = read_manifest(folder)
    rows, parameters = read_sweep(folder)
    number = _number(rows, parameters, which, folder)
    row = rows[number - 1]
    task, changes = _task(content, row, parameters, folder)
    return Rerun(number, row, task, changes)


def differences(row: Mapping[str, str], record: EpisodeRecord) -> list[str]:
    """Columns in which an episode came out otherwise than its row says; timing is left out, and so is what
    the row does not say.
    """
    pairs = ((name, row[name], record.text(name)) for name in COLUMNS if name not in TIMING)
    return [f"{name}: {was or 'nothing'} then, {now or 'nothing'} now"
            for name, was, now in pairs if was != now and (was or name in ("error", "fault"))]  # fmt: skip


def _number(rows: Sequence[Mapping[str, str]], parameters: Sequence[str], which: str, folder: Path) -> int:
    """Of the row that is meant."""
    if which.isdigit():
        if not 1 <= int(which) <= len(rows):
            raise SweepError(f"{folder} has rows 1 to {len(rows)}, not {which}")
        return int(which)
    scenario, _, rest = which.partition(":")
    agent, _, seed = rest.rpartition(":")
    if not (scenario and agent and seed.isdigit()):
        raise SweepError(f"which episode is {which!r}? {HOW}")
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
            there = did_you_mean(value, known) or f"; there are: {', '.join(known[:12])}"
            raise SweepError(f"{folder} has no episode of {name} {value!r}{there}")
    raise SweepError(f"{folder} has no episode {which}")


def _task(
    content: Mapping[str, Any], row: Mapping[str, str], parameters: Sequence[str], folder: Path
) -> tuple[Task, tuple[str, ...]]:
    known, name = content["configuration"], row["scenario"]
    said = known["scenarios"].get(name)
    if said is None:
        raise SweepError(f"{folder / 'manifest.json'} says nothing of the scenario {name!r}")
    try:
        family = Scenario.model_validate(said["values"])
    except ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(map(str, problem["loc"]))
        raise SweepError(
            f"the scenario {name!r} of {folder} cannot be read any more: {place}: {problem['msg']}; "
            f"the sweep ran with rudc {content['versions'].get('code', 'of another version')}"
        ) from None
    wanted = [row[parameter] for parameter in parameters]
    for swept, scenario in family.grid():
        if [as_text(swept.get(parameter)) for parameter in parameters] == wanted:
            task = Task(scenario, swept, row["agent"], int(row["seed"]))
            return task, tuple(_changes(content, family, said["digest"], row["agent"]))
    raise SweepError(f"the scenario {name!r} of {folder} is not swept over {', '.join(wanted)}")


def _changes(content: Mapping[str, Any], family: Scenario, digest: str, agent: str) -> list[str]:
    """What is another now: scenario, agent, versions."""
    found = []
    if family.digest != digest:
        found.append("the scenario, or a file that it names, means something else now")
    settings = json.loads(json.dumps(agent_settings(agent)))
    if settings != content["configuration"].get("agents", {}).get(agent, settings):
        found.append(f"the agent {agent} has other settings now")
    then = content["versions"]
    found += [
        f"{name} {then[name]} -> {now}" for name, now in versions().items() if then.get(name, now) != now
    ]
    return found
