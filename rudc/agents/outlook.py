"""What a driver is shown of the world, and the bounds on what it asks for: the ways round, and the car that
is there.

    see      what the sensors show -> without their noise (smoothing.py) -> with those who are missing
             (memory.py) -> as the plant makes of it (adaptation.py) -> along the course (courses.py)
    urge     what a policy proposes -> having stood, setting off where rules would (patience.py); corrections
             come after this
    govern   what the driver asks for -> as fast as who must give way may come (approach.py) -> as fast as
             who follows may come (following.py) -> as fast as it can stop within what it sees
             (hidden.py) -> as fast as the course allows (courses.py) -> on the road (kerb.py) -> as fast as
             grip allows

So that whoever drives, by rules or by a policy, and whatever corrects it, goes round what blocks and copes
with a car that is not the one it was made for, without knowing of either.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Protocol, runtime_checkable

from rudc.agents.adaptation import Adaptation, Knowledge
from rudc.agents.approach import ready_to_wait
from rudc.agents.base import Agent, Decision, EgoDriver, layers
from rudc.agents.courses import Courses
from rudc.agents.following import ready_to_follow
from rudc.agents.hidden import ready_for_unseen
from rudc.agents.kerb import kept_on_road
from rudc.agents.memory import Memory
from rudc.agents.smoothing import Smoothing
from rudc.arrays import Array
from rudc.settings import Settings
from rudc.world.scene import Scene


class OutlookSettings(Settings):
    """Which of course and plant there are. With either, noise is smoothed and who is missing remembered."""

    course: bool = False
    """whether the driver is led round what blocks its path"""
    approach: bool = True
    """whether it comes no faster than it can stop to where it must give way, while gaps are too short, to its
    leader, and to the end of what it sees; with `course` only"""
    plant: Knowledge = "off"
    """what is known of the car: nothing (`off`), what the history of commands tells (`estimated`), or the
    truth (`known`, for ablations)"""
    probe: bool = True
    """whether short full brakings ask how well the road grips; with `plant` estimated only"""

    def without_effect(self) -> Mapping[str, str]:
        """Who knows nothing of the car, or all, need not ask; who has no course is not held back."""
        found = dict[str, str]()
        if self.plant != "estimated":
            found["probe"] = f"with plant={self.plant}: nothing is estimated"
        if not self.course:
            found["approach"] = "with course=false"
        return found

    def make(self) -> Outlook | None:
        """The outlook; None where it would show the world as it is."""
        return Outlook(self) if self.course or self.plant != "off" else None


class Outlook:
    """Of one agent; `reset` begins an episode."""

    def __init__(self, settings: OutlookSettings) -> None:
        self.courses = Courses() if settings.course else None
        """None without"""
        self._approach = settings.course and settings.approach
        self.adaptation = (
            Adaptation(settings.plant, probe=settings.probe) if settings.plant != "off" else None
        )
        """None without"""

    def reset(self, scene: Scene) -> None:
        """Begin a new episode."""
        self.smoothing, self.memory = Smoothing(), Memory()
        if self.adaptation is not None:
            self.adaptation.reset(scene)
        if self.courses is not None:
            self.courses.reset(scene)

    def see(self, scene: Scene) -> Scene:
        """The scene to decide in; called once a decision."""
        scene = self.memory.see(self.smoothing.see(scene))
        if self.adaptation is not None:
            scene = self.adaptation.see(scene)
        return scene if self.courses is None else self.courses.see(scene)

    def govern(self, scene: Scene, u: Array, *, onwards: bool = False) -> Array:
        """(2,) what of the command u (2,), m/s2 and rad, may be asked for; `scene` as `see` showed it.

        `onwards`: only the road bounds it, since stopping would be worse (`Corrected.onwards`).
        """
        if self._approach and not onwards:
            u = ready_for_unseen(scene, ready_to_follow(scene, ready_to_wait(scene, u)))
        if self.courses is not None:
            u = kept_on_road(scene, self.courses.govern(scene, u, onwards=onwards))
        return u if self.adaptation is None else self.adaptation.govern(scene, u, onwards=onwards)


@runtime_checkable
class Urged(Protocol):
    """A driver whose proposals can be changed before they are corrected."""

    urge: Callable[[Scene, Array], Array] | None
    """(2,) proposal, m/s2 and rad, in a scene -> the one to be corrected; None for itself"""


class OutlookAgent:
    """Any driver with an outlook, and what corrects it."""

    ego_driver: EgoDriver = "agent"

    def __init__(self, driver: Agent, name: str, outlook: Outlook) -> None:
        self.name = name
        self.inner, self.outlook = driver, outlook
        self._urged = [layer for layer in layers(driver) if isinstance(layer, Urged)]

    def reset(self, scene: Scene, seed: int) -> None:
        """Reset outlook and driver."""
        self.outlook.reset(scene)
        self.inner.reset(scene, seed)

    def act(self, scene: Scene) -> Decision:
        """The driver's decision in the scene that the outlook shows."""
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
        """The driver's decision; its proposals are its own again afterwards, for whoever drives it then."""
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
    """The driver with an outlook, called `name`; itself where that would show the world as it is."""
    outlook = settings.make()
    return driver if outlook is None else OutlookAgent(driver, name, outlook)
