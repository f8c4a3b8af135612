"""Plays a scenario's events in the world: their script, and the stage they act on.

The kinds of event are in `rudc.scenario.events`, one file each.
"""

from rudc.scenario.events.event import numbered
from rudc.world.events.account import event_lines
from rudc.world.events.script import Happening, Script
from rudc.world.events.stage import WorldStage

__all__ = ["Happening", "Script", "WorldStage", "event_lines", "numbered"]
