"""An event of one's own: what a scenario may say of it (a model), and what it does (an effect).

    rudc --import examples/own_event.py run examples/gusts.yaml --agent follower

`--import` runs this file before the scenario is read, so that `kind: gust` is known to it.
"""

from typing import Annotated, Literal

from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events import Felt, Stage, register_event
from rudc.scenario.events.event import Duration, Event
from rudc.world.ego import DRY


class Gust(Event, frozen=True):
    """Wet leaves, blown onto the road."""

    kind: Literal["gust"]
    friction: Annotated[AnyDistribution, Bounds(0.1, 1.2)]
    """coefficient of friction while it lasts"""
    duration: Duration | None = None
    """s; by default for good"""


class GustEffect(Felt[Gust]):
    """The road is slippery until the duration, if there is one, has passed."""

    def begin(self, stage: Stage) -> bool:
        """Called when `when` of the event holds; True: it has begun."""
        stage.set_friction(float(self.event.friction))
        return True

    def end(self, stage: Stage) -> None:
        """Called when the duration has passed."""
        stage.set_friction(DRY)


register_event(Gust, GustEffect)
