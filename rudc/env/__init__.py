"""Floor 3: the Gymnasium face of the world: observation, reward, outcome, frames.

Importing this package registers `rudc/Intersection-v0`, so that `gymnasium.make` knows it.
"""

import gymnasium

ENV_ID = "rudc/Intersection-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, entry_point="rudc.env.intersection:IntersectionEnv")
