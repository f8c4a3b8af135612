"""Floor 1: YAML file -> validated frozen `Scenario` -> (seed) -> concrete `EpisodePlan`. Knows nothing of SUMO."""
