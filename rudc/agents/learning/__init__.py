"""The learning core: distributional critic ensemble, policy, update, uncertainty, checkpoints.

Modules that decide (config, parameters, distortion, uncertainty, inference, checkpoint) need numpy only;
torch is imported by those that learn (networks, quantiles, ensemble, policy, sac).
"""
