"""Compiles what was never compiled on this machine, so that no worker process does so for itself.

python -m rudc.evaluation.compiled
"""

from __future__ import annotations

from importlib import import_module

from rudc.kernels import load_kernels

KERNELS = (
    "rudc.learning.kernels",
    "rudc.network.kernels",
    "rudc.world.kernels",
    "rudc.world.yielding_kernels",
    "rudc.env.kernels",
    "rudc.env.tracking_kernels",
    "rudc.safety.kernels",
    "rudc.safety.barrier_kernels",
    "rudc.safety.last_resort_kernels",
    "rudc.safety.plant_kernels",
    "rudc.safety.planar_kernels",
    "rudc.safety.qp_kernels",
    "rudc.safety.residual_kernels",
    "rudc.agents.kernels",
)
"""modules whose import loads all kernels, those of the modules that they import included"""


def compile_kernels(*, everything: bool = False, last_first: bool = False) -> None:
    """Compile (half a minute, the first time) or load (most of a second, later) the kernels that RUDC's
    modules have imported so far; with `everything`, those too that only kernels call. `last_first`: in
    reverse order.
    """
    for module in KERNELS:
        import_module(module)
    load_kernels(everything=everything, last_first=last_first)


def main() -> None:
    """Compile everything, in two processes that begin at the two ends."""
    import multiprocessing  # workers have no use for these
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as beside:
        rest = beside.submit(compile_kernels, everything=True, last_first=True)
        compile_kernels(everything=True)
        rest.result()


if __name__ == "__main__":
    main()
