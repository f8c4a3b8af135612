"""The outlook of a driver: a layer that changes the scene before the driver sees it, and bounds the command
that comes back. It leads the driver round what blocks, and adapts it to the car and the road that it has.

    see      The scene as sensors show it -> without noise (smoothing.py) -> with those who are not seen for a
             moment (memory.py) -> at the time when a command will act (adaptation.py) -> along the course
             (courses.py)
    urge     A policy's proposal -> changed to set off if the ego has stood too long and the rules would go
             (patience.py). Corrections come after this
    govern   The driver's command -> slow enough to give way (approach.py) -> to stop for those who do not
             give way to it (not_yielding.py) -> to stop behind the leader (following.py) -> to stop within
             what the ego sees, and to give way to whom it does not see (hidden.py) -> to stop for those who
             may run out, or set off from where they stand (runners.py) -> to stop for those who cross where
             no path leads (crossers.py) -> to drive along the course (courses.py) -> steered so that the
             wheels stay on the road (kerb.py) -> slow enough for the grip (adaptation.py)

So every driver, by rules or by a policy, with a correction or without, goes round what blocks and copes with
another car than the one that it was made for, and need not know of either.
"""

from __future__ import annotations

import time
from collections.abc import Mapping

from rudc.agents.adaptation import Adaptation, Knowledge
from rudc.agents.approach import ready_to_wait
from rudc.agents.base import Agent, Decision, Urged, layers
from rudc.agents.courses import Courses
from rudc.agents.crossers import ready_for_crossers
from rudc.agents.following import ready_to_follow
from rudc.agents.hidden import ready_for_unseen, ready_to_wait_for_unseen, ready_while_blind
from rudc.agents.kerb import kept_on_road
from rudc.agents.memory import Memory
from rudc.agents.not_yielding import ready_for_not_yielding
from rudc.agents.runners import ready_for_next_runners, ready_for_runners, ready_for_setting_off
from rudc.agents.smoothing import Smoothing
from rudc.arrays import Array
from rudc.errors import InputError
from rudc.settings import Settings
from rudc.world.config import EgoDriver
from rudc.world.scene import Scene


class OutlookSettings(Settings):
    """Settings of an outlook. With `course` or `plant`, noise is smoothed too, and those who are not seen
    for a moment are remembered.
    """

    course: bool = False
    """whether the driver is led round what blocks its path"""
    approach: bool = True
    """whether the ego drives so that it can still stop where it must give way while gaps are too short or
    not seen, before vehicles that do not look like giving way to it, before those who cross where no path
    leads, behind its leader, at the end of what it sees, before those who may run out from behind a box or
    have stopped half-way over the road, and while its sensors have failed; with `course` only"""
    plant: Knowledge = "off"
    """what is known of dead time, lag and friction: nothing (`off`), what is estimated while driving
    (`estimated`), or the truth (`known`, for ablations)"""
    probe: bool = True
    """whether short full brakings measure how well the road grips; with plant=estimated only"""

    def without_effect(self) -> Mapping[str, str]:
        """`probe` unless the plant is estimated; `approach` without `course`."""
        found = dict[str, str]()
        if self.plant != "estimated":
            found["probe"] = f"with plant={self.plant}: nothing is estimated"
        if not self.course:
            found["approach"] = "with course=false"
        return found

    def make(self) -> Outlook | None:
        """The outlook; None if it would change nothing."""
        return Outlook(self) if self.course or self.plant != "off" else None


class Outlook:
    """The outlook of one agent; call `reset` at the start of each episode."""

    def __init__(self, settings: OutlookSettings) -> None:
        self.courses = Courses() if settings.course else None
        """courses round what blocks; None without `course`"""
        self._approach = settings.course and settings.approach
        self.adaptation = (
            Adaptation(settings.plant, probe=settings.probe) if settings.plant != "off" else None
        )
        """adaptation to the car and road; None with plant=off"""

    def reset(self, scene: Scene) -> None:
        """Begin a new episode."""
        self.smoothing, self.memory = Smoothing(), Memory()
        if self.adaptation is not None:
            self.adaptation.reset(scene)
        if self.courses is not None:
            self.courses.reset(scene)

    def see(self, scene: Scene) -> Scene:
        """The scene that the driver is shown; call it once for each decision."""
        shown = self.memory.see(self.smoothing.see(scene))
        if self.adaptation is not None:
            shown = self.adaptation.see(shown)
        if shown is not scene:
            shown = shown.nearest_first()
        return shown if self.courses is None else self.courses.see(shown)

    def govern(self, scene: Scene, u: Array, *, onwards: bool = False) -> Array:
        """(2,) the command u (2,), m/s2 and rad, within its bounds; `scene` as `see` showed it.

        `onwards`: only road, bends and grip bound it, since stopping would be worse (`Corrected.onwards`).
        """
        if self._approach and not onwards:
            u = ready_for_not_yielding(scene, ready_to_wait(scene, u))
            u = ready_to_wait_for_unseen(scene, ready_for_unseen(scene, ready_to_follow(scene, u)))
            u = ready_for_next_runners(scene, ready_for_runners(scene, ready_for_setting_off(scene, u)))
            u = ready_for_crossers(scene, ready_while_blind(scene, u) if self.memory.blind else u)
        if self.courses is not None:
            u = kept_on_road(scene, self.courses.govern(scene, u, onwards=onwards))
        return u if self.adaptation is None else self.adaptation.govern(scene, u, onwards=onwards)


class OutlookAgent:
    """Any driver, with its corrections, behind an outlook."""

    ego_driver: EgoDriver = "agent"

    def __init__(self, driver: Agent, name: str, outlook: Outlook) -> None:
        self.name = name
        self.inner, self.outlook = driver, outlook
        self._begun = False
        self._urged = [layer for layer in layers(driver) if isinstance(layer, Urged)]

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset outlook and driver."""
        self._begun = True
        self.outlook.reset(scene)
        self.inner.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The driver's decision in the scene that the outlook shows, its command within the outlook's
        bounds. Raises InputError where `reset` was never called.
        """
        if not self._begun:
            raise InputError(f"agent {self.name}: call reset(scene, seed) before its first act(scene)")
        clock = [time.perf_counter()]
        shown = self.outlook.see(scene)
        clock.append(time.perf_counter())
        decision = self._decide(shown)
        clock.append(time.perf_counter())
        u = self.outlook.govern(shown, decision.u, onwards=decision.onwards)
        spent = clock[1] - clock[0] + time.perf_counter() - clock[2]
        timing, car = {**decision.timing_ms, "outlook": 1000.0 * spent}, self.outlook.adaptation
        if car is None:
            return decision._replace(u=u, timing_ms=timing)
        return decision._replace(u=u, timing_ms=timing, plant=car.estimate, asks_grip=car.asks)

    def _decide(self, shown: Scene) -> Decision:
        """The driver's decision. Its proposals are changed by `urge` in this call only."""
        if self.outlook.courses is None:
            return self.inner.act(shown)
        for layer in self._urged:
            layer.urge = self.outlook.courses.urge
        try:
            return self.inner.act(shown)
        finally:
            for layer in self._urged:
                layer.urge = None


def with_outlook(driver: Agent, name: str, settings: OutlookSettings) -> Agent:
    """The driver behind an outlook, called `name`; the driver itself if the outlook would change nothing."""
    outlook = settings.make()
    return driver if outlook is None else OutlookAgent(driver, name, outlook)
