"""Whether a scenario's episodes can be set up, found out before anything is run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rudc.errors import RudcError, ScenarioError
from rudc.network.network import load_network
from rudc.scenario.library import shown
from rudc.scenario.loader import load_scenario
from rudc.world.fitting import misfits

if TYPE_CHECKING:
    from rudc.scenario.model import Scalar, Scenario

TRIED = 16
"""points of a sweep that are set up at most: `rudc scenario validate` answers at once"""


def validated(path: Path, seed: int = 0) -> tuple[Scenario | None, list[str]]:
    """A file's scenario, None where it cannot be read, and all that is wrong with it, a line each."""
    try:
        scenario = load_scenario(path, fit=misfits)
    except ScenarioError as error:
        return None, str(error).splitlines()
    return scenario, [f"{shown(path)}: {problem}" for problem in try_out(scenario, seed)]


def try_out(scenario: Scenario, seed: int = 0) -> list[str]:
    """What goes wrong when the scenario's episode of this seed is set up in a world, for each of the points
    of its sweep that `tried_points` chooses."""
    from rudc.world.world import World  # loads libsumo, which checking alone does not need

    found: dict[str, str] = {}
    for swept in tried_points(scenario):
        try:
            point = scenario.varied(swept) if swept else scenario
            with World(load_network(point.network, point.junction)) as world:
                world.reset(point.plan(seed))
        except RudcError as error:
            values = ", ".join(f"{key}={value}" for key, value in swept.items())
            found.setdefault(str(error), f"with {values}: " if values else "")
    return [where + text for text, where in found.items()]


def tried_points(scenario: Scenario) -> list[dict[str, Scalar]]:
    """The points of a sweep that `try_out` sets up: all, or `TRIED` at most of a larger sweep, the same ones
    each time. They are a Latin hypercube: each key's values come up about equally often, its first and its
    last among them, and all of them where the key has no more than `TRIED`.
    """
    if math.prod(map(len, scenario.sweep.values())) <= TRIED:
        return scenario.points()
    rng = np.random.default_rng(0)
    columns = [
        [values[k] for k in rng.permutation(np.linspace(0, len(values) - 1, TRIED).round().astype(int))]
        for values in scenario.sweep.values()
    ]
    rows = dict.fromkeys(zip(*columns, strict=True))
    return [dict(zip(scenario.sweep, row, strict=True)) for row in rows]
