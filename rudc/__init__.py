"""RUDC: a SUMO-backed testbed for safe decision-making at unsignalized intersections.

Importing it registers `rudc/Intersection-v0` (rudc/registration.py), so that `gymnasium.make` knows it.
`rudc.register_agent` and the other `register_...` functions give a name to an agent, an event or another part
that a user has written; CONTRIBUTING.md says what can be added, and how.
"""

import importlib
from typing import Any

from rudc.registration import ENV_ID, register_environment

__version__ = "1.0.0"

__all__ = ["ENV_ID"]

register_environment()

PUBLIC = {
    "SafetyFilterWrapper": "rudc.agents.wrapper",
    "register_agent": "rudc.agents.drivers",
    "register_algorithm": "rudc.learning.algorithms",
    "register_barrier": "rudc.safety.barriers",
    "register_event": "rudc.scenario.events",
    "register_rule": "rudc.safety.rules",
}
"""name that can be imported from here -> module that defines it; the module is imported when the name is
first used"""


def __getattr__(name: str) -> Any:
    if name in PUBLIC:
        return getattr(importlib.import_module(PUBLIC[name]), name)
    raise AttributeError(f"module 'rudc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})
