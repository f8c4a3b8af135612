"""The learning core: distributional critic ensemble, policy, update, uncertainty, inference.

Modules that decide (config, parameters, distortion, uncertainty, inference) need numpy only; torch is imported
by those that learn (networks, quantiles, ensemble, policy, sac).
"""
