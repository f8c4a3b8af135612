"""Keeps watch over an agent, or a correction, that is not RUDC's: it answers an action, or there is an error
that says what.

Such an agent's `act` returns a `Decision`, or just (acceleration m/s2, front-wheel angle rad).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rudc.agents.base import Agent, Decision, EgoDriver
from rudc.agents.seat import Correction, Critics, Percentiles, Proposal
from rudc.arrays import Array
from rudc.env.action import numbers_of, two_numbers
from rudc.errors import AgentFailedError
from rudc.imports import ask_own, in_words, refused, shortened
from rudc.safety.corrected import Corrected
from rudc.world.ego import within_limits
from rudc.world.scene import Scene

T = TypeVar("T")


def _is_uncertainty(stated: Any) -> bool:
    try:
        return numbers_of((stated.epistemic, stated.aleatoric, stated.total)).shape == (3,)
    except (TypeError, AttributeError):
        return False


_UNSURE = _is_uncertainty, "an `Uncertainty` of three numbers"
_STATED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "uncertainty": _UNSURE,
    "by_route": _UNSURE,
    "corrected": (lambda stated: isinstance(stated, Corrected), "a `Corrected`"),
}
"""parts of a decision that an agent need not state -> whether what it states will do, and what would"""


class GuardedAgent:
    """An agent of other people's; it fails by AgentFailedError, with its own exception as the cause."""

    def __init__(self, agent: Agent, name: str) -> None:
        self.name = name
        self.ego_driver: EgoDriver = getattr(agent, "ego_driver", "agent")
        self.inner = agent

    def reset(self, scene: Scene, seed: int) -> None:
        """Its own."""
        self._call("reset", scene, lambda: self.inner.reset(scene, seed))

    def act(self, scene: Scene) -> Decision:
        """Its own, checked, and cut to what the vehicle can."""
        answer: Any = self._call("act", scene, lambda: self.inner.act(scene))
        if not isinstance(answer, Decision):
            u = self._action(answer, scene)
            return Decision(u, u)
        for part, (fits, wanted) in _STATED.items():
            stated = getattr(answer, part)
            if stated is not None and not fits(stated):
                raise AgentFailedError(
                    f"agent {self.name} at {scene.time_s:.1f} s: act answered a Decision with {part} = "
                    f"{shortened(stated)}; expected {wanted}, or None"
                )
        return answer._replace(u=self._action(answer.u, scene), u_rl=self._action(answer.u_rl, scene))

    def _action(self, answer: Any, scene: Scene) -> Array:
        u = two_numbers(answer)
        if u is not None:
            return np.array(within_limits(scene.network.vehicle, *u.tolist()))
        raise AgentFailedError(
            f"agent {self.name} at {scene.time_s:.1f} s: act answered {shortened(answer)}, where two finite "
            "numbers were expected (acceleration m/s2, front-wheel angle rad), or a Decision of them"
        )

    def _call(self, method: str, scene: Scene, call: Callable[[], T]) -> T:
        try:
            return call()
        except AgentFailedError:
            raise
        except (Exception, SystemExit) as error:
            raise AgentFailedError(
                f"agent {self.name} at {scene.time_s:.1f} s: {method} raised {in_words(error)}"
            ) from error


class GuardedCorrection:
    """A correction of other people's; it fails by PartFailedError, with its own exception as the cause."""

    def __init__(self, correction: Correction, kind: str) -> None:
        """`kind`: its name."""
        self.inner = correction
        self._who = f"correction {kind}"

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Its own."""
        ask_own(self._who, None, "load", lambda: self.inner.load(arrays, percentiles))

    def reset(self, scene: Scene, seed: int) -> None:
        """Its own."""
        ask_own(self._who, scene.time_s, "reset", lambda: self.inner.reset(scene, seed))

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """Its own, checked, and cut to what the vehicle can."""
        time_s = scene.time_s
        answer: Any = ask_own(
            self._who, time_s, "correct", lambda: self.inner.correct(scene, proposal, critics)
        )
        if isinstance(answer, Corrected) and isinstance(answer.status, str):
            u, correction = two_numbers(answer.u), two_numbers(answer.correction)
            if u is not None and correction is not None:
                able = np.array(within_limits(scene.vehicle, *u.tolist()))
                return answer._replace(
                    u=able, correction=correction if (able == u).all() else able - proposal.u
                )
        wanted = "a `Corrected` with two finite numbers as u and as correction (m/s2, rad), and a status"
        raise refused(self._who, time_s, "correct", shortened(answer), wanted)
