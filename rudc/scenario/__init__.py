"""Floor 1: YAML file -> validated `Scenario` -> (seed) -> concrete `EpisodePlan`. Knows nothing of SUMO."""
