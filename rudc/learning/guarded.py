"""Checks learners that are not RUDC's: where one fails, an error says at which step of the training, and what
it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any, TypeVar

from numpy.typing import NDArray

from rudc.arrays import Arrays
from rudc.errors import PartFailedError, RudcError
from rudc.imports import ask_own, in_words, shortened
from rudc.learning.batch import Batch
from rudc.learning.learner import Learner, Statistics
from rudc.learning.saving import State

T = TypeVar("T")


class GuardedLearner:
    """A learner that is not RUDC's. Its methods raise PartFailedError, with the learner's own exception, if
    any, as the cause.
    """

    def __init__(self, make: Callable[[], Learner], name: str, where: Callable[[str], str]) -> None:
        """`make` makes the learner; `name`: that of its algorithm; `where` completes the text of what went
        wrong in a training: when it was, what is kept. Raises PartFailedError if it cannot be made.
        """
        self._who, self._where = f"learner of algorithm {name}", where
        self.inner = ask_own(self._who, None, "__init__", make)
        self.statistics = ask_own(self._who, None, "statistics", lambda: self.inner.statistics)
        self.masks = ask_own(self._who, None, "masks", lambda: self.inner.masks)
        if not (isinstance(self.statistics, type) and issubclass(self.statistics, Statistics)):
            raise PartFailedError(
                f"{self._who}: its statistics is {shortened(self.statistics)}; expected a subclass of "
                "`Statistics`"
            )
        if not (isinstance(self.masks, tuple) and len(self.masks) == 2):
            raise PartFailedError(f"{self._who}: its masks is {shortened(self.masks)}; expected a pair")

    @property
    def updates(self) -> int:
        """Updates so far."""
        return self._ask("updates", lambda: self.inner.updates)

    def start(self, batch: Batch) -> None:
        """Tell the learner what transitions look like."""
        self._ask("start", lambda: self.inner.start(batch))

    def update(self, batch: Batch) -> Statistics:
        """One step of learning; what it says of itself is checked to be numbers."""
        answer: Any = self._ask("update", lambda: self.inner.update(batch))
        if isinstance(answer, self.statistics):
            with suppress(TypeError, ValueError, RuntimeError):
                return replace(answer, **{f.name: float(getattr(answer, f.name)) for f in fields(answer)})
        wanted = f"a `{self.statistics.__name__}` of numbers"
        raise self._failed(f"update answered {shortened(answer)}; expected {wanted}")

    def sigma(self, observation: NDArray, action: NDArray) -> NDArray | None:
        """The learner's sigma, see `Learner`."""
        return self._ask("sigma", lambda: self.inner.sigma(observation, action))

    def weights(self) -> Arrays:
        """The learner's weights."""
        return self._ask("weights", self.inner.weights)

    def state(self) -> State:
        """The learner's state."""
        return self._ask("state", self.inner.state)

    def load(self, state: Mapping[str, NDArray]) -> None:
        """Have the learner carry on from a saved state."""
        ask_own(self._who, None, "load", lambda: self.inner.load(state))

    def _ask(self, method: str, call: Callable[[], T]) -> T:
        try:
            return call()
        except RudcError:
            raise
        except (Exception, SystemExit) as error:
            raise self._failed(f"{method} raised {in_words(error)}") from error

    def _failed(self, what: str) -> PartFailedError:
        return PartFailedError(f"{self._who} {self._where(what)}")
