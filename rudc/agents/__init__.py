"""Floor 4: whatever drives the ego vehicle, and the registry of their names."""
