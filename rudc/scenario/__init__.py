"""YAML file -> validated `Scenario` -> (seed) -> concrete `EpisodePlan`. Knows nothing of SUMO."""

from rudc.scenario.distributions import Distribution, distribution
from rudc.scenario.events import EVENT_KINDS, Event, register_event
from rudc.scenario.json_schema import json_schema
from rudc.scenario.library import shipped_scenarios
from rudc.scenario.loader import find_scenarios, load_scenario
from rudc.scenario.model import Scenario
from rudc.scenario.plan import EgoPlan, EpisodePlan, TrafficPlan
from rudc.scenario.selectors import Selector
from rudc.scenario.template import scenario_template
from rudc.scenario.triggers import Trigger

__all__ = [
    "EVENT_KINDS",
    "Distribution",
    "EgoPlan",
    "EpisodePlan",
    "Event",
    "Scenario",
    "Selector",
    "TrafficPlan",
    "Trigger",
    "distribution",
    "find_scenarios",
    "json_schema",
    "load_scenario",
    "register_event",
    "scenario_template",
    "shipped_scenarios",
]
