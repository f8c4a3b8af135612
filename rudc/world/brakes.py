"""Makes SUMO's vehicles brake as the yielding layer decides."""

from __future__ import annotations

from collections.abc import Mapping

from rudc.world.sumo import BRAKE_HARD, OWN_SPEED, Sumo
from rudc.world.traffic import Traffic
from rudc.world.vehicle_types import EGO


class Brakes:
    """The braking of vehicles in one episode. Vehicles whose speed an event commands are left alone."""

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo = sumo
        self._traffic = traffic
        self._hard: set[str] = set()
        self.asked: dict[str, float] = {}
        """name of each vehicle that is braked -> m/s2"""

    def apply(self, wanted: Mapping[str, tuple[float, float]], duration_s: float) -> None:
        """Brake vehicles for the next duration_s seconds, and release all others.

        `wanted`: name -> (present speed in m/s, deceleration in m/s2).
        """
        drivers, hard = self._traffic.drivers, set()
        self.asked.clear()
        for name, (speed, deceleration) in wanted.items():
            driver = drivers.get(name)
            if driver is not None and driver.overridden:
                continue
            if driver is None or deceleration > self._traffic.comfortable(driver.decel):
                hard.add(name)
                if name not in self._hard:
                    self._sumo.set_mode(name, BRAKE_HARD)
            self.asked[name] = deceleration
            self._sumo.slow_down(name, max(speed - deceleration * duration_s, 0.0), duration_s)
        for name in self._hard - hard:
            if name == EGO:
                self._sumo.set_mode(name, OWN_SPEED)
            elif name in drivers and not drivers[name].overridden:
                self._sumo.set_mode(name, drivers[name].mode)
        self._hard = hard
