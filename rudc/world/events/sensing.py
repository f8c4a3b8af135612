"""Events that change the ego: sensor_noise, sensor_dropout, low_friction, actuator_delay."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from rudc.scenario.events import ActuatorDelay, LowFriction, SensorDropout, SensorNoise
from rudc.world.ego import GRAVITY
from rudc.world.events.effect import Effect
from rudc.world.scene import Scene

if TYPE_CHECKING:
    from rudc.world.events.stage import Stage


class SensorNoiseEffect(Effect[SensorNoise]):
    """Gaussian errors on what the ego sees of others."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        stage.sensors.position_std = float(self.event.position)
        stage.sensors.speed_std = float(self.event.speed)
        stage.sensors.heading_std = self.event.heading_rad
        return True


class SensorDropoutEffect(Effect[SensorDropout]):
    """Others go unseen at random, and beyond a range."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        stage.sensors.miss = float(self.event.probability)
        stage.sensors.range_m = math.inf if self.event.range is None else float(self.event.range)
        return True


class LowFrictionEffect(Effect[LowFriction]):
    """A slippery road, for the ego and for SVs: nobody brakes, accelerates or turns harder than mu g."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        mu = float(self.event.friction)
        stage.plant.actuation = replace(stage.plant.actuation, friction=mu)
        stage.traffic.lose_grip(mu * GRAVITY)
        return True


class ActuatorDelayEffect(Effect[ActuatorDelay]):
    """The ego's commands arrive late and are followed with a lag."""

    from_the_start = True

    def begin(self, stage: Stage, scene: Scene | None) -> bool:
        delay, lag = float(self.event.delay), float(self.event.lag)
        stage.plant.actuation = replace(stage.plant.actuation, delay_s=delay, lag_s=lag)
        return True
