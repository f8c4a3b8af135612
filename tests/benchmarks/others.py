"""Our learners beside others' code, on the same environment, networks of the same width and equal steps.

    python -m tests.benchmarks.others dsac sac-lagrangian --out DIR [--steps 10000] [--episodes 40] [--seed 0]
    python -m tests.benchmarks.others tqc --out DIR        # where sb3-contrib is installed
    python -m tests.benchmarks.others saclag --out DIR     # where OmniSafe is: examples/omnisafe_env.py
    python -m tests.benchmarks.others --out DIR            # the table of all that is there

TQC is sb3-contrib's (two critics of 25 quantiles, two of each dropped), against our DSAC (two of 25, the
smaller of each). SACLag is OmniSafe's, against our Lagrangian, both with a multiplier held at 1. All: the
same observation and actions (those of examples/), no courses, nobody who drives first, no curriculum, rewards
and costs as the environment gives them, one-step returns, two hidden layers of 128 (ours: three), an update
in two decisions, on 128 transitions, one learning rate, the temperature learnt from 0.2. Then each drives the
same episodes by its policy's mean; `nothing` is the action 0, which follows the path and looks at nobody.
Rewards and costs are expected to be of the same order, no more: initial weights and episodes differ.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import rudc
from rudc.agents.checkpoint import load_learnt
from rudc.evaluation.statistics import summarise_all, summarise_rate
from rudc.evaluation.text import csv_text, interval, markdown
from rudc.learning.inference import Decider

SCENARIO, OBSERVATION, ACTION = "random_destination", "conflict", "adjustment"
FIRST_EPISODE = 50_000
"""seed of the first episode that is driven in the end"""
STARTS, RATE, BATCH, WIDTH, EVERY, TEMPERATURE = 1_000, 3e-4, 128, 128, 2, 0.2
QUANTILES = 25
Act = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Order:
    """What is asked for."""

    out: Path
    steps: int
    episodes: int
    seed: int


SETTINGS = {
    "outlook.course": "false",
    "outlook.plant": "off",
    "learner.n_step": 1,
    "learner.batch_size": BATCH,
    "learner.policy.hidden": WIDTH,
    "learner.critic.hidden": WIDTH,
    "learner.actor_rate": f"[{RATE}, {RATE}]",
    "learner.critic_rate": f"[{RATE}, {RATE}]",
    "learner.temperature_rate": RATE,
    "learner.temperature": TEMPERATURE,
    "learner.temperature_floor": 0.0001,
    "training.scenario": SCENARIO,
    "training.curriculum": "null",
    "training.collision_reward": -50.0,
    "training.seed_steps": 0,
    "training.update_every": EVERY,
    "training.evaluation_episodes": 0,
}
"""of our trainings"""
OWN = {
    "dsac": {"learner.quantiles": QUANTILES},
    "sac-lagrangian": {"learner.multiplier": 1.0, "learner.multiplier_rate": 0.0},
    "sac": {},
}


def ours(name: str, order: Order) -> Act:
    """Train one of ours; its policy's mean."""
    folder = order.out / f"{name}-training"
    settings = {**SETTINGS, "training.learning_starts": starts(order), **OWN[name]}
    command = [sys.executable, "-m", "rudc", "train", name, "--steps", str(order.steps)]
    command += ["--seed", str(order.seed), "--out", str(folder)]
    subprocess.run([*command, *(f"--set={key}={value}" for key, value in settings.items())], check=True)
    learnt = load_learnt(folder / "checkpoint")
    return Decider(learnt.config.learner, learnt.config.problem().layout, learnt.arrays).action


def starts(order: Order) -> int:
    """Decisions before the first update."""
    return min(STARTS, order.steps // 2)


def tqc(order: Order) -> Act:
    """Train sb3-contrib's."""
    from sb3_contrib import TQC

    model = TQC(
        "MlpPolicy",
        make(),
        learning_rate=RATE,
        batch_size=BATCH,
        learning_starts=starts(order),
        train_freq=EVERY,
        gradient_steps=1,
        ent_coef=f"auto_{TEMPERATURE}",
        policy_kwargs={"net_arch": [WIDTH, WIDTH], "n_quantiles": QUANTILES},
        seed=order.seed,
        device="cpu",
    )
    model.learn(order.steps)
    model.get_env().close()
    return lambda observation: model.predict(observation, deterministic=True)[0]


def saclag(order: Order) -> Act:
    """Train OmniSafe's, by the example's adapter."""
    import torch

    import examples.omnisafe_env as adapter

    settings: dict[str, Any] = {
        "seed": order.seed,
        "train_cfgs": {"total_steps": order.steps, "vector_env_nums": 1, "torch_threads": 1},
        "algo_cfgs": {
            "steps_per_epoch": order.steps // 10,
            "update_cycle": EVERY,
            "batch_size": BATCH,
            "start_learning_steps": starts(order),
            "alpha": TEMPERATURE,
            "auto_alpha": True,
            "cost_normalize": False,
            "policy_delay": 1,
        },
        "model_cfgs": {
            "actor": {"hidden_sizes": [WIDTH, WIDTH], "lr": RATE},
            "critic": {"hidden_sizes": [WIDTH, WIDTH], "lr": RATE},
        },
        "lagrange_cfgs": {"lagrangian_multiplier_init": 1.0, "lambda_lr": 0.0},
        "logger_cfgs": {
            "use_wandb": False, "use_tensorboard": False, "log_dir": str(order.out / "saclag-training")
        },
    }  # fmt: skip
    agent = adapter.omnisafe.Agent("SACLag", "RudcIntersection-v0", custom_cfgs=settings)
    agent.learn()
    actor = agent.agent._actor_critic.actor

    def act(observation: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            action = actor.predict(torch.as_tensor(observation, dtype=torch.float32), deterministic=True)
        return action.numpy()

    return act


def make() -> gymnasium.Env:
    """The environment that all learn in."""
    return gymnasium.make(rudc.ENV_ID, scenario=SCENARIO, observation=OBSERVATION, action=ACTION)


def drive(act: Act, episodes: int) -> list[dict[str, Any]]:
    """A row for each of the episodes that all drive in the end."""
    env, rows = make(), []
    for seed in range(FIRST_EPISODE, FIRST_EPISODE + episodes):
        observation, info = env.reset(seed=seed)
        reward = cost = 0.0
        ended = False
        while not ended:
            action = np.asarray(act(observation), np.float32)
            observation, gained, terminated, truncated, info = env.step(action)
            reward, cost, ended = reward + float(gained), cost + float(info["cost"]), terminated or truncated
        rows.append({"seed": seed, "reward": reward, "cost": cost, "outcome": info["outcome"]})
    env.close()
    return rows


def table(out: Path) -> str:
    """What all found, with 95 % intervals over episodes."""
    lines = []
    for name in NAMES:
        if (out / f"{name}.csv").is_file():
            with open(out / f"{name}.csv", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            sums = summarise_all(
                [(np.array([float(row[key]) for row in rows]), None) for key in ("reward", "cost")]
            )
            ends = [row["outcome"] for row in rows]
            rates = [
                summarise_rate(np.array([end in kinds for end in ends]))
                for kinds in (("success",), ("frozen",), ("collision", "off_road", "wrong_way"))
            ]
            lines.append([name, str(len(rows)), *(interval(*(s.mean, s.low, s.high)) for s in sums + rates)])
    return markdown(["", "episodes", "reward", "cost", "SR (%)", "FR (%)", "VR (%)"], lines)


THEIRS: dict[str, Callable[[Order], Act]] = {"tqc": tqc, "saclag": saclag}
NAMES = ("nothing", *OWN, *THEIRS)


def run(name: str, order: Order) -> None:
    """Train and drive one, and keep its rows."""
    order.out.mkdir(parents=True, exist_ok=True)
    if name == "nothing":
        act: Act = lambda _: np.zeros(2, np.float32)  # noqa: E731 -- a policy of one line
    else:
        act = THEIRS[name](order) if name in THEIRS else ours(name, order)
    (order.out / f"{name}.csv").write_text(csv_text(drive(act, order.episodes)), encoding="utf-8")


def main() -> None:
    """Run those named, one after another, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--episodes", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if unknown := [name for name in given.names if name not in NAMES]:
        parser.error(f"there is no {unknown[0]}; there are {', '.join(NAMES)}")
    order = Order(given.out.resolve(), given.steps, given.episodes, given.seed)
    for name in given.names:
        run(name, order)
    print(table(order.out))


if __name__ == "__main__":
    main()
