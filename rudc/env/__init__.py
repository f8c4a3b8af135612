"""The Gymnasium face of the world: observation, reward, outcome, frames.

`import rudc` registers it; `gymnasium.make("rudc.env:rudc/Intersection-v0")` does so by itself.
"""

from rudc import ENV_ID

__all__ = ["ENV_ID"]
