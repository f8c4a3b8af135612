"""What every part of a scenario file is built from: models that refuse unknown keys, numbers and names."""

from __future__ import annotations

from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints
from pydantic_core import PydanticCustomError


class FileModel(BaseModel, frozen=True):
    """A mapping in a scenario file: frozen, and every key known."""

    model_config = ConfigDict(
        extra="forbid", use_attribute_docstrings=True, validate_by_name=True, validate_by_alias=True
    )


def refuse(message: str, *at: str | int) -> NoReturn:
    """Say from inside a validator what is wrong, about the key `at` below the value being checked."""
    # The message travels as a value, so that braces in it are not taken for placeholders.
    raise PydanticCustomError("refused", "{message}", {"message": message, "at": at})


def _as_text(value: Any) -> Any:
    """Ids that are numbers in a file (as in imported maps) are text all the same."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number; text and truth values are refused."""

NonEmpty = Annotated[str, StringConstraints(strict=True, strip_whitespace=True, min_length=1)]
"""Some text."""

Identifier = Annotated[NonEmpty, BeforeValidator(_as_text, json_schema_input_type=str | int)]
"""The name of an arm, lane, edge or junction."""
