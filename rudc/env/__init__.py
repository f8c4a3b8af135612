"""The Gymnasium environment: observation, action, reward, outcome, frames.

`import rudc` registers it. `gymnasium.make("rudc.env:rudc/Intersection-v0")` needs no import before it.
"""

from rudc import ENV_ID

__all__ = ["ENV_ID"]
