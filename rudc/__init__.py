"""RUDC: a SUMO-backed testbed for safe decision-making at unsignalized intersections.

Importing it registers `rudc/Intersection-v0`, so that `gymnasium.make` knows it.
"""

import gymnasium

__version__ = "0.1.0"

ENV_ID = "rudc/Intersection-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, entry_point="rudc.env.intersection:IntersectionEnv")
