"""What every part of a scenario file is built from: models that refuse unknown keys, numbers and names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, NoReturn, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    StringConstraints,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError
from pydantic_core.core_schema import ErrorType

T = TypeVar("T")

ERROR_TYPES = frozenset(get_args(ErrorType))
"""kinds of error that are pydantic's own"""


class FileModel(BaseModel, frozen=True):
    """A mapping in a scenario file: frozen, and every key known."""

    model_config = ConfigDict(
        extra="forbid", use_attribute_docstrings=True, validate_by_name=True, validate_by_alias=True
    )

    @classmethod
    def misfits(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str | None]]:
        """What is wrong with the combination of keys that are given, and the key to blame, if it is one."""
        return iter(())

    @model_validator(mode="wrap")
    @classmethod
    def _every_problem(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        misfits = list(cls.misfits(data)) if isinstance(data, Mapping) else []
        problems = [detail(m, () if key is None else (key,), data, on_key=True) for m, key in misfits]
        return checked_beside(problems, data, handler, cls.__name__)


def checked_beside(problems: list[InitErrorDetails], data: Any, handler: Callable[[Any], T], title: str) -> T:
    """What the handler makes of the data. If there are problems already: raises ValidationError with these
    and those that the handler finds, since a file's problems come all at once."""
    if not problems:
        return handler(data)
    try:
        handler(data)
    except ValidationError as error:
        problems = [*(again(known) for known in error.errors(include_url=False)), *problems]
    raise ValidationError.from_exception_data(title, problems)


def parts_of(value: Any) -> list[tuple[str | int, Any]]:
    """What lies directly within a mapping or list of a file, with its key, or its number in the list."""
    if isinstance(value, FileModel):
        fields = type(value).model_fields.items()
        return [(field.alias or name, getattr(value, name)) for name, field in fields]
    if isinstance(value, dict):
        return list(value.items())
    return list(enumerate(value)) if isinstance(value, tuple | list) else []


def with_parts(value: Any, change: Callable[[str | int, Any], Any]) -> Any:
    """The same, with `change(key, part)` in the place of each of its parts (`parts_of`)."""
    parts = [(key, change(key, part)) for key, part in parts_of(value)]
    changed = [part for _, part in parts]
    if isinstance(value, FileModel):
        return value.model_copy(update=dict(zip(type(value).model_fields, changed, strict=True)))
    if isinstance(value, dict):
        return dict(parts)
    if isinstance(value, list):
        return changed
    return tuple(changed) if isinstance(value, tuple) else value


def refusal(message: str, *at: str | int, on_key: bool = False) -> PydanticCustomError:
    """An error about the value at the path `at` below the one being checked, or `on_key` about its key."""
    # The message travels as a value, so that braces in it are not taken for placeholders.
    return PydanticCustomError("refused", "{message}", {"message": message, "at": at, "on_key": on_key})


def refuse(message: str, *at: str | int) -> NoReturn:
    """Say from inside a validator what is wrong, about the key `at` below the value being checked."""
    raise refusal(message, *at)


def detail(message: str, at: tuple[str | int, ...], data: Any, *, on_key: bool = False) -> InitErrorDetails:
    """A `refusal` to be reported beside others."""
    return InitErrorDetails(type=refusal(message, *at, on_key=on_key), loc=(), input=data)


def again(error: ErrorDetails, *before: str | int) -> InitErrorDetails:
    """An error that pydantic has reported, to be reported once more, with `before` in front of its place."""
    kind, context, loc = error["type"], error.get("ctx", {}), (*before, *error["loc"])
    if kind in ERROR_TYPES:
        return InitErrorDetails(type=kind, loc=loc, input=error["input"], ctx=context)
    template = "{message}" if "message" in context else error["msg"]
    # The texts are constants of this package, though the type checker no longer knows that here.
    known = PydanticCustomError(kind, template, context)  # pyright: ignore[reportArgumentType] -- takes literals only
    return InitErrorDetails(type=known, loc=loc, input=error["input"])


def _as_text(value: Any) -> Any:
    """Ids that a file writes as numbers (as in imported maps) are taken as text."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number; text and truth values are refused."""

Truth = Annotated[bool, Field(strict=True)]
"""true or false; words and numbers that could stand for them are refused"""

NonEmpty = Annotated[str, StringConstraints(strict=True, strip_whitespace=True, min_length=1)]
"""Some text."""

Identifier = Annotated[NonEmpty, BeforeValidator(_as_text, json_schema_input_type=str | int)]
"""The name of an arm, lane, edge or junction."""
