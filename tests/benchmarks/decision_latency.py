"""How long a decision's networks take on one core: policy, critics, uncertainty, in numpy and in torch.

    python -m tests.benchmarks.decision_latency [--repeats 1000]

Two sizes, as in critic_update.py. One observation at a time, another at every repeat; numpy and torch take
turns.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # read when numpy is imported

import numpy as np
import torch

from rudc.arrays import Floats
from rudc.learning.inference import Decider
from rudc.learning.rudc import RudcLearner
from rudc.learning.uncertainty import uncertainty
from tests.benchmarks.critic_update import configurations
from tests.learning.helpers import Case, observations


def parts(case: Case) -> dict[str, Callable[[Floats], object]]:
    """What is timed, by name; each takes an observation."""
    learner = RudcLearner(*case)
    decider = Decider(case.config, case.problem.layout, learner.weights())
    action = np.zeros(case.problem.actions, np.float32)
    quantiles = decider.quantiles(np.zeros(case.problem.layout.size, np.float32), action)

    def decide(observation: Floats) -> object:
        return decider.uncertainty(observation, decider.action(observation))

    def in_torch(observation: Floats) -> object:
        with torch.inference_mode():
            seen = torch.from_numpy(observation[None])
            mean, _ = learner.policy.distribution(learner.policy.trained, seen)
            z = learner.critics.evaluate(seen, mean.tanh())[:, 0]
        return uncertainty(z.numpy(), case.config.beta)

    return {
        "policy": decider.action,
        f"{case.config.members} critics": lambda observation: decider.quantiles(observation, action),
        "uncertainty": lambda _: uncertainty(quantiles, case.config.beta),
        "decision": decide,
        "decision in torch": in_torch,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=1000)
    options = parser.parse_args()
    torch.set_num_threads(1)
    for size, case in configurations(5).items():
        seen = observations(case.problem.layout, 64, np.random.default_rng(0))
        timed = parts(case)
        seconds: dict[str, list[float]] = {name: [] for name in timed}
        for turn in range(-20, options.repeats):
            for name, part in timed.items():
                start = time.perf_counter()
                part(seen[turn % 64])
                if turn >= 0:
                    seconds[name].append(time.perf_counter() - start)
        print(f"{size}: one decision, one core      median       p99")
        for name, values in seconds.items():
            median, late = 1e3 * np.percentile(values, [50, 99])
            print(f"  {name:28s}{median:9.3f} {late:9.3f} ms")
        ratio = np.median(seconds["decision in torch"]) / np.median(seconds["decision"])
        print(f"  torch / numpy {ratio:22.2f} x")


if __name__ == "__main__":
    main()
