"""What a sweep's folder says of its scenarios and agents: to run episodes of it again, or to finish it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rudc.agents.own import parse_own
from rudc.agents.own_files import digest
from rudc.agents.registry import agent_settings
from rudc.agents.variation import split
from rudc.errors import InputError, SweepError
from rudc.evaluation.manifest import read_manifest
from rudc.evaluation.own_networks import FOLDER, kept_scenario
from rudc.evaluation.tasks import SweepPlan
from rudc.hints import listed
from rudc.scenario.dotted import dotted
from rudc.scenario.model import Scenario
from rudc.scenario.networks import is_network_path
from rudc.scenario.problems import describe


def kept_plan(folder: Path, episodes: int | None = None, seed: int | None = None) -> SweepPlan:
    """The plan of the sweep that a folder holds, with other episodes or another first seed if they are given.

    Networks are the folder's own copies, but for those that are swept: rows name these by their paths. Raises
    SweepError where it is no sweep's folder, or what it names cannot be read any more.
    """
    content = read_manifest(folder)
    told = content["configuration"]
    if "search" in told:
        raise SweepError(f"{folder} is the folder of a search: give the command of `rudc search` again")
    scenarios = KeptScenarios(folder, content)
    for agent, said in told["agents"].items():  # all, before any is imported
        _refuse_other_file(agent, said)
    for agent in told["agents"]:
        try:
            kept_settings(agent)
        except InputError as error:
            raise SweepError(f"{error}; {_ran_with(content)}") from error
    return SweepPlan(
        tuple(scenarios.planned(name) for name in told["scenarios"]),
        tuple(told["agents"]),
        told["episodes"] if episodes is None else episodes,
        told["seed"] if seed is None else seed,
    )


def with_more(plan: SweepPlan, scenarios: Sequence[Scenario], agents: Sequence[str]) -> SweepPlan:
    """The plan with further scenarios and agents; a scenario of a name that it has takes that one's place."""
    by_name = {scenario.name: scenario for scenario in (*plan.scenarios, *scenarios)}
    return replace(plan, scenarios=(*by_name.values(),), agents=(*dict.fromkeys([*plan.agents, *agents]),))


class KeptScenarios:
    """The scenarios of a sweep's manifest."""

    def __init__(self, folder: Path, content: Mapping[str, Any]) -> None:
        self._folder = folder
        self._content = content

    def read(self, name: str) -> Scenario:
        """A scenario, on the folder's own copies of its networks, the swept ones included. Raises SweepError
        where the manifest does not have it, or it cannot be read any more.
        """
        said = self._content["configuration"]["scenarios"].get(name)
        if said is None:
            raise SweepError(f"{self._folder / 'manifest.json'} says nothing of the scenario {name!r}")
        unread = self._unread  # before the scenario is read: agents' files may register its events
        try:
            family = kept_scenario(said["values"], said["digest"], self._folder)
        except ValidationError as error:
            raise self._unreadable(name, error, unread) from None
        return family.read_from(family.path, said.get("given"))

    def planned(self, name: str) -> Scenario:
        """As `read`, with swept networks as the sweep was given them. Raises SweepError as `read` does."""
        values = self._content["configuration"]["scenarios"][name]["values"]
        if not any(map(is_network_path, values.get("sweep", {}).get("network", ()))):
            return self.read(name)
        try:
            return Scenario.model_validate(values).read_from(None, self.read(name).given)
        except ValidationError as error:
            lost = self._unreadable(name, error, self._unread)
            raise SweepError(
                f"{lost}. Rows name networks that are swept by their paths: put them back (copies are in "
                f"{self._folder / FOLDER})"
            ) from None

    @cached_property
    def _unread(self) -> list[str]:
        """Why agents of the sweep cannot be found any more. Looking for them imports their files."""
        found = []
        for agent in self._content["configuration"]["agents"]:
            try:
                kept_settings(agent)
            except InputError as error:
                found.append(f"; {error}")
        return found

    def _unreadable(self, name: str, error: ValidationError, unread: list[str]) -> SweepError:
        configuration = self._content["configuration"]
        problem = describe(error, Scenario, configuration["scenarios"][name]["values"])[0]
        return SweepError(
            f"the scenario {name!r} of {self._folder} cannot be read any more: "
            f"{dotted(problem.path)}: {problem.text}; {_ran_with(self._content)}{''.join(unread)}"
        )


def _refuse_other_file(agent: str, said: Mapping[str, Any]) -> None:
    """Raise SweepError if an agent's file is not among those that it was made of, before it is imported:
    it may be a stranger's, of the same name in another folder.
    """
    own = parse_own(agent)
    if own is None or not own[0].source.endswith(".py"):
        return
    path = Path(own[0].source).expanduser()
    if path.is_file() and digest(path) not in {said.get("source"), *said.get("imports", {}).values()}:
        raise SweepError(
            f"{path} is not the file that the sweep's agent {agent} was made of: it has changed since, or is "
            "another of that name (paths are relative to the folder in which the sweep was started). Rows of "
            "old and new code would mix: put it back, give the command there, or give another --out"
        )


def _ran_with(content: Mapping[str, Any]) -> str:
    """With which code the sweep of a manifest ran, in words."""
    configuration = content["configuration"]
    imported, offered = configuration.get("imported"), configuration.get("plugins")
    return (
        f"the sweep ran with rudc {content['versions'].get('code', 'of another version')}"
        f"{f' and --import {listed(list(imported))}' if imported else ''}"
        f"{f' and the plug-ins of {listed(list(offered))}' if offered else ''}"
    )


def kept_settings(agent: str) -> dict[str, Any]:
    """`agent_settings`; where the path in an agent's name is not there, the error says what it is relative
    to.
    """
    try:
        return agent_settings(agent)
    except InputError as error:
        if not ("/" in agent or ".py" in agent) or os.path.isabs(agent) or _is_there(agent):
            raise
        raise SweepError(
            f"{error}; {agent} is named relative to the folder in which the sweep was started: give the "
            "command there"
        ) from error


def _is_there(agent: str) -> bool:
    """Whether the file or folder that an agent's name begins with is there, whatever is in it."""
    if own := parse_own(agent):
        return os.path.exists(os.path.expanduser(own[0].source))
    base = split(agent)[0]
    return any(map(os.path.exists, (agent, base, base.rpartition("+")[0])))
