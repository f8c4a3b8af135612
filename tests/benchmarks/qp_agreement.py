"""The filter's QPs of real episodes, solved by ours and by three other solvers.

    python -m tests.benchmarks.qp_agreement [--problems N]

The traffic-ignoring follower drives the two tasks of the paper with each filter behind it, `gated` and `all`,
until there are enough problems that needed solving. Prints, for each of those, the largest difference
between the solutions in (a m/s2, z) and how often the two disagree on whether there is one.
"""

from __future__ import annotations

import argparse
from itertools import count, product

import numpy as np

from rudc.agents.correction import CbfCorrection, CbfSettings
from rudc.agents.filtered import FilteredAgent
from rudc.agents.follower import Follower
from rudc.env.episode import Episode
from rudc.network.network import load_network
from rudc.safety.qp import Problem, Solution, make_solver
from rudc.scenario import load_scenario
from rudc.world.world import World

OTHERS = ("piqp", "daqp", "quadprog")
SCENARIOS = ("random_destination", "dense_left_turn")


def collect(episode: Episode, scenario: str, config: CbfSettings, wanted: int) -> list[Problem]:
    """The first `wanted` problems of a scenario in which the proposed action did not satisfy every row."""
    source, problems = load_scenario(scenario), []
    correction = CbfCorrection(config, {})
    agent = FilteredAgent(Follower(), "follower", correction)
    for seed in count():
        scene = episode.reset(source.plan(seed))
        agent.reset(scene, seed)
        while episode.outcome is None:
            decision = agent.act(scene)
            problem = correction.filter.last_problem
            if (
                problem is not None
                and decision.corrected is not None
                and decision.corrected.status != "nominal"
            ):
                problems.append(problem)
                if len(problems) == wanted:
                    return problems
            scene = episode.step(decision.u).scene
    return problems


def compare(problems: list[Problem]) -> None:
    """Print how far the other solvers' answers lie from ours."""
    solutions = {name: _solve(name, problems) for name in ("planar", *OTHERS)}
    ours = solutions["planar"]
    print(f"{len(problems)} problems; ours solves {sum(s.found for s in ours)}, the rest have no solution")
    for name in OTHERS:
        theirs = solutions[name]
        both = [(a, b) for a, b in zip(ours, theirs, strict=True) if a.found and b.found]
        disagree = sum(a.found != b.found for a, b in zip(ours, theirs, strict=True))
        furthest = max(float(np.abs(a.x - b.x).max()) for a, b in both)
        print(f"  {name:9s} largest difference {furthest:.1e}, disagrees on solvability in {disagree}")


def _solve(name: str, problems: list[Problem]) -> list[Solution]:
    solver = make_solver(name)
    return [solver.solve(problem) for problem in problems]


def main() -> None:
    """Collect and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--problems", type=int, default=10_000)
    wanted = parser.parse_args().problems
    cases = list(product(SCENARIOS, ("ttcbf", "ecbf"), ("gated", "all")))
    problems = []
    with World(load_network("four_way")) as world:
        episode = Episode(world)
        for scenario, kind, constrained in cases:
            config = CbfSettings.preset(kind, constrained=constrained)
            problems += collect(episode, scenario, config, -(-wanted // len(cases)))
    compare(problems)


if __name__ == "__main__":
    main()
