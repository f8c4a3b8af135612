"""Events: what a scenario scripts to go wrong. A new kind is one model in `rudc.scenario.events` and one
class here."""

from rudc.world.events.script import Happening, Script
from rudc.world.events.stage import Stage

__all__ = ["Happening", "Script", "Stage"]
