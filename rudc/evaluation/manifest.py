"""`manifest.json`: what a sweep's rows were made from. No time stamps: the same inputs give the same file."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path, PurePath
from typing import Annotated, Any

from pydantic import BaseModel, Field, ValidationError

import rudc
from rudc.errors import SweepError
from rudc.evaluation.code import code_digest
from rudc.evaluation.tasks import SweepPlan
from rudc.hints import listed
from rudc.imports import plugins, sources_digests
from rudc.scenario.model import Scenario
from rudc.settings import problems

FORMAT = 2
"""version of a sweep's folder; 1 had `conditions.csv`, and counted interventions in another way"""
PACKAGES = (
    "libsumo", "sumolib", "numpy", "numba", "llvmlite", "scipy", "qpsolvers", "piqp", "gymnasium", "pydantic",
)  # fmt: skip
"""packages whose versions can change a row"""


class ScenarioEntry(BaseModel, frozen=True):
    """A scenario of a sweep."""

    digest: str
    """digest of all that an episode depends on, files that it names included"""
    values: dict[str, Any]
    """what its file says, defaults included"""
    given: dict[str, Any] | None = None
    """`Scenario.given`, if the scenario has a sweep"""


class Configuration(BaseModel, frozen=True):
    """Everything that decides the rows of a sweep."""

    scenarios: dict[str, ScenarioEntry]
    agents: dict[str, dict[str, Any]]
    """name -> settings, digests of weights and sources"""
    episodes: Annotated[int, Field(ge=1)]
    seed: Annotated[int, Field(ge=0)]
    imported: dict[str, dict[str, str]] = {}
    """what `--import` named -> digests of its file, and of the files beside it that it imports"""
    plugins: dict[str, dict[str, str]] = {}
    """name of an installed package that offers events, algorithms or barriers -> its version, and digests of
    the modules that it offers"""


class Manifest(BaseModel, frozen=True):
    """What `manifest.json` holds."""

    format: int
    """`FORMAT` of the version that wrote it"""
    configuration: Configuration
    versions: dict[str, str]
    """versions of everything that can change a row"""
    resumed_with: list[dict[str, str]] = []
    """versions that it went on with, where they had changed"""


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a sweep's folder. Raises SweepError where there is none, or an invalid one."""
    path = folder / "manifest.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        Manifest.model_validate(content, strict=True)
    except FileNotFoundError:
        reason = "no manifest.json in it" if folder.is_dir() else "no such folder"
    except ValidationError as error:
        reason = problems(error, "manifest.json")
    except (OSError, ValueError, RecursionError) as error:
        reason = f"manifest.json cannot be read ({error})"
    else:
        return content
    raise SweepError(f"{folder} is not the folder of a sweep: {reason}; give another")


def code_version() -> str:
    """`git describe` of the checkout that RUDC runs from, with a digest of the code where that differs from
    what is committed; or the version of the package, with a digest of the code for a checkout that git does
    not read (there is none, or the checkout is another user's).
    """
    root = Path(rudc.__file__).resolve().parent.parent
    git = shutil.which("git")
    if not (root / ".git").exists() or not (root / "pyproject.toml").exists():
        return rudc.__version__
    own = {name: value for name, value in os.environ.items() if name not in ("GIT_DIR", "GIT_WORK_TREE")}

    def said(*command: str) -> str:
        if git is None:
            return ""
        asked = [git, "-C", str(root), *command]
        return subprocess.run(asked, capture_output=True, text=True, check=False, env=own).stdout.strip()

    found = said("describe", "--always", "--dirty", "--tags")
    if not found:
        return f"{rudc.__version__}-{code_digest()}"
    changed = said("status", "--porcelain", "--", "rudc", "sumo_networks")
    return f"{found}-{code_digest()}" if changed else found


def agent_digest(name: str) -> str:
    """16 hexadecimal digits that change with anything that decides what an agent does, its weights included,
    but for the data files of `agent_reads`. Raises AgentError.
    """
    from rudc.agents.registry import agent_settings  # loads all that drives, which reading rows does not need

    return _digest(_but_reads(agent_settings(name)))


def agent_digests(content: Mapping[str, Any]) -> dict[str, str]:
    """The digests of all agents of a manifest, as they were when it was made."""
    agents = content["configuration"]["agents"]
    return {name: _digest(_but_reads(settings)) for name, settings in agents.items()}


def agent_algorithms(content: Mapping[str, Any]) -> dict[str, str]:
    """The algorithms by which agents of a manifest learnt, those with a filter behind them left out."""
    agents = content["configuration"]["agents"]
    return {
        name: settings["algorithm"]
        for name, settings in agents.items()
        if "algorithm" in settings and "predictor" not in settings
    }


def agent_reads(content: Mapping[str, Any], agent: str) -> dict[str, str]:
    """Name -> digest of each data file that an agent of a manifest read when it was made."""
    return content["configuration"]["agents"][agent].get("reads", {})


def _but_reads(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Which files an agent reads may depend on what was loaded in its process before; settings do not."""
    return {key: value for key, value in settings.items() if key != "reads"}


def _digest(settings: Any) -> str:
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def versions() -> dict[str, str]:
    """Versions of everything that can change a row, the processor's model included: on another
    processor libraries choose other instructions, and round differently.
    """
    found = {"rudc": rudc.__version__, "code": code_version(), "python": platform.python_version()}
    found["processor"] = processor()
    return found | {package: _installed(package) for package in PACKAGES}


@cache
def _installed(package: str) -> str:
    """Its version; looked up once, as it is imported once."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def processor() -> str:
    """Model of this machine's processor, or at least its kind."""
    with contextlib.suppress(OSError):
        said = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        if model := re.search(r"^model name\s*:\s*(\S.*)$", said, re.MULTILINE):
            return " ".join(model[1].split())
    return platform.processor() or platform.machine()


def configuration(plan: SweepPlan) -> dict[str, Any]:
    """Everything that decides the rows of a sweep."""
    from rudc.agents.registry import agent_settings

    return {
        "scenarios": {s.name: _told(s) for s in plan.scenarios},
        "agents": {name: agent_settings(name) for name in plan.agents},
        "episodes": plan.episodes,
        "seed": plan.seed,
        **({"imported": imported} if (imported := sources_digests()) else {}),
        **({"plugins": offered} if (offered := plugins()) else {}),
    }


def _told(scenario: Scenario) -> dict[str, Any]:
    given = {"given": scenario.given} if scenario.sweep else {}
    return {"digest": scenario.digest, "values": scenario.data(), **given}


def manifest(plan: SweepPlan) -> dict[str, Any]:
    """The content of `manifest.json`."""
    return {"format": FORMAT, "configuration": configuration(plan), "versions": versions()}


def as_json(content: Mapping[str, Any]) -> str:
    """The manifest as text, with one line for each scenario and agent."""
    return _in_lines(content, 3) + "\n"


def _in_lines(value: Any, levels: int, indent: str = "") -> str:
    """JSON with a line for each entry of the outer `levels` of mappings; what is deeper stays on its line."""
    if not levels or not value or not isinstance(value, Mapping):
        return json.dumps(value)
    inner = indent + "  "
    entries = (f"{inner}{json.dumps(key)}: {_in_lines(v, levels - 1, inner)}" for key, v in value.items())
    return "{\n" + ",\n".join(entries) + f"\n{indent}}}"


def resumed(old: Mapping[str, Any], new: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The manifest of a sweep that is resumed: the old one, with the episodes that are asked for now if they
    are more.

    Raises SweepError when the configuration is another one, saying what differs.
    """
    fresh, there = json.loads(json.dumps(new)), old.get("configuration", {})
    if there.get("episodes", math.inf) < fresh["configuration"]["episodes"]:
        there = {**there, "episodes": fresh["configuration"]["episodes"]}
    differences = list(_differences(_as_placed(there, fresh["configuration"]), fresh["configuration"]))
    if differences:
        shown = "\n".join(f"  {line}" for line in differences[:12])
        more = f"\n  and {len(differences) - 12} more" if len(differences) > 12 else ""
        what = "search" if "search" in there else "sweep"
        kinds = [kind for kind, key in _OF_AGENTS.items() if any(map(key.match, differences))]
        mixed = f"; rows of old and new {' and '.join(kinds)} would mix" if kinds else ""
        raise SweepError(
            f"{folder} holds another {what}; it differs in\n{shown}{more}\n"
            f"Give the same command as before to resume it, or another --out to start anew{mixed}"
        )
    return {**old, "configuration": there}


def grown(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest of a sweep, with the scenarios and agents that only `new`, another one, has."""
    there, here = old["configuration"], json.loads(json.dumps(new["configuration"]))
    both = {part: {**here[part], **there[part]} for part in ("scenarios", "agents")}
    return {**old, "configuration": {**there, **both}}


def _as_placed(there: Mapping[str, Any], here: Mapping[str, Any]) -> dict[str, Any]:
    """The configuration `there`, with the networks that `here` names in scenarios of the same digest: they
    are the same files, which lie elsewhere now. Swept networks stay, since rows name them.
    """
    scenarios = dict(there.get("scenarios", {}))
    for name, told in scenarios.items():
        now = here["scenarios"].get(name, {})
        if told.get("digest", "") == now.get("digest") and "network" in now["values"]:
            scenarios[name] = {**told, "values": {**told["values"], "network": now["values"]["network"]}}
    return {**there, "scenarios": scenarios}


def gone_on_with(content: Mapping[str, Any], now: dict[str, str]) -> dict[str, Any]:
    """The manifest of a sweep that goes on with the versions `now`; it names them if they have changed."""
    before = content.get("resumed_with", [])
    known = now in [content["versions"], *before]
    return dict(content) if known else {**content, "resumed_with": [*before, now]}


def version_changes(content: Mapping[str, Any]) -> list[str]:
    """What changed between the versions that a resumed sweep's rows were made with, from each to the next and
    the same change only once: `name old -> new`.
    """
    changes, before = dict[str, None](), dict(content["versions"])
    for versions in content.get("resumed_with", []):
        for name, now in versions.items():
            if before.setdefault(name, now) != now:
                changes[f"{name} {before[name]} -> {now}"] = None
        before |= versions
    return list(changes)


_OF_AGENTS = {
    "code": re.compile(r"agents\..*\.(source: |imports\.)|imported\.|plugins\."),
    "files": re.compile(r"agents\..*\.(files|reads)[.:]"),
}
"""what else may change an agent that is not RUDC's -> how a line of `_differences` about it begins"""
_OF_CONTENT = re.compile(r"scenarios\..*\.digest$")
"""the keys of `_differences` of a scenario's digest, which depends on the content of its networks, too"""
_NAMED = ("scenarios", "agents", "plugins")
"""the parts of a sweep's configuration that are mappings by name"""


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """One line for each thing that differs, in words; a scenario or agent that only one side has is one
    line."""
    yield from _on_one_side(old, new)
    old, new = _shared(old, new), _shared(new, old)
    flat_old, flat_new = dict(_flat(old)), dict(_flat(new))
    keys = [key for key in {**flat_old, **flat_new} if flat_old.get(key) != flat_new.get(key)]
    differ = [key for key in keys if not _OF_CONTENT.match(key)]
    told = [key for key in differ if not _only_moved(key, flat_old, flat_new)]
    content = [key for key in keys if _OF_CONTENT.match(key)]
    for key in told or ([] if content else differ):
        yield f"{key}: {flat_old.get(key, 'absent')} there, {flat_new.get(key, 'absent')} here"
    for key in () if told else content:
        values = key.removesuffix("digest") + "values."
        network = flat_new.get(values + "sweep.network") or flat_new[values + "network"]
        yield f"{key}: what is in {network} has changed"


def _only_moved(key: str, old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    """Whether a key names a scenario's network on both sides, by files of the same name in two folders."""
    if not key.endswith(".values.network") or key not in old or key not in new:
        return False
    return PurePath(json.loads(old[key])).name == PurePath(json.loads(new[key])).name


def _on_one_side(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """A line each for scenarios, agents and plug-ins that only one of two sweeps has."""
    for part in _NAMED:
        there, here = old.get(part, {}), new.get(part, {})
        for names, others, where in ((there, here, "there"), (here, there, "here")):
            if only := [name for name in names if name not in others]:
                yield f"{part}: {listed(only)} only {where}"


def _shared(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration, with only those scenarios, agents and plug-ins that the other has, too."""
    parts = {part: one.get(part, {}) for part in _NAMED}
    both = {
        part: {n: v for n, v in named.items() if n in other.get(part, {})} for part, named in parts.items()
    }
    return {**one, **both}


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Dotted key -> text of every leaf."""
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(value, Mapping):
        yield prefix, "{}"
    else:
        yield prefix, json.dumps(value)
