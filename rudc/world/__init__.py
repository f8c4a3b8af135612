"""The simulated world, and `Scene`, the world at one instant as arrays."""
