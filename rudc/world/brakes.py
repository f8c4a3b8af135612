"""Has SUMO's vehicles brake as the yielding layer decides."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from rudc.world.sumo import BRAKE_HARD, OWN_SPEED, Sumo
from rudc.world.traffic import EGO, Traffic


class Brakes:
    """Of one episode. Vehicles that an event commands are left alone. Those that it has disregard the right
    of way brake for the ego as for any leader: where they drive behind it.
    """

    def __init__(self, sumo: Sumo, traffic: Traffic) -> None:
        self._sumo = sumo
        self._traffic = traffic
        self._hard: set[str] = set()

    def apply(
        self, wanted: Mapping[str, tuple[float, float]], duration_s: float, behind_ego: Collection[str]
    ) -> None:
        """For the next duration_s: name -> (speed now in m/s, deceleration in m/s2). All others go free.

        `behind_ego`: names of those who drive behind it.
        """
        drivers, hard = self._traffic.drivers, set()
        for name, (speed, deceleration) in wanted.items():
            driver = drivers.get(name)
            if driver is not None and (driver.overridden or (driver.heedless and name not in behind_ego)):
                continue
            if driver is None or deceleration > min(driver.decel, self._traffic.grip):
                hard.add(name)
                if name not in self._hard:
                    self._sumo.set_mode(name, BRAKE_HARD)
            self._sumo.slow_down(name, max(speed - deceleration * duration_s, 0.0), duration_s)
        for name in self._hard - hard:
            if name == EGO:
                self._sumo.set_mode(name, OWN_SPEED)
            elif name in drivers and not drivers[name].overridden:
                self._sumo.set_mode(name, drivers[name].mode)
        self._hard = hard
