"""Names of agents. A name is that of a driver (rudc/agents/drivers.py), the place of a class
(`FILE.py:Class`), or a checkpoint's folder. After it may come `+FILTER`, and then settings as in
rudc/agents/variation.py.

Modules that only learnt agents need are imported when one is made.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from rudc.agents.base import Agent
from rudc.agents.checkpoint import (
    DESCRIPTION,
    find_checkpoint,
    learnt_settings,
    learnt_summary,
    shipped_checkpoints,
)
from rudc.agents.correction import make_correction
from rudc.agents.drivers import (
    driver_names,
    driver_settings,
    driver_summary,
    find_own,
    is_driver,
    make_driver,
)
from rudc.agents.filtered import FilteredAgent, filters
from rudc.agents.named import refuse_object
from rudc.agents.outlook import OutlookSettings, with_outlook
from rudc.agents.variation import (
    Changes,
    filter_behind,
    outlook_changes,
    outlook_with,
    parse,
    split,
)
from rudc.errors import AgentError
from rudc.hints import there_are
from rudc.imports import leaving_out
from rudc.learning.algorithms import ALGORITHMS, Algorithm
from rudc.learning.parameters import fingerprint
from rudc.safety.residual import shipped_predictor

OUTLOOKS = {"planner": OutlookSettings(course=True, approach=False)}
"""name of a driver -> outlook that it has by default; the planner needs no `approach`, it checks gaps
itself"""


def agent_names() -> tuple[str, ...]:
    """Every name that `make_agent` knows. It also takes folders of learnt agents and places of classes,
    with or without filters.
    """
    drivers = driver_names()
    filtered = (f"{name}+{suffix}" for name in drivers if name != "sumo" for suffix in filters())
    return (*drivers, *filtered, *shipped_checkpoints())


def make_agent(name: str) -> Agent:
    """A new agent of that name, place or checkpoint's folder. Raises AgentError, with a suggestion, if there
    is none.
    """
    refuse_object(name)
    base, suffix, changes = _parts(name)
    shown, others = outlook_changes(changes)
    if is_driver(base):
        driver, outlook = make_driver(base), OUTLOOKS.get(base, OutlookSettings())
    else:
        from rudc.agents.learned import load_learned

        driver = load_learned(name, _folder(base), {} if suffix else others)
        outlook = driver.config.outlook
    if suffix:
        correction = make_correction(filter_behind(suffix, others), {})
        assert correction is not None
        driver = FilteredAgent(driver, name, correction)
    return with_outlook(driver, name, outlook_with(outlook, shown))


def name_of(folder: Path) -> str:
    """The name by which `--agent` takes the agent in a training's folder: its path, written so that it is not
    another agent's name.
    """
    name = str(folder)
    other = name in agent_names() or ":" in name  # a class's place, or settings, stand behind a colon
    return f"./{name}" if other and not folder.is_absolute() else name


def agent_summary(name: str) -> str:
    """What an agent is and does, in a few sentences."""
    base, suffix, _ = _parts(name)
    summary = driver_summary(base) if is_driver(base) else learnt_summary(_folder(base))
    return f"{summary} {filters()[suffix]}" if suffix else summary


def agent_settings(name: str) -> dict[str, Any]:
    """Everything besides its name that decides what an agent does; it can be written as JSON."""
    base, suffix, changes = _parts(name)
    shown, others = outlook_changes(changes)
    if is_driver(base):
        outlook = outlook_with(OUTLOOKS.get(base, OutlookSettings()), shown)
        driver = {**driver_settings(base), "outlook": outlook.model_dump(mode="json")}
    else:
        driver = learnt_settings(_folder(base), shown if suffix else changes)
    if not suffix:
        return driver
    correction = filter_behind(suffix, others).model_dump(mode="json")
    residual = fingerprint(shipped_predictor().arrays) if correction.get("residual") else None
    own = driver.get("correction", {"kind": "none"})
    return {
        **driver,
        **({"own_correction": own} if own["kind"] != "none" else {}),
        "correction": correction,
        "predictor": residual,
    }


def _folder(name: str) -> Path:
    folder = find_checkpoint(name)
    if folder is None:
        raise AgentError(f"no checkpoint in {name}")
    return folder


def _parts(name: str) -> tuple[str, str, Changes]:
    """The parts of an agent's name: driver or folder, suffix of the filter (empty for none), and settings."""
    if not name.strip():
        raise AgentError("the name of an agent is empty; `rudc agent list` lists those that there are")
    if find_checkpoint(name) is not None:
        base, suffix, text = name, "", ""
    elif _lacks_value(name):
        raise AgentError(f"agent {name!r}: KEY=VALUE expected after the colon")
    elif own := find_own(name):
        base, (behind, text) = own[0], split(own[1])
        suffix = _suffix(behind, name)
    else:
        _refuse_half_a_place(name)
        whole, text = split(name)
        base, suffix = _base(whole)
    if not text:
        return base, suffix, {}
    if base == "sumo":
        raise AgentError(f"agent {name!r}: SUMO itself drives, and nothing that {text!r} could set")
    if is_driver(base) and not suffix and outlook_changes(parse(text))[1]:
        raise AgentError(
            f"{base!r} has no filter, and nothing that {text!r} could set; there are "
            f"{', '.join(f'outlook.{key}' for key in OutlookSettings.model_fields)}; arguments of a class of "
            "your own stand in brackets: FILE.py:Class(speed=3)"
        )
    return base, suffix, parse(text)


def _refuse_half_a_place(name: str) -> None:
    """Raise AgentError for `agents/mine:Class` and `pkg/inner:Class` where `agents/mine.py:Class` or
    `pkg.inner:Class` would be an agent's place.
    """
    source, _, rest = name.partition(":")
    if not re.match(r"[A-Za-z_]\w*($|[(+:])", rest) or find_checkpoint(source) is not None:
        return
    file, package = Path(f"{source}.py"), Path(source)
    inner = file.is_file() and (file.parent / "__init__.py").is_file()
    if (inner or (package / "__init__.py").is_file()) and not package.is_absolute():
        raise AgentError(f"no agent {name!r}; did you mean {'.'.join(package.parts)}:{rest}?")
    if file.is_file():
        raise AgentError(f"no agent {name!r}; did you mean {file}:{rest}?")


def _lacks_value(name: str) -> bool:
    """Whether an agent's name is followed by a colon, but not by `KEY=VALUE`."""
    before, colon, text = name.rpartition(":")
    if not colon or "=" in text:
        return False
    base = before.partition("+")[0]
    if base in driver_names() or find_checkpoint(base) is not None:
        return True
    own = find_own(name)
    return own is not None and own[1].endswith(f":{text}")


def _suffix(behind: str, name: str) -> str:
    """The suffix, such as `ttcbf`, in a text like `+ttcbf`; empty for none. `name`: the agent, for messages.
    Raises AgentError if there is no such filter.
    """
    suffix = behind.removeprefix("+")
    if behind in ("", *(f"+{known}" for known in filters())):
        return suffix
    raise AgentError(f"agent {name}: no filter {suffix!r}{there_are(suffix, filters())}")


def _base(name: str) -> tuple[str, str]:
    """The parts of a name without settings: driver or folder, and suffix of the filter (empty for none)."""
    if name.partition("+")[0] not in driver_names():
        if find_checkpoint(name) is not None:
            return name, ""
        base, _, suffix = name.rpartition("+")
        if suffix in filters() and find_checkpoint(base) is not None:
            return base, suffix
    base, _, suffix = _checked(name).partition("+")
    return base, suffix


def _checked(name: str) -> str:
    known = agent_names()
    if name in known:
        return name
    base, _, suffix = name.partition("+")
    if base == "sumo" and suffix:
        raise AgentError(f"no agent {name!r}: no filter can be put behind `sumo`, which SUMO itself drives")
    if suffix and base in known and not any(f"{base}+{kind}" in known for kind in filters()):
        _suffix(f"+{suffix}", name)
    if os.path.isdir(name):
        raise AgentError(f"no agent in {name}: it holds no {DESCRIPTION}")
    if name.endswith((".py", ".py:")):
        file = name.removesuffix(":")
        raise AgentError(f"{file} is a file; name the class in it, too: {file}:Class")
    if algorithm := _algorithm(base):
        raise AgentError(
            f"{base!r} is an algorithm, of which no trained agent is shipped. {algorithm.summary} "
            f"Train one, rudc train {base} --out DIR, and give DIR"
        )
    if name.endswith(")") and name.partition("(")[0] in known:
        raise AgentError(
            f"agent {name!r}: what is known by a name takes no arguments; say where its class is instead: "
            "FILE.py:Class(speed=3) or package.module:Class(speed=3)"
        )
    raise AgentError(f"no agent {name!r}{there_are(name, known)}")


def _algorithm(name: str) -> Algorithm | None:
    """The algorithm of that name; None if there is none that can be imported."""
    with leaving_out(lambda _: None):
        return ALGORITHMS.get(name)
