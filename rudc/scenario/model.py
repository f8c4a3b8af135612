"""`Scenario`: what a file says, checked and complete; it draws an `EpisodePlan` for every seed.

Random numbers come from one generator a section, `default_rng((seed, attempt, SECTION))`, so that a change in
one section leaves the draws of the others as they were.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import math
import re
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import yaml
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)
from pydantic_core import InitErrorDetails

from rudc.errors import InputError, ScenarioError
from rudc.hints import there_are
from rudc.scenario.base import FileModel, Identifier, NonEmpty, again, detail, refuse
from rudc.scenario.choices import with_shared
from rudc.scenario.distributions import AnyDistribution, may_be_shared, shared_in
from rudc.scenario.dotted import DottedKeyError, dotted, value_at, with_value
from rudc.scenario.dotted import Path as KeyPath
from rudc.scenario.drawable import sharing
from rudc.scenario.events import AnyEvent, Event
from rudc.scenario.fixed import Constant, Distribution
from rudc.scenario.networks import existing_network, is_network_path
from rudc.scenario.numbers_in import with_numbers
from rudc.scenario.plan import EpisodePlan
from rudc.scenario.problems import describe
from rudc.scenario.sections import Ego, Episode, Traffic
from rudc.scenario.shared import Shared
from rudc.scenario.triggers import named_events
from rudc.scenario.yaml_text import YamlDumper

_EGO, _TRAFFIC, _EPISODE, _WORLD, _SHARED, _FIRST_EVENT = 1, 2, 3, 4, 5, 16
GRID_LIMIT = 10_000
"""points of a `sweep` beyond which it is taken for a mistake"""

LONGEST_NAME = 100
"""characters of a scenario's name"""

Scalar = bool | float | int | str


def is_plain_name(name: str) -> bool:
    """Whether a scenario may have this name."""
    return re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", name) is not None


def _plain_name(name: str) -> str:
    if not is_plain_name(name):
        refuse(f"expected a name of unaccented letters, digits, '_', '-' and '.'; got {name!r}")
    if len(name) > LONGEST_NAME:
        refuse(
            f"expected a name of at most {LONGEST_NAME} characters: files are named by it; got {len(name)}"
        )
    return name


def _scalar(value: Any) -> Any:
    if not isinstance(value, Scalar):
        refuse("a swept value is a number, a name, true or false")
    return value


def _checked(events: Any, handler: ValidatorFunctionWrapHandler) -> tuple[Event, ...]:
    """The events of a file: each waits at most for one before it, by whose number it then calls it. What is
    wrong with any of them is reported at once."""
    problems = dict[KeyPath, InitErrorDetails]()
    if isinstance(events, list | tuple):
        events = [*_by_number(events, problems)]
    others = list[InitErrorDetails]()
    try:
        found = handler(events)
        read = dict[int, Event](enumerate(found))
    except ValidationError as error:
        others = [again(known) for known in error.errors(include_url=False)]
        found, read = (), _each_by_itself(events, handler)
    for path, text in (*_out_of_order(read), *_of_no_vehicle(read, problems.keys())):
        problems.setdefault(path, detail(text, path, events))
    if others or problems:
        raise ValidationError.from_exception_data("events", [*others, *problems.values()])
    return found


def _each_by_itself(events: Any, handler: ValidatorFunctionWrapHandler) -> dict[int, Event]:
    """Place in a file's list -> event, of those that are as they should be."""
    read = dict[int, Event]()
    for k, event in enumerate(events if isinstance(events, list) else ()):
        with contextlib.suppress(ValidationError):
            (read[k],) = handler([event])
    return read


def _by_number(events: Sequence[Any], problems: dict[KeyPath, InitErrorDetails]) -> Iterator[Any]:
    """The events as a file gives them, names in their conditions replaced by numbers. Adds what is wrong with
    names to the problems, by its place."""
    numbers = dict[str, int]()
    read = [event if isinstance(event, dict) else {"name": getattr(event, "name", None)} for event in events]
    for k, (event, given) in enumerate(zip(events, read, strict=True)):
        changed = event
        for keys in _named(given):
            if not isinstance(called := value_at(given, ".".join(map(str, keys))), str):
                continue
            called = called.strip()
            if called not in numbers:
                later = [
                    i for i, other in enumerate(read) if i > k and str(other.get("name")).strip() == called
                ]
                problems[k, *keys] = detail(_nobody_called(called, numbers, later), (k, *keys), events)
            changed, _ = with_value(changed, ".".join(map(str, keys)), numbers.get(called, 0))
        yield changed
        if isinstance(name := given.get("name"), str) and (name := name.strip()):
            if name in numbers:
                text = f"events.{numbers[name]} is called {name!r}, too"
                problems[k, "name"] = detail(text, (k, "name"), events)
            numbers[name] = k


def _named(event: dict[str, Any]) -> Iterator[tuple[str | int, ...]]:
    """Where the conditions of an event, as a file gives it, may name another event."""
    groups = value_at(event, "when.any")
    for name in ("event_state", "relative_distance"):
        yield "when", name, "event"
        for i in range(len(groups) if isinstance(groups, list | tuple) else 0):
            yield "when", "any", i, name, "event"


def _nobody_called(called: str, numbers: dict[str, int], later: list[int]) -> str:
    """That no event is `called` so, of those with names whose `numbers` are known, but those `later`."""
    known = there_are(called, numbers) if numbers else "; none has a name"
    if called.isdecimal():
        known = "; a number stands without quotes"
    if later:
        known = f": events.{later[0]} is, and it must stand before this one"
    return f"no event before this one is called {called!r}{known}"


def _out_of_order(events: Mapping[int, Event]) -> Iterator[tuple[KeyPath, str]]:
    """What is wrong, and where, with events that name others than those before them."""
    for k, event in events.items():
        for where, group in (event.when.groups if event.when else {}).items():
            for key, number in named_events(group).items():
                if number.support[1] < k or math.isinf(number.support[1]):  # a shared one that is not sound
                    continue
                before = f"0 to {k - 1}" if k > 1 else "only 0" if k else "there is none before the first"
                yield (
                    (k, "when", *where, *key),
                    f"expected the number of an event before this one in the file ({before}); "
                    f"got {number.support[1]:g}",
                )


def _of_no_vehicle(
    events: Mapping[int, Event], unknown: Collection[KeyPath]
) -> Iterator[tuple[KeyPath, str]]:
    """What is wrong, and where, with events that name the `same` vehicle: each must wait for one that takes
    hold of one. `unknown`: where an event is named that there is not.
    """
    for k, event in events.items():
        parts: dict[KeyPath, Any] = {("vehicle",): event}
        for where, group in (event.when.groups if event.when else {}).items():
            parts |= {("when", *where, name, "vehicle"): part for name, part in group.conditions.items()}
        for key in [key for key, part in parts.items() if getattr(part, "vehicle", None) == "same"]:
            state = event.when.event_state if event.when else None
            if state is None:
                yield (
                    (k, *key),
                    "`same` is the vehicle of the event that this one waits for; add `event_state` to `when`"
                    " (not in a group of `any`)",
                )
            elif (k, "when", "event_state", "event") not in unknown:
                first, last = state.event.support
                for i in range(int(max(first, 0)), int(min(last + 1, k))):
                    if i in events and getattr(events[i], "vehicle", None) is None:
                        yield (k, *key), f"events.{i}, for which this one waits, takes hold of no vehicle"
                        break


def _content(network: Scalar) -> Scalar:
    """A shipped network's name, or what is in the file of any other, wherever it lies."""
    if not is_network_path(network):
        return network
    return hashlib.sha256(Path(str(network)).read_bytes()).hexdigest()


class Scenario(FileModel, frozen=True):
    """A scenario: a network, an ego with a task, traffic, and what goes wrong."""

    name: Annotated[NonEmpty, AfterValidator(_plain_name)]
    """its name in tables"""
    description: str = ""
    """what happens, in a sentence"""
    out_of_distribution: NonEmpty | None = None
    """why it lies outside what an agent is trained on, in a line; absent if it does not"""
    extends: Identifier | None = None
    """scenario (a file beside this one, or a shipped one) whose values hold where this file says nothing"""
    network: Annotated[NonEmpty, AfterValidator(existing_network)] = "four_way"
    """a shipped network, or a path to a .net.xml seen from this file"""
    junction: Identifier | None = None
    """which junction, in a network with several"""
    ego: Ego = Ego()
    """the ego's task and start"""
    traffic: Traffic = Traffic()
    """surrounding vehicles"""
    shared: dict[Identifier, Annotated[AnyDistribution, AfterValidator(may_be_shared)]] = Field(
        default_factory=dict
    )
    """name -> number, drawn once an episode; {shared: NAME, times: 1, plus: 0} stands for it, wherever a
    number does, and {choice: [...], shared: NAME} for the value at that place of the list, 0 the first"""
    events: Annotated[tuple[AnyEvent, ...], WrapValidator(_checked)] = ()
    """what happens besides ordinary traffic"""
    episode: Episode = Episode()
    """when it ends by itself"""
    sweep: dict[str, tuple[Annotated[Scalar, BeforeValidator(_scalar)], ...]] = Field(default_factory=dict)
    """dotted key -> list of values; every combination is run"""

    @model_validator(mode="wrap")
    @classmethod
    def _sharing(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        with sharing(shared_in(data)):
            return handler(data)

    _path: Path | None = PrivateAttr(default=None)
    _given: dict[str, Any] | None = PrivateAttr(default=None)

    @property
    def path(self) -> Path | None:
        """The file it was read from."""
        return self._path

    @property
    def given(self) -> dict[str, Any]:
        """What its file and those it extends say, without defaults and without the network. `varied` puts
        swept values into this. Where the scenario comes from no file: all of `data()`."""
        data = self.data() if self._given is None else self._given
        return {key: value for key, value in data.items() if key not in ("sweep", "extends", "network")}

    def data(self) -> dict[str, Any]:
        """What a file would say, defaults and inherited values included, `extends` resolved."""
        data = self.model_dump(mode="json", by_alias=True, exclude_none=True, exclude={"extends"})
        return {key: value for key, value in data.items() if value not in ("", {}, [])}

    def to_yaml(self) -> str:
        """The same as the text of a scenario file."""
        return yaml.dump(self.data(), Dumper=YamlDumper, sort_keys=False, allow_unicode=True, width=100)

    @cached_property
    def digest(self) -> str:
        """16 hexadecimal digits that change when anything changes that an episode depends on."""
        data = self.data()
        for remark in ("description", "out_of_distribution"):
            data.pop(remark, None)
        for event in data.get("events", ()):
            event.pop("name", None)
        data["network"] = _content(self.network)
        if "network" in self.sweep:
            data["sweep"]["network"] = [_content(network) for network in self.sweep["network"]]
        text = json.dumps(data, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def points(self) -> list[dict[str, Scalar]]:
        """Every combination of the swept values, the last key varying fastest; [{}] if nothing is swept."""
        return [
            dict(zip(self.sweep, values, strict=True)) for values in itertools.product(*self.sweep.values())
        ]

    def grid(self) -> list[tuple[dict[str, Scalar], Scenario]]:
        """Each combination of swept values and its scenario; [({}, self)] if nothing is swept."""
        if not self.sweep:
            return [({}, self)]
        return [(point, self.varied(point)) for point in self.points()]

    def varied(self, values: dict[str, Scalar]) -> Scenario:
        """The same scenario without a sweep, other values at some dotted keys. Raises ScenarioError."""
        data: dict[str, Any] = {**self.given, "network": self.network}
        try:
            for key, value in values.items():
                data, _ = with_value(data, key, value)
            scenario = Scenario.model_validate(data)
        except DottedKeyError as error:
            raise ScenarioError(f"{self.name}: {error}") from None
        except ValidationError as error:
            problems = describe(error, Scenario, data)
            raise ScenarioError(
                "\n".join(f"{self.name}: {dotted(p.path)}: {p.text}" for p in problems)
            ) from None
        return scenario.read_from(self._path)

    def read_from(self, path: Path | None, given: dict[str, Any] | None = None) -> Scenario:
        """The same scenario, which now knows its file and what is `given` there."""
        known = self.model_copy()
        # A frozen model's private attributes may be set all the same.
        known._path = path  # pyright: ignore[reportAttributeAccessIssue]
        known._given = given  # pyright: ignore[reportAttributeAccessIssue]
        return known

    def plan(self, seed: int, attempt: int = 0) -> EpisodePlan:
        """One episode, the same for the same seed and attempt, with its numbers drawn.

        Whether an event happens depends on the seed alone: if it were drawn anew with each attempt, an event
        that leaves the ego few safe starts would happen less often than its `probability` says.
        """
        for what, value in (("a seed", seed), ("an attempt", attempt)):
            if value < 0:
                raise InputError(f"{what} cannot be negative, got {value}")

        def generator(section: int, attempt: int = attempt) -> np.random.Generator:
            return np.random.default_rng((seed, attempt, section))

        def drawn_event(section: int, event: Event, at_first: Event) -> Event | None:
            rng = generator(section)
            event.happens(rng)  # so that the numbers, drawn after it, are the same for any probability
            return event.drawn(rng) if at_first.happens(generator(section, attempt=0)) else None

        told = self._told(seed, attempt)
        at_first = told if attempt == 0 else self._told(seed, 0)
        drawn = [
            drawn_event(_FIRST_EVENT + i, event, first)
            for i, (event, first) in enumerate(zip(told.events, at_first.events, strict=True))
        ]
        return EpisodePlan(
            scenario=self.name,
            network=self.network,
            junction=self.junction,
            seed=seed,
            attempt=attempt,
            world_seed=(seed, attempt, _WORLD),
            ego=told.ego.plan(generator(_EGO)),
            traffic=told.traffic.plan(generator(_TRAFFIC)),
            events=tuple(event for event in drawn if event is not None),
            timeout_s=told.episode.timeout.sample(generator(_EPISODE)),
            event_numbers=tuple(k for k, event in enumerate(drawn, start=1) if event is not None),
            scripted=self.events,
            source=self,
        )

    def _told(self, seed: int, attempt: int) -> Scenario:
        """The same scenario, with the shared numbers drawn and told to those that name them. Each number has
        a generator of its own, so that it does not depend on the others.
        """
        if not self.shared:
            return self
        values = {
            name: number.sample(np.random.default_rng((seed, attempt, _SHARED, zlib.crc32(name.encode()))))
            for name, number in self.shared.items()
        }

        def told(_: str, number: Distribution) -> Distribution:
            return Constant(value=number.of(values[number.shared])) if isinstance(number, Shared) else number

        return with_shared(with_numbers(self, told), values)
