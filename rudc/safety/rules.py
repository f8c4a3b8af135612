"""Rules: how a row is made from h, h' and h'' (rudc/safety/rows.py has the formulas).

A rule is a class of settings with a method `weights`. To add one, write a class and an entry in `RULES`, or
call `register_rule`. The keys of a rule's settings begin with its name: `ttcbf_rate` is `rate` of `ttcbf`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from rudc.errors import InputError
from rudc.safety.rows import RowWeights, ecbf_weights, ttcbf_weights
from rudc.settings import within

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
RATE = "beyond, a row says nothing, or forbids everything"
Share = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]


class Rule(BaseModel):
    """Base of all rules."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @abstractmethod
    def weights(self, dt: float, *, road: bool) -> RowWeights:
        """The weights of h, h' and h'' in a row, for an action held for `dt` s, towards vehicles or road
        edges. `second` and `required` must be the same for both.
        """

    def most(self, *, road: bool) -> float:
        """The largest factor M >= 1 by which the weight of h may be multiplied or divided so that rows still
        keep h >= 0. 1 for a rule that does not define it: slack of kind `rate` then changes nothing.
        """
        return 1.0


class Ttcbf(Rule):
    """Truncated Taylor control barrier function."""

    rate: Share = 0.1
    """class-K factor lambda, in (0, 1]: the share of h that may be lost in a step"""
    gamma: Annotated[NotNegative, within(0, 1e6, RATE)] = 100.0
    """m2/s3, Gamma; Gamma dt^3 is a bound on what the truncated series leaves out"""
    road_rate: Share = 0.3
    """lambda towards road edges (ours): with the paper's, the same as towards vehicles, the filter brakes in
    every bend"""

    def weights(self, dt: float, *, road: bool) -> RowWeights:
        """See `Rule`."""
        return ttcbf_weights(self.road_rate if road else self.rate, self.gamma, dt)

    def most(self, *, road: bool) -> float:
        """See `Rule`: no more than all of h may be lost in a step."""
        return 1.0 / (self.road_rate if road else self.rate)


class Ecbf(Rule):
    """Exponential control barrier function."""

    rate1: Annotated[Positive, within(1e-6, 1e3, RATE)] = 1.5
    """1/s, lambda1"""
    rate2: Annotated[Positive, within(1e-6, 1e3, RATE)] = 0.3
    """1/s, lambda2"""
    road_rate1: Annotated[Positive, within(1e-6, 1e3, RATE)] = 7.5
    """1/s, lambda1 towards road edges (ours)"""
    road_rate2: Annotated[Positive, within(1e-6, 1e3, RATE)] = 1.5
    """1/s, lambda2 towards road edges (ours)"""

    def weights(self, dt: float, *, road: bool) -> RowWeights:
        """See `Rule`."""
        if road:
            return ecbf_weights(self.road_rate1, self.road_rate2, dt)
        return ecbf_weights(self.rate1, self.rate2, dt)

    def most(self, *, road: bool) -> float:
        """See `Rule`: the poles of h'' + (l1 + l2) h' + k l1 l2 h must be real."""
        l1, l2 = (self.road_rate1, self.road_rate2) if road else (self.rate1, self.rate2)
        return (l1 + l2) ** 2 / (4.0 * l1 * l2)


RULES: dict[str, type[Rule]] = {"ttcbf": Ttcbf, "ecbf": Ecbf}
"""name -> class"""


def register_rule(name: str, rule: type[Rule]) -> None:
    """Make a rule known by its name, for `+NAME` behind any driver and `correction.rule=NAME` of a learnt
    agent. Raises InputError if it lacks a method.
    """
    if rule.__abstractmethods__:
        raise InputError(f"rule {name!r} lacks {', '.join(sorted(rule.__abstractmethods__))}")
    RULES[name] = rule
