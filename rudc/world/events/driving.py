"""Events that change how SVs drive, or how many: hard_brake, priority_violation, speeding, slow_vehicle, density_surge."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rudc.world.events.effect import Effect, Held
from rudc.world.scene import Scene
from rudc.world.sumo import HEEDLESS, OBEDIENT, OWN_SPEED

if TYPE_CHECKING:
    from rudc.scenario.events import DensitySurge, HardBrake, PriorityViolation, SlowVehicle, Speeding
    from rudc.world.events.stage import Stage


class HardBrakeEffect(Held["HardBrake"]):
    """A vehicle brakes for no reason the ego can see; it drives on when the event's duration has passed."""

    def command(self, stage: Stage, name: str, speed: float) -> None:
        slower = speed - float(self.event.deceleration) * stage.decision_s
        stage.sumo.command_speed(name, max(slower, 0.0), OBEDIENT)


class PriorityViolationEffect(Held["PriorityViolation"]):
    """A vehicle that takes no notice of who has the right of way; it still keeps its distance to its leader."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        begun = super().begin(stage, scene)
        for name in self.held:
            stage.traffic.drivers[name].mode = HEEDLESS
            stage.sumo.release(name, HEEDLESS)
            stage.unlawful.add(name)
        return begun

    def end(self, stage: Stage) -> None:
        _lawful_again(self.held, stage)
        super().end(stage)


class SpeedingEffect(Held["Speeding"]):
    """A vehicle that wants a multiple of the limit."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        begun = super().begin(stage, scene)
        for name in self.held:
            stage.sumo.personality(name, speed_factor=float(self.event.factor))
            stage.traffic.drivers[name].scripted = False
        return begun

    def end(self, stage: Stage) -> None:
        for name in self.held:
            if name in stage.traffic.drivers:
                stage.sumo.personality(name, speed_factor=1.0)
        super().end(stage)


class SlowVehicleEffect(Held["SlowVehicle"]):
    """A vehicle that goes no faster than a given speed."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        begun = super().begin(stage, scene)
        for name in self.held:
            stage.sumo.limit_speed(name, float(self.event.speed))
            stage.traffic.drivers[name].scripted = False
        return begun

    def end(self, stage: Stage) -> None:
        for name in self.held:
            if name in stage.traffic.drivers:
                stage.sumo.limit_speed(name, stage.traffic.drivers[name].type.max_speed)
        super().end(stage)


class DensitySurgeEffect(Effect["DensitySurge"]):
    """Another density, held by inflow from now on."""

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        self._before = stage.traffic.density
        stage.traffic.density = float(self.event.density)
        return True

    def end(self, stage: Stage) -> None:
        stage.traffic.density = self._before


def _lawful_again(names: list[str], stage: Stage) -> None:
    for name in names:
        stage.unlawful.discard(name)
        if name in stage.traffic.drivers:
            stage.traffic.drivers[name].mode = OWN_SPEED
