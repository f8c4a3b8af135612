"""What the priors are worth, offline: the same transitions, critics learnt anew under each kind of prior.

    python -m tests.benchmarks.prior_trial [--decisions 4000] [--updates 6000]
        [--seeds 2] [--first-seed 0] [--kinds NAME...]

A shipped policy drives (exploring) on both tasks; critics of its value are learnt from what it saw, its
policy fixed. Then: do they know situations that they never saw (held-out scenarios) from those that they
did (other episodes of the tasks)? Printed for each kind of prior: share of the prior's variance over
states, outputs and members that is constant over states; standard deviation over states, reward units; and
the AUROC of sigma_epi and sigma_total between the two.

    none         rho = 0
    as drawn     outputs as they come
    normalised   root mean square prior_scale over outputs and the states seen (what ships)
    centred      each output with mean 0 and standard deviation prior_scale over the states seen
    one value    the same, one output added to all quantiles alike
    x 3          centred, three times as large
"""

from __future__ import annotations

import argparse

import numpy as np
import torch

from rudc.agents.checkpoint import load_learnt, shipped_checkpoints
from rudc.agents.learned import LearnedAgent, load_learned
from rudc.arrays import Floats
from rudc.env.episode import Episode, Outcome
from rudc.env.observation import observe_flat
from rudc.learning.config import EnsembleConfig, Problem
from rudc.learning.nstep import NStep, Transition
from rudc.learning.parameters import group, prior_arrays
from rudc.learning.replay import Replay
from rudc.learning.rudc import RudcLearner
from rudc.learning.uncertainty import uncertainty
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.studies.base import in_distribution, out_of_distribution
from rudc.training.config import TrainConfig
from rudc.world.world import World

KINDS = ("none", "as drawn", "normalised", "centred", "one value", "x 3")


def drive(scenarios: list[str], decisions: int, first_seed: int, config: TrainConfig) -> list[Transition]:
    """So many decisions of the policy, exploring, in turns on the scenarios."""
    agent = _shipped()
    rng, steps = np.random.default_rng(first_seed), NStep(config.learner.n_step, config.learner.discount)
    new: list[Transition] = []
    share = -(-decisions // len(scenarios))
    for name in scenarios:
        scenario, seed, taken = load_scenario(name), first_seed, 0
        with World(load_network(scenario.network, scenario.junction)) as world:
            while taken < share:
                episode = Episode(world)
                scene = episode.reset(scenario.plan(seed))
                agent.reset(scene, seed)
                seed += 1
                while episode.outcome is None:
                    choice = agent.choose(scene, rng)
                    result = episode.step(choice.decision.u)
                    scene = result.scene
                    ended, frozen = result.outcome is not None, result.outcome is Outcome.FROZEN
                    new += steps.add(
                        choice.observation, choice.executed, choice.proposed, result.reward, result.cost,
                        observe_flat(scene, "conflict"), terminal=ended and not frozen, truncated=frozen,
                    )  # fmt: skip
                    taken += 1
    return new


def _shipped() -> LearnedAgent:
    """Its policy is the one whose decisions are looked at, without the outlook."""
    return load_learned("rudc-wo-cbf", shipped_checkpoints()["rudc-wo-cbf"], {})


def learnt(kind: str, data: list[Transition], seed: int, updates: int) -> tuple[RudcLearner, float, float]:
    """Critics under that kind of prior; constant share and spread of it."""
    base = TrainConfig.of("rudc-wo-cbf").learner
    assert isinstance(base, EnsembleConfig)
    values = base.model_dump() | {"actor_rate": (0.0, 0.0)}
    if kind == "none":
        values |= {"prior_factor": 0.0}
        del values["prior_scale"]
    if kind == "x 3":
        values["prior_scale"] *= 3
    config = EnsembleConfig.model_validate(values)
    problem = Problem(TrainConfig.of("rudc-wo-cbf").given.layout, 2, seed, updates)
    learner = RudcLearner(config, problem)
    shipped = group(load_learnt(shipped_checkpoints()["rudc-wo-cbf"]).arrays, "policy")
    with torch.no_grad():
        for weights in (learner.policy.trained, learner.policy.target):
            for name, tensor in weights.items():
                tensor.copy_(torch.from_numpy(shipped[name]))
    replay = Replay(problem, len(data), *learner.masks)
    for transition in data:
        replay.add(transition)
    seen = replay.first(2_000)
    if kind == "normalised":
        learner.start(seen)
    if kind in ("centred", "one value", "x 3"):
        centre(learner, seen.observation, seen.executed, one=kind == "one value")
    constant, spread = prior_statistics(learner, seen.observation, seen.executed)
    for _ in range(updates):
        learner.update(replay.sample(config.batch_size))
    return learner, constant, spread


def centre(learner: RudcLearner, observation: Floats, action: Floats, *, one: bool) -> None:
    """Give each output of the priors mean 0 and standard deviation 1; `one`: the first for all quantiles."""
    prior = learner.critics.prior
    with torch.no_grad():
        if one:
            for name in ("out.weight", "out.bias"):
                prior[name].copy_(prior[name][..., :1].expand_as(prior[name]))
        latent = learner.critics.prior_latent(torch.from_numpy(observation))
        assert latent is not None
        z = learner.critics.stack.decode(prior, latent, torch.from_numpy(action))
        mean, deviation = z.mean(1, keepdim=True), z.std(1, keepdim=True)
        prior["out.weight"].div_(deviation)
        prior["out.bias"].sub_(mean).div_(deviation)


def prior_statistics(learner: RudcLearner, observation: Floats, action: Floats) -> tuple[float, float]:
    """Share of F's variance over states, outputs and members that is constant over states; its standard
    deviation over states, reward units.
    """
    if not prior_arrays(learner.config, learner._problem):
        return float("nan"), float("nan")
    latent = learner.critics.prior_latent(torch.from_numpy(observation))
    assert latent is not None
    with torch.no_grad():
        f = learner.critics.stack.decode(learner.critics.prior, latent, torch.from_numpy(action)).numpy()
    f = f * learner.config.prior_scale
    within = f.var(axis=1).mean()
    between = f.mean(axis=1).var()
    return float(between / (within + between)), float(np.sqrt(within))


def auroc(known: Floats, unknown: Floats) -> float:
    """Chance that a sigma of an unknown situation is the larger one."""
    ranks = np.concatenate([known, unknown]).argsort().argsort()
    wins = ranks[len(known) :].sum() - len(unknown) * (len(unknown) - 1) / 2
    return float(wins / (len(known) * len(unknown)))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--decisions", type=int, default=4000)
    parser.add_argument("--updates", type=int, default=6000)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    options = parser.parse_args()
    torch.set_num_threads(1)
    config = TrainConfig.of("rudc-wo-cbf")
    tasks = [scenario.name for scenario in in_distribution()]
    others = [scenario.name for scenario in out_of_distribution("quick")]
    data = drive(tasks, options.decisions, 2_000_000, config)
    known = drive(tasks, options.decisions // 4, 3_000_000, config)
    unknown = drive(others, options.decisions // 4, 3_000_000, config)
    print(
        f"{len(data)} transitions; {len(known)} held out, {len(unknown)} of {', '.join(others)}", flush=True
    )
    print(f"{'prior':12s} {'constant':>9s} {'spread':>7s} {'epi':>6s} {'total':>6s}   seeds: epi, total")
    sides = [
        (np.stack([t.observation for t in part]), np.stack([t.proposed for t in part]))
        for part in (known, unknown)
    ]
    for kind in options.kinds:
        found = []
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            learner, constant, spread = learnt(kind, data, seed, options.updates)
            parts = [
                uncertainty(learner.critics.evaluate(torch.from_numpy(o), torch.from_numpy(a)).numpy(), 0.25)
                for o, a in sides
            ]
            found.append(
                (auroc(parts[0].epistemic, parts[1].epistemic), auroc(parts[0].total, parts[1].total))
            )
        epi, total = np.mean(found, axis=0)
        each = "  ".join(f"{a:.3f}, {b:.3f}" for a, b in found)
        print(f"{kind:12s} {constant:9.2f} {spread:7.2f} {epi:6.3f} {total:6.3f}   {each}", flush=True)


if __name__ == "__main__":
    main()
