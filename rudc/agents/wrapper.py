"""`SafetyFilterWrapper`: a correction for everything that learns or drives through Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from rudc.agents.correction import make_correction, read_correction, refuse_other_step
from rudc.agents.seat import CorrectionKind, Proposal
from rudc.arrays import Array
from rudc.env.intersection import IntersectionEnv
from rudc.errors import InputError
from rudc.safety.config import FilterConfig
from rudc.safety.corrected import Corrected
from rudc.world.scene import Scene


class SafetyFilterWrapper(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """Corrects actions before `rudc/Intersection-v0` applies them.

    ```python
    env = rudc.SafetyFilterWrapper(gymnasium.make("rudc/Intersection-v0"), {"kind": "cbf", "rule": "ecbf"})
    ```

    The action space is not changed. `info["correction"]` of a step says what was done: `status` (`nominal` if
    nothing needed correction), `u_rl` and `u` (2,) in m/s2 and rad, `action` (2,) the one that stands for
    u or is nearest to it, for learners that replay what was executed, `active` (names of constraints),
    `h` (m2, least of all barriers, inf without barriers) and `infeasible`. There is no uncertainty here,
    so no slack depends on it.
    """

    def __init__(
        self, env: gymnasium.Env, correction: str | Mapping[str, Any] | CorrectionKind = "cbf"
    ) -> None:
        """`correction`: the name of a kind, or a mapping of `kind` and settings, the same as `correction.KEY`
        of agents. Raises InputError if `env` is another environment or has a SafetyFilterWrapper already,
        if the correction corrects nothing, if it needs a learnt agent, or if it is a filter for actions
        that are held for another time than the environment's.
        """
        gymnasium.utils.RecordConstructorArgs.__init__(self, correction=correction)
        gymnasium.Wrapper.__init__(self, env)
        settings = read_correction(correction)
        if not isinstance(self.unwrapped, IntersectionEnv):
            raise InputError("SafetyFilterWrapper stands around rudc/Intersection-v0 only")
        while isinstance(env, gymnasium.Wrapper):
            if isinstance(env, SafetyFilterWrapper):
                raise InputError("SafetyFilterWrapper: one stands around this environment already; take one")
            env = env.env
        if settings.asks:
            asked = " and ".join(settings.asks)
            raise InputError(f"a correction that asks the critics for {asked} needs a learnt agent")
        if isinstance(settings, FilterConfig):
            refuse_other_step(settings.dt, self.unwrapped.decision_s, "SafetyFilterWrapper", "dt")
        made = make_correction(settings, {}, action=self.unwrapped.action)
        if made is None:
            raise InputError("SafetyFilterWrapper: correction `none` corrects nothing")
        self._env, self._correction = self.unwrapped, made
        self._last: Corrected | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """See `IntersectionEnv.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._correction.reset(self._env.scene, int(info["seed"]))
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """See `IntersectionEnv.step`."""
        scene, self._env.correct = self._env.scene, self._corrected
        try:
            observation, reward, terminated, truncated, info = self.env.step(action)
        finally:
            self._env.correct = None
        done = self._last
        assert done is not None
        info["correction"] = {
            "status": done.status,
            "u_rl": done.u - done.correction,
            "u": done.u,
            "action": self._env.action.action_of(done.u, scene).astype(np.float32),
            "active": done.active,
            "h": float(done.h.min(initial=np.inf)),
            "infeasible": done.infeasible,
        }
        return observation, reward, terminated, truncated, info

    def _corrected(self, scene: Scene, action: np.ndarray, u: Array) -> Array:
        proposal = Proposal(u, np.asarray(action, dtype=np.float32))
        self._last = self._correction.correct(scene, proposal, None)
        return self._last.u
