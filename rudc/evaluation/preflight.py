"""Whether scenarios fit their networks, found out before anything is run.

A scenario file is checked by its own floor; whether its arms, lanes and turns exist only the network knows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.errors import InputError, RudcError, ScenarioError
from rudc.network.network import Network, load_network
from rudc.world.spawn import draw_route

if TYPE_CHECKING:
    from rudc.scenario.model import Scenario


def check_scenarios(scenarios: Iterable[Scenario], seed: int = 0) -> None:
    """Raise ScenarioError with a line for everything in which a scenario does not fit its network."""
    problems = [
        f"{_label(family, swept)}: {problem}"
        for family in scenarios
        for swept, scenario in family.grid()
        for problem in misfits(scenario, seed)
    ]
    if problems:
        raise ScenarioError("\n".join(dict.fromkeys(problems)))


def misfits(scenario: Scenario, seed: int = 0) -> list[str]:
    """In what the scenario does not fit its network; empty when it does."""
    try:
        network = load_network(scenario.network, scenario.junction)
        network.refuse_lights()
    except InputError as error:
        return [str(error)]
    found = []
    for path, check in _checks(scenario, network, seed):
        try:
            check()
        except InputError as error:
            found.append(f"{path}: {error}")
    return found


def try_out(scenario: Scenario, seed: int = 0) -> list[str]:
    """What goes wrong when the scenario's episode of this seed is set up in a world, for each swept value."""
    from rudc.world.world import World  # loads libsumo, which checking alone does not need

    found = []
    for swept, point in scenario.grid():
        problems = misfits(point, seed)
        if not problems:
            try:
                with World(load_network(point.network, point.junction)) as world:
                    world.reset(point.plan(seed))
            except RudcError as error:
                problems = [str(error)]
        found += [f"{_label(scenario, swept)}: {problem}" for problem in problems]
    return found


def _checks(scenario: Scenario, network: Network, seed: int) -> Iterator[tuple[str, Any]]:
    """(key path, function that raises InputError if what stands there does not fit)."""
    plan = scenario.plan(seed)
    yield "ego.route", lambda: draw_route(network, plan.ego, np.random.default_rng(seed))
    for i, event in enumerate(scenario.events):
        parts: dict[str, Any] = {"": event}
        for name in ("vehicles", "boxes"):
            parts |= {f".{name}[{k}]": part for k, part in enumerate(getattr(event, name, None) or ())}
        for suffix, part in parts.items():
            where = f"events[{i}]{suffix}"
            if getattr(part, "arm", None) is not None:
                yield f"{where}.arm", lambda part=part: network.arm(part.arm)
            if getattr(part, "lane", None) is not None:
                yield f"{where}.lane", lambda part=part: network.place_on_lane(part.lane, part.at.mean)


def _label(scenario: Scenario, swept: dict[str, Any]) -> str:
    values = ", ".join(f"{key}={value}" for key, value in swept.items())
    return f"{scenario.name} ({values})" if values else scenario.name
