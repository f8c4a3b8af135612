"""What a fuzzer is: a maker of damaged inputs, each from its number alone, and of commands to bear them."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Command = tuple[str, ...]
"""arguments of `rudc`"""


@dataclass(frozen=True)
class Case:
    """One damaged input, written to a folder of its own."""

    kind: str
    """of mutation"""
    commands: Sequence[Command]
    """given to `rudc` in this order, in that folder; the first that refuses the input is the last"""
    works: bool = False
    """whether a command may do real work, so that time and memory count only where it refuses"""


@dataclass(frozen=True)
class Fuzzer:
    """Damaged inputs of one sort."""

    name: str
    full: int
    """inputs of a whole run"""
    prepare: Callable[[Path], Callable[[random.Random, Path], Case]]
    """folder for what all inputs share -> what writes an input into its own folder; called once"""
    patience_s: float = 120.0
    """s of wall time after which an input is taken to hang"""

    def randomness(self, seed: int, number: int) -> random.Random:
        """Where input `number` comes from; the same for the same numbers, on any machine."""
        return random.Random(f"{self.name}/{seed}/{number}")
