"""A whole decision, scene to safe action, on one core: outlook, observation, policy, critics, filter.

    python -m tests.benchmarks.whole_decision [--episodes 10]

In episodes of `dense_left_turn`, as agents drive them: the shipped `rudc-t` and `rudc-e`, and networks of the
paper's size (attention, width 256, five critics, the paper's observation) with untrained weights, behind a
filter that constrains all vehicles.
"""

from __future__ import annotations

import argparse
import os

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # read when numpy is imported

import numpy as np

from rudc.agents.base import Agent, Decision
from rudc.agents.learned import LearnedAgent
from rudc.agents.registry import agent_names, make_agent
from rudc.env.episode import Episode
from rudc.evaluation.rollout import run_episode
from rudc.learning.config import EnsembleConfig
from rudc.learning.parameters import critic_arrays, frozen_arrays, grouped, policy_arrays
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.training.config import TrainConfig
from rudc.world.world import World

PARTS = ("outlook", "observation", "policy", "critic", "correction")


def of_papers_size(algorithm: str) -> Agent:
    """Networks as in the paper, not trained, with slack and residual at work."""
    config = TrainConfig.of(algorithm, {"correction.slack.gain": 1.0}, "paper").agent
    learner, problem = config.learner, config.problem()
    assert isinstance(learner, EnsembleConfig)
    arrays = grouped(policy=policy_arrays(learner, problem), critic=critic_arrays(learner, problem))
    arrays |= frozen_arrays(learner, problem, {})
    return LearnedAgent(f"{algorithm}, paper's size", config, arrays, (5.0, 6.0))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--episodes", type=int, default=10)
    options = parser.parse_args()
    agents = [make_agent(name) for name in agent_names() if name in ("rudc-t", "rudc-e")]
    agents += [of_papers_size("rudc-t"), of_papers_size("rudc-e")]
    scenario = load_scenario("dense_left_turn")
    world = World(load_network(scenario.network, scenario.junction))
    print(
        f"{'ms':26s}" + "".join(f"{part:>16s}" for part in (*PARTS, "decision")) + "   median and p99 of each"
    )
    for agent in agents:
        decisions: list[Decision] = []
        keep = decisions.append
        for seed in range(options.episodes):
            plan = scenario.plan(seed)
            run_episode(Episode(world), plan, agent, watch=lambda _, decision, __, keep=keep: keep(decision))
        spent = np.array([[decision.timing_ms.get(part, 0.0) for part in PARTS] for decision in decisions])
        spent = np.column_stack([spent, spent.sum(axis=1)])
        median, late = np.percentile(spent, [50, 99], axis=0)
        cells = "".join(f"{m:8.3f}{p:8.3f}" for m, p in zip(median, late, strict=True))
        print(f"{agent.name:26s}{cells}   {len(decisions)} decisions")
    world.close()


if __name__ == "__main__":
    main()
