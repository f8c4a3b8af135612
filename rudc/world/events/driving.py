"""Events that change how SVs drive, or how many: hard_brake, priority_violation, speeding, slow_vehicle,
density_surge."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rudc.scenario.events import DensitySurge, HardBrake, PriorityViolation, SlowVehicle, Speeding
from rudc.world.events.effect import Effect, Held
from rudc.world.scene import Scene
from rudc.world.sumo import BRAKE_HARD, HEEDLESS, OWN_SPEED

if TYPE_CHECKING:
    from rudc.world.events.stage import Stage


class HardBrakeEffect(Held[HardBrake]):
    """A vehicle brakes for no reason the ego can see; it drives on when the event's duration has passed."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, BRAKE_HARD)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, OWN_SPEED)

    def command(self, stage: Stage, name: str, speed: float) -> None:
        slower = speed - float(self.event.deceleration) * stage.decision_s
        stage.sumo.slow_down(name, max(slower, 0.0), stage.decision_s)


class PriorityViolationEffect(Held[PriorityViolation]):
    """A vehicle that takes no notice of who has the right of way; it still keeps its distance to its
    leader."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, HEEDLESS)
        stage.unlawful.add(name)

    def let_go(self, stage: Stage, name: str) -> None:
        stage.sumo.set_mode(name, OWN_SPEED)
        stage.unlawful.discard(name)


class SpeedingEffect(Held[Speeding]):
    """A vehicle that wants a multiple of the limit."""

    overrides = False

    def hold(self, stage: Stage, name: str) -> None:
        stage.sumo.personality(name, speed_factor=float(self.event.factor))

    def let_go(self, stage: Stage, name: str) -> None:
        stage.sumo.personality(name, speed_factor=stage.traffic.drivers[name].speed_factor)


class SlowVehicleEffect(Held[SlowVehicle]):
    """A vehicle that goes no faster than a given speed."""

    overrides = False

    def hold(self, stage: Stage, name: str) -> None:
        stage.sumo.limit_speed(name, float(self.event.speed))

    def let_go(self, stage: Stage, name: str) -> None:
        stage.sumo.limit_speed(name, stage.traffic.drivers[name].type.max_speed)


class DensitySurgeEffect(Effect[DensitySurge]):
    """Another density, held by inflow from now on."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        self._before = stage.traffic.density
        stage.traffic.density = float(self.event.density)
        return True

    def end(self, stage: Stage) -> None:
        stage.traffic.density = self._before
