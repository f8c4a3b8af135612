"""Makes SUMO's vehicles brake as the yielding layer decides."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rudc.scenario.events.event import ROUNDED_S
from rudc.world.sumo import Sumo
from rudc.world.traffic import Traffic


class Brakes:
    """The braking of vehicles in one episode. A vehicle whose speed an event commands is braked only where it
    has to brake harder than the event makes it.
    """

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo = sumo
        self._traffic = traffic
        self._hard: set[str] = set()
        self.asked: dict[str, float] = {}
        """name of each vehicle that is braked -> m/s2"""
        self._left: set[str] = set()
        """names of those of them that events brake as hard or harder"""
        self._until_s = 0.0
        """until when they are braked, in SUMO's time"""
        self._grip = math.inf
        """m/s2, the road's grip when they were braked last"""
        self._events: dict[str, tuple[float, float]] = {}
        """name of a vehicle -> when events last slowed it down (s of SUMO's time), and how hard (m/s2)"""

    @property
    def are_over(self) -> bool:
        """Whether vehicles are no longer braked as they should be: `apply` was called for no longer, or the
        road's grip has changed since."""
        return self._sumo.time() >= self._until_s or self._grip != self._traffic.grip

    def apply(self, wanted: Mapping[str, tuple[float, float]], duration_s: float) -> None:
        """Brake vehicles for the next duration_s seconds, and release all others.

        `wanted`: name -> (present speed in m/s, deceleration in m/s2).
        """
        drivers, hard, now = self._traffic.drivers, set(), self._sumo.time()
        self.asked.clear()
        self._left.clear()
        self._grip = self._traffic.grip
        self._until_s = now + duration_s - ROUNDED_S
        for name, (speed, deceleration) in wanted.items():
            driver = drivers.get(name)
            self.asked[name] = deceleration
            anyway = driver is not None and driver.overridden  # it may brake hard
            if driver is None or (not anyway and deceleration > self._traffic.comfortable(driver.decel)):
                hard.add(name)
                self._traffic.set_mode(name, hard=True)  # each time anew: the grip may have changed
            if deceleration <= self._by_events(name, now):
                self._left.add(name)
                continue
            self._sumo.slow_down(name, max(speed - deceleration * duration_s, 0.0), duration_s)
        for name in self._hard - hard:
            if self._traffic.drives(name):
                self._traffic.set_mode(name)
        self._hard = hard

    def set_mode(self, name: str) -> None:
        """Have SUMO limit an SV's speed as the events that act on it say; it is still braked as hard as
        before."""
        hard = self.asked.get(name, 0.0) > self._traffic.comfortable(self._traffic.drivers[name].decel)
        if hard:
            self._hard.add(name)
        self._traffic.set_mode(name, hard=hard)

    def go_on(self) -> None:
        """Brake from now on those whom events braked as hard or harder, and no longer do at this decision."""
        now = self._sumo.time()
        if not self._left or self.are_over:
            return
        for name in sorted(self._left & self._traffic.drivers.keys()):
            if self._by_events(name, now) < self.asked[name]:
                self._left.discard(name)
                (speed, _), left_s = self._sumo.drive(name), self._until_s - now
                self._sumo.slow_down(name, max(speed - self.asked[name] * left_s, 0.0), left_s)

    def leave_to_event(self, name: str, deceleration: float) -> bool:
        """Note that an event slows a vehicle down with deceleration m/s2 until the next decision. Returns
        whether it may: False where the vehicle is being braked harder.
        """
        now = self._sumo.time()
        self._events[name] = now, max(deceleration, self._by_events(name, now))
        may = self.are_over or self.asked.get(name, -math.inf) <= deceleration
        if may and name in self.asked:
            self._left.add(name)
        return may

    def _by_events(self, name: str, now: float) -> float:
        """m/s2, how hard events slow a vehicle down at this decision; -inf if none does."""
        when, deceleration = self._events.get(name, (-math.inf, -math.inf))
        return deceleration if when == now else -math.inf
