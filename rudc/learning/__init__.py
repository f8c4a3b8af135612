"""The learning core: distributional critic ensemble, policy, update, uncertainty, inference, checkpoints.

Modules that decide (config, parameters, distortion, uncertainty, inference, checkpoint) need numpy only;
torch is imported by those that learn (networks, attention, quantiles, ensemble, policy, sac).
"""
