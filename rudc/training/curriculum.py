"""Which scenario each training episode is drawn from, and which held-out episodes are of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rudc.errors import InputError
from rudc.evaluation.tasks import refuse_twice
from rudc.hints import listed
from rudc.network.network import Network, load_network
from rudc.scenario import load_scenario
from rudc.scenario.model import Scenario
from rudc.scenario.plan import EpisodePlan
from rudc.training.config import Curriculum

FIRST_SEED, LAST_SEED = 1_000_000, 2**31 - 1
"""seeds of training episodes are drawn between them; evaluations use lower ones"""
HELD_OUT_SEED = 900_000
"""first seed of the evaluations during training"""


class Mixture(NamedTuple):
    """Scenarios, and the chance of each."""

    scenarios: tuple[Scenario, ...]
    chances: tuple[float, ...]
    """sum to 1"""

    def draw(self, rng: np.random.Generator) -> EpisodePlan:
        """The next episode."""
        scenario = self.scenarios[int(rng.choice(len(self.scenarios), p=self.chances))]
        return scenario.plan(int(rng.integers(FIRST_SEED, LAST_SEED)))


def held_out(sources: Sequence[str]) -> dict[str, Scenario]:
    """The scenarios of held-out episodes, by names or files. Raises InputError for one that sweeps, and for
    two of one name.
    """
    found = [load_scenario(source) for source in sources]
    for scenario in found:
        if scenario.sweep:
            raise InputError(
                f"{scenario.name} sweeps {', '.join(scenario.sweep)}, and held-out episodes are of one "
                "value: name a scenario for each value, which extends it and sets the value"
            )
    refuse_twice("held-out scenario", [scenario.name for scenario in found])
    return dict(zip(sources, found, strict=True))


def make_mixture(source: str, curriculum: Curriculum | None) -> Mixture:
    """The scenario as it is, or varied as the curriculum says: one variant for each arm and turn. Each value
    that the scenario sweeps is as likely as the others. Raises InputError.
    """
    scenario = load_scenario(source)
    if curriculum is None:
        variants = [variant for _, variant in scenario.grid()]
        return Mixture(tuple(variants), (1 / len(variants),) * len(variants))
    if elsewhere := [key for key in scenario.sweep if key in ("network", "junction")]:
        raise InputError(
            f"{scenario.name} sweeps {listed(elsewhere)}, and a curriculum has the arms of one network: "
            "set training.curriculum=null, or train on a scenario of one network"
        )
    network = load_network(scenario.network, scenario.junction)
    drawn = {
        "traffic.density": {"uniform": list(curriculum.density)},
        "ego.distance": {"uniform": list(curriculum.distance)},
    }
    shares = _shares(network, curriculum)
    total = sum(shares.values())
    if total == 0:
        raise InputError(f"the curriculum leaves nothing to drive on network {network.name!r}")
    variants, chances = list[Scenario](), list[float]()
    for (arm, turn), share in shares.items():
        varied = load_scenario(source, {**drawn, "ego.route": {"from": arm, "turn": turn}})
        points = [variant for _, variant in varied.grid()]
        variants += points
        chances += [share / total / len(points)] * len(points)
    return Mixture(tuple(variants), tuple(chances))


def _shares(network: Network, curriculum: Curriculum) -> dict[tuple[str, str], float]:
    """Share of episodes for each (arm, turn) that the network has."""
    turns: dict[str, list[str]] = {}
    for movement in network.movements:
        if movement.turn in ("left", "straight", "right"):
            known = turns.setdefault(movement.origin, [])
            if movement.turn not in known:
                known.append(movement.turn)
    majors = {arm.name for arm in network.arms if arm.major}
    shares = {}
    for arm, known in turns.items():
        alike = sum((other in majors) == (arm in majors) for other in turns)
        weight = (1 - curriculum.minor_share if arm in majors else curriculum.minor_share) / alike
        for turn in known:
            left = "left" in known
            if turn == "left":
                part = curriculum.left_share if len(known) > 1 else 1.0
            else:
                part = (1 - curriculum.left_share if left else 1.0) / (len(known) - left)
            shares[arm, turn] = weight * part
    return {key: share for key, share in shares.items() if share > 0}
