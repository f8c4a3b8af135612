"""Floor 2: the simulated world, and `Scene`, the world at one instant as arrays."""
