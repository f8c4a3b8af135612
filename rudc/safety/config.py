"""`FilterConfig`: all settings of the safety filter.

Barriers and rules have settings of their own. They stand beside the filter's, and their keys begin with the
owner's prefix: `ttcbf_rate` belongs to the rule, `road_d_safe` to the barrier towards road edges; the keys of
the barrier towards vehicles (`d_safe`) have no prefix. Only the settings of the rule and the barriers that
are switched on have an effect; others are refused.

Defaults are the paper's (Tab. "Hyper-Parameters") where a docstring does not say "ours". The preset
`paper.yaml` is the paper's filter as written. The paper gives no values for d_safe, dbar, the bounds of the
steering and the weights of the QP: these are ours.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Self, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from rudc.errors import InputError
from rudc.hints import there_are
from rudc.safety.barrier import BarrierSettings
from rudc.safety.barriers import BARRIERS
from rudc.safety.guarded import most_of, weights_of
from rudc.safety.qp import SolverName
from rudc.safety.rows import RowWeights
from rudc.safety.rules import RULES, NotNegative, Positive, Rule
from rudc.settings import Settings, problems, within

M = TypeVar("M", bound=BaseModel)
Unbounded = Annotated[
    float,
    Field(ge=0),
    PlainSerializer(lambda value: "inf" if value == math.inf else value, when_used="json"),
]
"""at least 0; infinity, which JSON lacks, is written "inf" """

Weight = Annotated[Positive, within(1e-6, 1e9, "beyond, the QP has no accurate solution")]
"""weight of a term of the QP's objective"""


class FilterConfig(Settings):
    """Settings of a `SafetyFilter`. A setting that has no effect because of the others (`ecbf_rate1` with
    rule `ttcbf`) is refused, and is not written.
    """

    model_config = ConfigDict(extra="allow")  # rules and barriers bring settings of their own

    rule: str = "ttcbf"
    """rule that makes a row from h and its derivatives, a name in `RULES`: `ttcbf`, `ecbf`"""
    dt: Annotated[Positive, within(1e-3, 10, "s that an action is held")] = 0.1
    """s, how long an action is held"""
    max_steering_correction: Unbounded = 0.05
    """largest change of tan(delta_f) (ours); inf for none, as in the paper"""
    max_added_acceleration: Unbounded = 0.0
    """m/s2, by how much the filter may raise the acceleration (ours): with 0 it only brakes and steers. A
    filter that may accelerate (inf, as in the paper) drives into a vehicle ahead to get away from one that
    comes from behind
    """
    acceleration_weight: Weight = 1.0
    """w_a, cost of a squared correction of 1 m/s2 (ours)"""
    steering_weight: Weight = 20.0
    """w_z, cost of a squared correction of tan(delta_f) by 1 (ours)"""
    vehicle_violation_weight: Weight = 1e5
    """cost of a squared violation of 1 m2 per step of a row when no action satisfies all (ours)"""
    road_violation_weight: Weight = 1e2
    """the same cost for the row of a road-edge point (ours)"""
    last_resort: bool = True
    """whether an action is taken only if the ego can then still stop, or go on, without hitting anybody
    (ours)"""
    last_resort_margin: Annotated[NotNegative, within(0, 20, "farther than that nobody matters")] = 0.3
    """m, distance that the ego keeps from others when it stops or goes on so (ours)"""
    solver: SolverName = "planar"
    """QP solver: `planar`, ours (rudc/safety/qp.py), or the qpsolvers name of any that is installed"""

    @field_validator("rule")
    @classmethod
    def _known_rule(cls, rule: str) -> str:
        if rule not in RULES:
            raise ValueError(f"there is no {rule!r}{there_are(rule, RULES)}")
        return rule

    @model_validator(mode="after")
    def _every_setting_is_known(self) -> Self:
        known = set(self.keys())
        for key, value in self._extra.items():
            if key not in known:
                raise _error("extra_forbidden", key, value)
            if key in BARRIERS and not isinstance(value, bool):
                raise _error(PydanticCustomError("barrier", "expected true or false"), key, value)
        _ = self.rule_settings, self.barriers  # checked where they are made
        return self

    def without_effect(self) -> dict[str, str]:
        """Name of each setting that has no effect because of the others -> which (`with rule=ttcbf`)."""
        idle = {} if self.last_resort else {"last_resort_margin": "with last_resort=false"}
        barriers = self.barriers
        for key, owner, name in _keys():
            if owner in RULES and owner != self.rule:
                idle[key] = f"with rule={self.rule}"
            elif owner in BARRIERS and owner not in barriers:
                idle[key] = f"with {owner}=false"
            elif owner in BARRIERS and name in (of_barrier := barriers[owner].without_effect()):
                idle[key] = of_barrier[name]
        return idle

    @model_serializer(mode="wrap")
    def _leave_out_what_has_no_effect(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        barriers, idle = self.barriers, self.without_effect()
        written = {key: value for key, value in handler(self).items() if key not in self._extra}
        written |= {n: n in barriers for n, barrier in BARRIERS.items() if n in barriers or barrier.at_work}
        owners = {self.rule: self.rule_settings, **barriers}
        values = {owner: settings.model_dump() for owner, settings in owners.items()}
        written |= {key: values[owner][name] for key, owner, name in _keys() if owner in values}
        return {key: value for key, value in written.items() if key not in idle}

    def __eq__(self, other: object) -> bool:
        """Whether both have the same values, whether these were given or are defaults."""
        return type(other) is type(self) and self.model_dump() == other.model_dump()

    def __hash__(self) -> int:
        """Hash of all values in effect."""
        return hash(self.model_dump_json())

    def keys(self) -> list[str]:
        """Names of all settings, those of all rules and barriers included."""
        return [*type(self).model_fields, *BARRIERS, *(key for key, _, _ in _keys())]

    @property
    def _extra(self) -> dict[str, Any]:
        return self.__pydantic_extra__ or {}

    @property
    def rule_settings(self) -> Rule:
        """The rule, with its settings."""
        return self._read(self.rule, RULES[self.rule])

    @property
    def barriers(self) -> dict[str, BarrierSettings]:
        """Name of each barrier that is switched on -> its settings."""
        at_work = (name for name, barrier in BARRIERS.items() if self._extra.get(name, barrier.at_work))
        return {name: self._read(name, BARRIERS[name].Settings) for name in at_work}

    def _read(self, owner: str, kind: type[M]) -> M:
        """The settings of a rule or barrier."""
        keys = {name: key for key, whose, name in _keys() if whose == owner}
        try:
            return kind.model_validate({k: self._extra[key] for k, key in keys.items() if key in self._extra})
        except ValidationError as error:
            first = error.errors()[0]
            wrong = PydanticCustomError("setting", "{message}", {"message": first["msg"]})
            place = str(next(iter(first["loc"]), ""))  # empty for a check across settings
            raise _error(wrong, keys.get(place, owner), first["input"]) from None

    @classmethod
    def preset(cls, rule: str, **changes: Any) -> Self:
        """The filter that agents named `+ttcbf` or `+ecbf` have, by its `rule`; `changes` are settings that
        differ. Raises InputError.
        """
        known = cls().keys()
        for name in changes:
            if name not in known:
                raise InputError(f"correction.{name}: there is no such setting{there_are(name, known)}")
        try:
            return cls.model_validate({"rule": rule, **changes})
        except ValidationError as error:
            raise InputError(problems(error, "correction")) from None

    def row_weights(self, *, road: bool) -> RowWeights:
        """The weights of h, h' and h'' in a row, for vehicles or for road-edge points. Raises PartFailedError
        if a rule that is not RUDC's fails.
        """
        return weights_of(self.rule_settings, self.rule, self.dt, road=road)

    def most(self, *, road: bool) -> float:
        """What `Rule.most` answers. Raises PartFailedError as `row_weights` does."""
        return most_of(self.rule_settings, self.rule, road=road)


def _error(kind: PydanticCustomError | str, key: str, value: Any) -> ValidationError:
    """The error that a setting is wrong."""
    details: InitErrorDetails = {"type": kind, "loc": (key,), "input": value}
    return ValidationError.from_exception_data("correction", [details])


def _keys() -> Iterator[tuple[str, str, str]]:
    """For each setting of a rule or barrier: its key, its owner, and its name in the owner's settings."""
    for owner, rule in RULES.items():
        yield from ((f"{owner}_{name}", owner, name) for name in rule.model_fields)
    for owner, barrier in BARRIERS.items():
        yield from ((f"{_prefix(owner)}{name}", owner, name) for name in barrier.Settings.model_fields)


def _prefix(barrier: str) -> str:
    """The beginning of the keys of a barrier's settings."""
    prefix = BARRIERS[barrier].prefix
    return f"{barrier}_" if prefix is None else prefix
