"""Learns to drive: collection from parallel worlds, replay, trainer, logs. Imports torch."""
