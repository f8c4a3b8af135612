"""The reference pages, as Markdown: commands, scenario files, scenarios, agents, metrics, settings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, get_args, get_origin

import typer
from pydantic import BaseModel

from rudc.agents.config import AgentConfig
from rudc.agents.correction import SlackSettings, known_corrections
from rudc.agents.listing import entries
from rudc.agents.outlook import OutlookSettings
from rudc.cli.commands import app
from rudc.env.action import ACTIONS
from rudc.evaluation.columns import COLUMNS, DECISION_MS, METRICS, TIMING
from rudc.kinds import class_of
from rudc.learning.algorithms import ALGORITHMS
from rudc.learning.config import LearnerConfig, NetworkConfig
from rudc.safety.barriers import BARRIERS
from rudc.safety.config import FilterConfig
from rudc.safety.rules import RULES
from rudc.scenario import Scenario, find_scenarios, shipped_scenarios
from rudc.scenario.keys import sections
from rudc.settings import Settings
from rudc.studies.catalogue import STUDIES
from rudc.training.config import Curriculum, TrainConfig, Training

MADE = "*This page is made from the code whenever the documentation is built.*\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; bars in cells are escaped outside code, lines become spaces."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(text) for text in line) + " |" for line in lines) + "\n"


def _cell(text: str) -> str:
    plain = " ".join(str(text).split()).replace("<", "&lt;")
    return "`".join(part if k % 2 else part.replace("|", "\\|") for k, part in enumerate(plain.split("`")))


def code(text: str) -> str:
    """Set as code; nothing stays nothing."""
    return f"`{text}`" if text else ""


# ---- commands


def commands() -> str:
    """Every command with its arguments and options."""
    parts = ["# Commands\n", MADE]
    parts.append(
        "`rudc --help` says the same in a terminal. Before a command may stand `--import FILE.py`: Python "
        "that registers agents, events and more. Exit status: 0 done, 1 the work failed, 2 the "
        "input was wrong, "
        "130 interrupted.\n"
    )
    for name, command in _commands(typer.main.get_command(app), "rudc"):
        parts += _command(name, command)
    return "\n".join(parts)


def _commands(group: Any, before: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{before} {name}")
        else:
            yield f"{before} {name}", command


def _command(name: str, command: Any) -> list[str]:
    usage = [p.metavar or p.name.upper() for p in command.params if _is_argument(p)]
    return [
        f"## {name}\n",
        f"```text\n{' '.join([name, *usage])} [OPTIONS]\n```\n",
        inspect.cleandoc(command.help or "") + "\n",
        table(["", "value", "default", "meaning"], map(_parameter, command.params)),
    ]


def _is_argument(parameter: Any) -> bool:
    return "Argument" in type(parameter).__name__


def _parameter(p: Any) -> list[str]:
    name = p.metavar or p.name.upper() if _is_argument(p) else ", ".join(p.opts)
    default = (
        "required" if p.required else "" if p.default is None or p.default is False else code(str(p.default))
    )
    value = "" if _is_argument(p) else p.metavar or _value(p.type_descriptor.annotation)
    return [code(name), code(value), default, p.help or ""]


def _value(annotation: Any) -> str:
    if annotation is bool:
        return ""
    if get_origin(annotation) is Literal:
        return "|".join(map(str, get_args(annotation)))
    return {int: "N", float: "NUMBER", str: "TEXT"}.get(annotation, "VALUE")


# ---- scenarios


def scenario_files() -> str:
    """Keys of scenario files with their units."""
    parts = [
        "# Scenario files\n", MADE,
        "Wherever a number stands, a distribution may: `{uniform: [low, high]}`, "
        "`{normal: {mean: m, std: s, low: l, high: h}}` or `{choice: [a, b]}`; "
        "`{choice: [...]}` may stand for some words, too. "
        "`[]` stands for a place in a list. "
        "`rudc scenario keys` prints the same, `rudc scenario schema` a JSON Schema for editors.\n",
    ]  # fmt: skip
    titles = {"scenario": "The file", "when": "Conditions: when"}
    for section in sections():
        parts.append(f"## {titles.get(section.name, f'Event: {section.name}')}\n\n{section.text}\n")
        rows = [[code(k.name), k.type, k.unit, code(k.default), k.text] for k in section.keys]
        parts.append(table(["key", "type", "unit", "default", "meaning"], rows))
    return "\n".join(parts)


def scenarios() -> str:
    """What is shipped, how it looks, and why it is out of distribution."""
    said = (
        "A moment of seed 1, driven by `planner`: the ego is yellow, others are blue, parts of an event are "
        "orange and have its number. `make gallery` shows what agents do in them; "
        "`rudc scenario show NAME` prints one.\n"
    )
    cards = [_scenario(scenario) for scenario in find_scenarios(list(shipped_scenarios()))]
    return "\n".join(
        ["# Shipped scenarios\n", MADE, said, '<div class="scenarios" markdown>\n', *cards, "</div>\n"]
    )


def _scenario(scenario: Scenario) -> str:
    why = scenario.out_of_distribution
    known = f"**Out of distribution:** {why}" if why else "*In distribution, or near it.*"
    lines = [
        f"## {code(scenario.name)} {{#{scenario.name}}}",
        f"![A moment of {scenario.name}](../figures/scenarios/{scenario.name}.webp){{loading=lazy}}",
        f"{scenario.description} {known}",
        f"Network {code(scenario.network)}" + (f"; events {_kinds(scenario)}" if scenario.events else ""),
    ]
    return '<div class="scenario" markdown>\n\n' + "\n\n".join(lines) + "\n\n</div>\n"


def _kinds(scenario: Any) -> str:
    return ", ".join(code(kind) for kind in dict.fromkeys(event.kind for event in scenario.events))


# ---- agents and metrics


def agents() -> str:
    """Every name that --agent takes, and every algorithm."""
    return "\n".join([
        "# Agents\n", MADE,
        "What `--agent` takes. `+ttcbf` or `+ecbf` behind a name puts a safety filter behind the agent; "
        "[settings](settings.md) follow a colon: `rudc-t:correction.d_safe=0.3`. A folder of a training and "
        "`FILE.py:Class(argument=value)` are names, too.\n",
        table(
            ["name", "in the paper", "status", "what it is"],
            [[code(e.name), e.paper, e.status, e.text] for e in entries()],
        ),
        "## Algorithms\n\nThese can be trained: `rudc train NAME --out DIR`, then `--agent DIR`.\n",
        table(["name", "what it is"], [[code(n), a.summary] for n, a in ALGORITHMS.items()]),
        "## Studies\n\nWhat `rudc study` takes.\n",
        table(
            ["name", "what it shows", "takes"],
            [[code(n), s.summary, s.options] for n, s in STUDIES.items()],
        ),
    ])  # fmt: skip


def metrics() -> str:
    """Metrics of tables and columns of episodes.csv."""
    measures = [
        [m.name.replace("_", "-"), m.text, m.unit, m.better or "", code(m.column) or ", ".join(m.outcomes)]
        for m in (*METRICS, DECISION_MS)
    ]
    columns = [
        [code(c.name), c.text, c.unit, c.better or "", {None: ""}.get(c.average, c.average or "")]
        for c in COLUMNS.values()
    ]
    return "\n".join([
        "# Metrics and columns\n", MADE, "## Metrics\n",
        "Rates have Wilson's 95 % intervals; means have Student's below 20 episodes, then a seeded "
        "bootstrap's, from 2,000 on those of the normal distribution. A mean of values that are all the same "
        "has no interval. `rudc table` prints the intervals of rates, with `--format markdown` or `csv` "
        "those of means, too. SR + FR + VR = 100 %.\n",
        table(["metric", "what it says", "unit", "better", "made of"], measures),
        "## Columns of episodes.csv\n",
        "Swept keys come after them. `rudc table --by COLUMN` groups by any of them, `--metrics COLUMN` "
        "shows the mean of those that have one: over *episodes*, over all *decisions*, or as the "
        "*share* of all "
        f"decisions. {', '.join(map(code, TIMING))} depend on the machine; all others do not.\n",
        table(["column", "what it says", "unit", "better", "mean over"], columns),
    ])  # fmt: skip


# ---- settings


def settings() -> str:
    """The tree of settings, section by section, and the presets."""
    parts = [
        "# Settings\n", MADE,
        "One tree, with the same dotted keys everywhere: `rudc train --set learner.n_step=1`, "
        "`config.json` and `agent.json`, and behind an agent's name: "
        "`rudc-t:correction.d_safe=0.3`. A setting "
        "that has no effect with the other settings is refused, with the reason. Defaults here are "
        "those of the "
        "classes; the [presets](#presets) set other values for some.\n",
    ]  # fmt: skip
    parts += _section("Agent", AgentConfig, "", leave=("correction", "outlook", "learner", "action"))
    for name, action in ACTIONS.items():
        parts += _section(f"action.kind: {name}", action, "action.")
    for name, kind in known_corrections().items():
        correction = class_of(kind)
        parts += _section(f"correction.kind: {name}", correction, "correction.", leave=("slack",))
        if issubclass(correction, FilterConfig):
            parts += _filter_parts()
    parts += _section("outlook", OutlookSettings, "outlook.")
    parts += _section("learner: all algorithms", LearnerConfig, "learner.", leave=("policy", "critic"))
    parts += _section("learner.policy, learner.critic", NetworkConfig, "learner.policy.")
    for config in dict.fromkeys(a.config for a in ALGORITHMS.values()):
        names = ", ".join(name for name, a in ALGORITHMS.items() if a.config is config)
        parts += _section(f"learner: {names}", config, "learner.", leave=tuple(LearnerConfig.model_fields))
    parts += _section("training", Training, "training.", leave=("curriculum",))
    parts += _section("training.curriculum", Curriculum, "training.curriculum.")
    return "\n".join([*parts, *_presets()])


def _filter_parts() -> Iterator[str]:
    """What a correction by barriers has besides: slack, rules, barriers."""
    yield from _section("correction.slack", SlackSettings, "correction.slack.", level=3)
    for name, rule in RULES.items():
        yield from _section(f"correction.rule: {name}", rule, f"correction.{name}_", level=3)
    for name, barrier in BARRIERS.items():
        prefix = f"{name}_" if barrier.prefix is None else barrier.prefix
        yield from _section(f"Barrier {name}", barrier.Settings, f"correction.{prefix}", level=3)


def _section(
    title: str, model: type[BaseModel], before: str, leave: Sequence[str] = (), level: int = 2
) -> Iterator[str]:
    """A table of a model's fields, those of `leave` left out; nothing if none are left."""
    rows = [
        [code(before + name), code(_default(field)), _choices(field) + (field.description or "")]
        for name, field in model.model_fields.items()
        if name not in leave and (name != "kind" or _choices(field))
    ]
    if rows:
        own = (inspect.getdoc(model) or "").split("\n\n")[0]
        yield f"{'#' * level} {title}\n\n{own if model.__doc__ else ''}\n"
        yield table(["key", "default", "meaning"], rows)


def _default(field: Any) -> str:
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return str(value.model_dump().get("kind", ""))
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _choices(field: Any) -> str:
    """The words that may stand there, if there are several."""
    words = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    return f"{' or '.join(map(code, words))}: " if len(words) > 1 else ""


def _presets() -> Iterator[str]:
    """Where the two presets differ, for the paper's agent."""
    ours, paper = (dict(_leaves(TrainConfig.of("rudc-t", preset=name))) for name in ("default", "paper"))
    rows = [
        [code(key), code(ours.get(key, "")), code(paper.get(key, ""))]
        for key in dict.fromkeys([*ours, *paper])
        if ours.get(key) != paper.get(key)
    ]
    yield "## Presets\n\n`rudc train rudc-t --configuration default` (ours) and `--configuration paper`: "
    yield "every value in which they differ.\n"
    yield table(["key", "default", "paper"], rows)


def _leaves(config: Settings) -> Iterator[tuple[str, str]]:
    def walk(tree: Mapping[str, Any], before: str) -> Iterator[tuple[str, str]]:
        for key, value in tree.items():
            if isinstance(value, Mapping):
                yield from walk(value, f"{before}{key}.")
            else:
                yield before + key, re.sub(r"^None$", "null", str(value))

    return walk(config.model_dump(), "")


PAGES: dict[str, Callable[[], str]] = {
    "commands": commands,
    "scenario_files": scenario_files,
    "scenarios": scenarios,
    "agents": agents,
    "metrics": metrics,
    "settings": settings,
}
"""name of each page -> what makes it"""
