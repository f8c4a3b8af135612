"""Keeps watch over an agent that is not RUDC's: it answers an action, or there is an error that says what.

Such an agent's `act` returns a `Decision`, or just (acceleration m/s2, front-wheel angle rad).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from rudc.agents.base import Agent, Decision, EgoDriver
from rudc.arrays import Array
from rudc.env.action import numbers_of
from rudc.errors import AgentFailedError
from rudc.imports import in_words, shortened
from rudc.world.ego import within_limits
from rudc.world.scene import Scene

T = TypeVar("T")


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
        return answer._replace(u=self._action(answer.u, scene), u_rl=self._action(answer.u_rl, scene))

    def _action(self, answer: Any, scene: Scene) -> Array:
        try:
            u = numbers_of(answer)
        except (TypeError, ValueError):
            u = np.zeros(0)
        if u.shape == (2,) and np.isfinite(u).all():
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
