"""A gradient update of the ensemble against the same update written as a loop over separate critics.

    python -m tests.benchmarks.critic_update [--threads 2] [--repeats 15] [--members 5] [--device cuda]

Two sizes: `paper` (attention networks, width 256, batch 256, the paper's observation) and `quick` (128 x 2 on
all features, batch 128). Against each stand up to four loops (tests/benchmarks/loop_learner.py): the same
networks number for number, the same with our matrix products, with a careful author's economies, and with the
usual key and value projections. They take turns of eight updates, so that a machine with other work to do
slows them alike; in training fifty come in a row. Ratios are those of the medians and of the fastest. On a
GPU ours are recorded (rudc/learning/recorded.py) in the turn that is not counted; all read their losses, and
so wait for the GPU, in each update.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import torch

from rudc.evaluation.memory import keep_freed_blocks
from rudc.learning.config import EnsembleConfig, Problem
from rudc.learning.products import widest_products
from rudc.learning.rudc import RudcLearner
from tests.benchmarks.loop_learner import LoopLearner
from tests.learning.helpers import Case, quick_case, random_batch

TURN = 8
"""updates in a row"""


def configurations(members: int) -> dict[str, Case]:
    """Sizes that are measured, by name."""
    return {
        "paper": Case(EnsembleConfig(members=members), Problem()),
        "quick": quick_case(members=members),
    }


def contestants(case: Case, device: str) -> dict[str, Callable[..., object]]:
    """Updates by name, ours first."""
    result: dict[str, Callable[..., object]] = {
        "stack": widest_products()(RudcLearner(*case, device).update),
        "loop": LoopLearner(*case, device).update,
        "lean loop": LoopLearner(*case, device, lean=True).update,
    }
    if device == "cpu":
        result["loop, our products"] = widest_products()(LoopLearner(*case).update)
    if case.config.critic.encoder == "attention":
        result["loop, projections"] = LoopLearner(*case, device, projections=True).update
    return result


def measure(case: Case, repeats: int, device: str) -> dict[str, list[float]]:
    """Seconds of each update, by name."""
    batches = [random_batch(case, case.config.batch_size, seed) for seed in range(4)]
    updates = contestants(case, device)
    seconds: dict[str, list[float]] = {name: [] for name in updates}
    for turn in range(-1, repeats):  # the first warms up
        for name, update in updates.items():
            for number in range(TURN):
                start = time.perf_counter()
                update(batches[number % len(batches)])
                if turn >= 0:
                    seconds[name].append(time.perf_counter() - start)
    return seconds


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=5, help="turns of each")
    parser.add_argument("--members", type=int, default=5)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    keep_freed_blocks()  # as the trainer does
    print(f"gradient update, {options.members} critics, {options.threads} threads, {options.device}")
    for size, case in configurations(options.members).items():
        seconds = measure(case, options.repeats, options.device)
        ours = seconds["stack"]
        print(f"{size:8s}{'stack':20s}{1e3 * float(np.median(ours)):8.1f} ms")
        for name, theirs in seconds.items():
            if name != "stack":
                median, least = np.median(theirs) / np.median(ours), min(theirs) / min(ours)
                ms = 1e3 * float(np.median(theirs))
                print(
                    f"{'':8s}{name:20s}{ms:8.1f} ms {median:5.2f} x of medians {least:5.2f} x of the fastest"
                )


if __name__ == "__main__":
    main()
