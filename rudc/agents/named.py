"""That agents are given by their names."""

from __future__ import annotations

from rudc.errors import AgentError
from rudc.imports import shortened


def refuse_object(name: object) -> None:
    """Raise AgentError for anything that is given instead of an agent's name."""
    if not isinstance(name, str):
        raise AgentError(
            f"an agent is given by its name, not as {shortened(name)}; give one of your own a name, "
            'rudc.register_agent("mine", Class), or name the place of its class, "FILE.py:Class(speed=3)"'
        )
