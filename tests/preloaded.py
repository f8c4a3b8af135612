"""What the server of worker processes imports where a process of tests starts it: as usual, what workers of
trainings need besides, and the network that most tests drive on, with its routes.

A worker is a fork of it, and need not import or build them for the one or two episodes that it drives.
Commands that tests start as users do, in processes of their own, know nothing of this.
"""

import gc

import rudc.evaluation.preloaded
import rudc.training.collect  # noqa: F401
from rudc.evaluation.compiled import compile_kernels
from rudc.network.network import load_network

compile_kernels()  # again: those that came with `collect`, which each worker would load for itself
_network = load_network("four_way")
for _arm in _network.arms:
    for _turn in ("left", "straight", "right"):
        _network.route(_arm.name, _turn)
gc.freeze()  # again: workers need not look through it, nor copy its pages
