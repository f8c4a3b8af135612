"""What a search varies: the numbers that a scenario draws once an episode, and those it is told to vary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from scipy.special import ndtr

from rudc.arrays import Array
from rudc.errors import InputError
from rudc.scenario.distributions import Constant, Distribution, Normal, Uniform
from rudc.scenario.model import Scenario
from rudc.scenario.numbers_in import numbers_in, with_numbers

Searched = Uniform | Normal


@dataclass(frozen=True)
class Space:
    """Searched keys and their distributions."""

    axes: Mapping[str, Searched]
    """dotted key -> distribution"""

    def values(self, z: Array) -> dict[str, float]:
        """Dotted key -> value of one point z (d,), standard normal as declared."""
        return {
            key: axis.quantile(float(ndtr(at))) for (key, axis), at in zip(self.axes.items(), z, strict=True)
        }

    def fixed(self, scenario: Scenario, values: Mapping[str, float]) -> Scenario:
        """The scenario with the values of one point. What is drawn may break a rule between two numbers
        (`above` and `below` of a trigger), as in any other episode.
        """
        found = with_numbers(
            scenario, lambda key, number: Constant(value=values[key]) if key in values else number
        )
        vars(found).pop("digest", None)  # cached, and of the scenario given
        return found


def space_of(scenario: Scenario, over: Mapping[str, object]) -> Space:
    """All keys of a scenario that have a uniform or normal distribution and are drawn once an episode. Keys
    that are drawn anew for each vehicle are not searched, unless `over` (dotted keys to be searched in any
    case) names them. Choices are drawn by the seed. Raises InputError if no key is left, or if a key of
    `over` cannot be searched.
    """
    if scenario.sweep:
        raise InputError(
            f"{scenario.name} sweeps {', '.join(scenario.sweep)}, and a search takes one scenario: "
            f"--over '{next(iter(scenario.sweep))}=[low, high]' searches over it"
        )
    kept = {id(value) for value in _distributions_left(scenario.plan(0))}
    axes = {
        key: value for key, value in numbers_in(scenario)
        if isinstance(value, Searched) and value.support[0] < value.support[1]
        and (key in over or id(value) not in kept)
    }  # fmt: skip
    if idle := [key for key in over if key not in axes]:
        raise InputError(f"--over {idle[0]}: not a number with a low and a greater high to search between")
    if not axes:
        raise InputError(
            f"{scenario.name} draws no number that could be searched over; "
            "--over 'KEY=[low, high]' says which (`rudc scenario keys`)"
        )
    return Space(axes)


def _distributions_left(value: Any) -> Iterator[Distribution]:
    """Those of an episode's plan that are still to be drawn."""
    if isinstance(value, Distribution):
        yield value
    elif is_dataclass(value):
        for field in fields(value):
            if field.name != "source":
                yield from _distributions_left(getattr(value, field.name))
