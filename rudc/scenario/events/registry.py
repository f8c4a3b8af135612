"""Which kinds of event there are: of this package, of installed packages, and registered by hand."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from rudc.errors import InputError
from rudc.imports import ask_own, import_first_elsewhere, import_offered, is_own, refused, shortened
from rudc.scenario.base import again
from rudc.scenario.events.checked_stage import checked
from rudc.scenario.events.event import Effect, Event, numbered
from rudc.scenario.events.stage import Stage
from rudc.scenario.units import bounds_of

PLUGINS = "rudc.events"
"""group of entry points by which an installed package names a module that registers events"""
_NOT_KINDS = {"checked_stage", "event", "registry", "stage"}


class _Entry(NamedTuple):
    model: type[Event]
    effect: type[Effect[Any]]


_REGISTERED: dict[str, _Entry] = {}


def register_event(model: type[Event], effect: type[Effect[Any]]) -> None:
    """Make a kind of event known: `model` is what a scenario file says of it, `effect` what it does.

    The kind is what the model's `kind: Literal["..."]` says. Raises InputError where that is missing, where
    another model has the kind already, where the effect lacks a method, and where a number's default is not a
    distribution.
    """
    _check_parts(model, effect)
    kinds = get_args(model.model_fields["kind"].annotation)
    if len(kinds) != 1 or not isinstance(kinds[0], str):
        raise InputError(f'{model.__name__} must say its kind, as in `kind: Literal["my_event"]`')
    there = _REGISTERED.get(kinds[0])
    same = there is not None and there.model.__qualname__ == model.__qualname__
    if there is not None and not (same and there.model.__module__ == model.__module__):
        raise InputError(
            f"there is an event {kinds[0]!r} already, {there.model.__module__}.{there.model.__name__}"
        )
    _REGISTERED[kinds[0]] = _Entry(model, effect)


def _check_parts(model: type[Event], effect: type[Effect[Any]]) -> None:
    """Raises InputError unless these are a model and an effect that can be used."""
    if not (issubclass(model, Event) and issubclass(effect, Effect)):
        raise InputError(
            "register_event takes a model and its effect, a subclass of Event and one of Effect; got "
            f"{model.__name__} and {effect.__name__}"
        )
    if lacking := sorted(effect.__abstractmethods__):
        raise InputError(f"{effect.__name__} has no {lacking[0]}(stage)")
    for name, field in model.model_fields.items():
        if bounds_of(field) and isinstance(field.default, int | float):
            default = f"Constant(value={field.default})"
            raise InputError(f"{model.__name__}.{name}: a default is written {default}, not {field.default}")


def effect_of(event: Event, name: str) -> Effect[Any]:
    """The effect that plays an event, under a name of its own."""
    _discover()
    return _REGISTERED[event.kind].effect(event, name)


def ask_effect(
    effect: Effect[Any], method: str, stage: Stage, number: int, time_s: float | None = None
) -> Any:
    """What a method of the effect answers; `number`: that of its event in the file, from 1. Raises
    PartFailedError where one that is not RUDC's fails, gives the stage a number that no file could, or
    answers neither True nor False where it should."""
    call = getattr(effect, method)
    if not is_own(effect):
        return call(stage)
    who = f"event {numbered(number, effect.event)}"
    answer = ask_own(who, time_s, method, lambda: call(checked(stage)))
    if method in ("begin", "is_over") and not isinstance(answer, bool | np.bool_):
        raise refused(who, time_s, method, shortened(answer), "True or False")
    return answer


class EventKinds(Mapping[str, type[Event]]):
    """Name in files -> model, of all that are known now."""

    def __getitem__(self, kind: str) -> type[Event]:
        _discover()
        return _REGISTERED[kind].model

    def __iter__(self) -> Iterator[str]:
        _discover()
        return iter(_REGISTERED)

    def __len__(self) -> int:
        _discover()
        return len(_REGISTERED)


EVENT_KINDS = EventKinds()


def _discover() -> None:
    """Import the files of this package, and what installed packages offer."""
    _import_own()
    import_offered(PLUGINS)


@cache
def _import_own() -> None:
    package = importlib.import_module(__package__ or "")
    for module in pkgutil.iter_modules(package.__path__):
        if module.name not in _NOT_KINDS:
            importlib.import_module(f"{package.__name__}.{module.name}")


class _ByKind:
    """Tells pydantic to read an event with the model of its kind."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            _parse, serialization=core_schema.simple_ser_schema("any")
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"oneOf": [handler(model.__pydantic_core_schema__) for model in EVENT_KINDS.values()]}


def _parse(value: Any) -> Event:
    event = _validated(value)
    import_first_elsewhere(type(event))  # for the workers of a sweep: it may be of an agent's file
    return event


def _validated(value: Any) -> Event:
    if isinstance(value, Event):
        return value
    kind = value.get("kind") if isinstance(value, dict) else None
    if not isinstance(kind, str) or kind not in EVENT_KINDS:
        raise PydanticCustomError("event_kind", "expected an event")
    model = EVENT_KINDS[kind]
    try:
        return model.model_validate(value)
    except ValidationError as error:
        # The tag says of which model the rest of the place is part.
        problems = [again(detail, tag_of(kind)) for detail in error.errors(include_url=False)]
    raise ValidationError.from_exception_data(model.__name__, problems)


def tag_of(kind: str) -> str:
    """What stands for a kind in the place of an error; in brackets, so that none reads like a key."""
    return f"<{kind}>"


AnyEvent = Annotated[Event, _ByKind()]
"""Any one event; its `kind` says which."""
