"""The numbers in a scenario, and other ones in their place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rudc.scenario.base import parts_of, with_parts
from rudc.scenario.distributions import Distribution
from rudc.scenario.triggers import Threshold


def numbers_in(value: Any, key: str = "") -> Iterator[tuple[str, Distribution]]:
    """Dotted key and distribution of each number in a model, or tuple, list or dict of them; `key`: that of
    the whole.
    """
    if isinstance(value, Distribution):
        yield key, value
        return
    for name, part in parts_of(value):
        yield from numbers_in(part, f"{key}.{name}".lstrip("."))


def with_numbers(value: Any, change: Callable[[str, Distribution], Distribution], key: str = "") -> Any:
    """The same model, or tuple, list or dict of them, with `change(key, number)` in the place of each of its
    numbers; `key`: the dotted key of the whole. If a threshold's two numbers then contradict each other, it
    never holds, as where both are drawn.
    """
    if isinstance(value, Distribution):
        return change(key, value)
    found = with_parts(value, lambda name, part: with_numbers(part, change, f"{key}.{name}".lstrip(".")))
    return found.as_drawn() if isinstance(found, Threshold) else found
