"""RUDC: a SUMO-backed testbed for safe decision-making at unsignalized intersections."""

__version__ = "0.1.0"
