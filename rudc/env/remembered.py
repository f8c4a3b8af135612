"""`Remembered`: keeps what was computed from an object, such as a network or a route."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


class Remembered(Generic[Key, Value]):
    """Values that belong to objects: made when first asked for, and kept for the last `size` objects."""

    def __init__(self, size: int = 64) -> None:
        self._size = size
        self._known: dict[int, tuple[Key, Value]] = {}  # keys are kept too, so that no other gets their id

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """The value that belongs to `key`; made by `make` if there is none yet."""
        known = self._known.get(id(key))
        if known is None:
            if len(self._known) >= self._size:
                self._known.pop(next(iter(self._known)))
            known = self._known[id(key)] = (key, make())
        return known[1]
