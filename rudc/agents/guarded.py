"""Checks the answers of agents and corrections that are not RUDC's: where an answer is no action, an error
says what it is.

The `act` of such an agent returns a `Decision`, or just (acceleration m/s2, front-wheel angle rad).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rudc.agents.base import Agent, Decision
from rudc.agents.own_files import not_remembered, read_late
from rudc.agents.seat import Correction, Critics, Percentiles, Proposal
from rudc.arrays import Array
from rudc.env.action import numbers_of, two_numbers
from rudc.errors import AgentFailedError
from rudc.imports import ask_own, in_words, refused, shortened
from rudc.reading import watched
from rudc.safety.corrected import Corrected
from rudc.world.config import EgoDriver
from rudc.world.ego import within_limits
from rudc.world.scene import Scene

T = TypeVar("T")

SAME = 1e-6
"""m/s2, rad: actions that differ by no more are the same; single precision loses as much"""


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
"""optional part of a decision -> the check of its value, and a description of the values that are accepted"""


_DETACH = "; what it answers requires grad: call .detach() on it, or compute it under torch.no_grad()"


def _requires_grad(answer: Any) -> bool:
    """Whether an answer is a tensor of torch that requires grad, or has one in it."""
    parts = [answer, *answer] if isinstance(answer, list | tuple) else [answer]
    return any(getattr(part, "requires_grad", False) is True for part in parts)


class GuardedAgent:
    """An agent that is not RUDC's. Its methods raise AgentFailedError, with the agent's own exception, if
    any, as the cause.
    """

    def __init__(self, agent: Agent, name: str) -> None:
        self.name = name
        self.ego_driver: EgoDriver = getattr(agent, "ego_driver", "agent")
        self.inner = agent
        self.recorded: frozenset[str] | None = None
        """names of its data files that a sweep's manifest records (rudc/agents/own_files.py): others are
        refused that it opens in its first `reset` or `act` and did not open before; None: none is refused"""
        self._called: set[str] = set()
        self._begun = False

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset the agent."""
        self._begun = True
        self._call("reset", scene, lambda: self.inner.reset(scene, seed))

    def act(self, scene: Scene) -> Decision:
        """The agent's decision, checked, with actions cut to the vehicle's limits."""
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
            f"{_DETACH if _requires_grad(answer) else ''}"
        )

    def _call(self, method: str, scene: Scene, call: Callable[[], T]) -> T:
        try:
            if self.recorded is None or method in self._called:
                return call()
            self._called.add(method)
            return self._watched(method, call, self.recorded)
        except AgentFailedError:
            raise
        except (Exception, SystemExit) as error:
            hint = "" if self._begun else "; reset(scene, seed) was never called before"
            raise AgentFailedError(
                f"agent {self.name} at {scene.time_s:.1f} s: {method} raised {in_words(error)}{hint}"
            ) from error

    def _watched(self, method: str, call: Callable[[], T], recorded: frozenset[str]) -> T:
        """The answer of a call in which no data file is opened that is neither recorded nor opened before."""
        with watched() as opened:
            answer = call()
        if late := [name for name in not_remembered(self.name, opened) if name not in recorded]:
            read_late[self.name] = (
                f"agent {self.name}: {method} opened {late[0]}, and a sweep keeps digests only of files that "
                f"an agent opens while it is made; open it in __init__, or let its class say "
                f"reads = ({late[0]!r},)"
            )
            raise AgentFailedError(read_late[self.name])
        return answer


class GuardedCorrection:
    """A correction that is not RUDC's. Its methods raise PartFailedError, with the correction's own
    exception, if any, as the cause.
    """

    def __init__(self, correction: Correction, kind: str) -> None:
        """`kind`: name of the correction, for messages."""
        self.inner = correction
        self._who = f"correction {kind}"

    def load(self, arrays: Mapping[str, NDArray], percentiles: Percentiles) -> None:
        """Let the correction load them."""
        ask_own(self._who, None, "load", lambda: self.inner.load(arrays, percentiles))

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset the correction."""
        ask_own(self._who, scene.time_s, "reset", lambda: self.inner.reset(scene, seed))

    def correct(self, scene: Scene, proposal: Proposal, critics: Critics | None) -> Corrected:
        """The correction's result, checked, with `u` cut to the vehicle's limits."""
        time_s = scene.time_s
        answer: Any = ask_own(
            self._who, time_s, "correct", lambda: self.inner.correct(scene, proposal, critics)
        )
        if isinstance(answer, Corrected) and isinstance(answer.status, str):
            u, correction = two_numbers(answer.u), two_numbers(answer.correction)
            if u is not None and correction is not None:
                able = np.array(within_limits(scene.vehicle, *u.tolist()))
                asked = within_limits(scene.vehicle, *np.asarray(proposal.u).tolist())
                if answer.status == "nominal" and np.abs(able - asked).max() > SAME:
                    unchanged = f"{np.array(asked)} with status nominal, or another status"
                    raise refused(self._who, time_s, "correct", f"{able} with status nominal", unchanged)
                return answer._replace(
                    u=able, correction=correction if (able == u).all() else able - proposal.u
                )
        wanted = "a `Corrected` with two finite numbers as u and as correction (m/s2, rad), and a status"
        raise refused(self._who, time_s, "correct", shortened(answer), wanted)
