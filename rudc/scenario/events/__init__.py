"""What happens in an episode besides ordinary traffic: one file a kind, with its model and its effect.

Positions are in m east and north of the junction's centre; lanes are named `ARM_in_INDEX` and `ARM_out_INDEX`
(0 = rightmost), `at` in m outwards from the stop line, or on an outbound lane from the junction's exit; lanes
inside the junction, on a ring, and about the ego (`ego_in`, `left_of_ego`) as `rudc.network.stretches` says.
Files give angles in degrees, and the properties ending in `_rad` give radians.

An event of your own, registered before a scenario that has it is read:

    class OilSpill(Event, frozen=True):
        kind: Literal["oil_spill"]
        friction: Annotated[AnyDistribution, Bounds(0.03, 1.2)]

    class OilSpillEffect(Felt[OilSpill]):
        def begin(self, stage: Stage) -> bool:
            stage.set_friction(float(self.event.friction))
            return True

    register_event(OilSpill, OilSpillEffect)
"""

from rudc.scenario.events.event import Effect, Event, Felt, Held, Passing, VehicleEvent
from rudc.scenario.events.registry import EVENT_KINDS, AnyEvent, effect_of, register_event
from rudc.scenario.events.stage import Stage

__all__ = [
    "EVENT_KINDS",
    "AnyEvent",
    "Effect",
    "Event",
    "Felt",
    "Held",
    "Passing",
    "Stage",
    "VehicleEvent",
    "effect_of",
    "register_event",
]
