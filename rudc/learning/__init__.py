"""Learning: critics, policies, temperature, multiplier, replay, n-step; one file an algorithm.

Modules that decide (config, algorithms, parameters, distortion, uncertainty, inference, replay, checkpoint)
need numpy only; torch is imported by those that learn (networks, attention, quantiles, ensemble, twins,
observer, policy, and the learners: rudc, sac, sac_lagrangian).
"""
