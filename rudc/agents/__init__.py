"""Whatever drives the ego vehicle, and the registry of their names."""
