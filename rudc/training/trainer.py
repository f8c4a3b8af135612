"""Training: rounds in which worlds collect while the learner learns from what they had collected before.

In round r

    workers  take `round_steps` decisions with the policy as it was at the end of round r-1
    learner  takes a gradient step for every `update_every` decisions on the replay as it was then
    then     what was collected goes into the replay, in the order of the workers

Both sides depend only on the end of the round before, so they run at the same time and the numbers do not
depend on which is faster. Worlds draw from generators made from (seed, world, round), the learner and the
replay from their own, which checkpoints hold; and every checkpoint falls on a round after which all worlds
begin new episodes: a training that is stopped and resumed goes the same way as one that is not.

The first `seed_steps` decisions are those of the gap-acceptance driver, since a policy that starts from
nothing meets the far side of the junction too rarely to learn what lies there.
"""

from __future__ import annotations

import json
import math
import shutil
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from rudc.agents.checkpoint import LATEST, Learnt, save_learnt
from rudc.arrays import Arrays
from rudc.env.outcome import Outcome
from rudc.errors import AgentError, InputError, PartFailedError, TrainingError
from rudc.evaluation.memory import keep_freed_blocks
from rudc.files import aside_of, replace_folder, write_atomically
from rudc.hints import listed
from rudc.imports import is_own
from rudc.learning.checkpoint import load_state, save_state
from rudc.learning.guarded import GuardedLearner
from rudc.learning.learner import Learner, Statistics
from rudc.learning.nstep import Transition
from rudc.learning.parameters import group, grouped
from rudc.learning.products import widest_products
from rudc.learning.replay import Replay
from rudc.learning.threads import torch_threads
from rudc.learning.uncertainty import RunningPercentiles
from rudc.training.calibration import Measured, calibration_tasks, measured
from rudc.training.collect import Finished
from rudc.training.config import TrainConfig
from rudc.training.curriculum import HELD_OUT_SEED, held_out, make_mixture
from rudc.training.folder import (
    CONFIG,
    check_folder,
    held,
    keep_inputs,
    otherwise,
    refuse_lost,
    sources_now,
    with_files,
)
from rudc.training.log import Log, Watcher, episode_columns, evaluation_rows
from rudc.training.workers import WorkerPool

STATE, REPLAY, COUNTERS = "training.safetensors", "replay.npz", "training.json"
SIGMA_ROWS = 64
"""decisions of each round whose uncertainty goes into the percentiles"""


class Trainer:
    """Trains one agent into a folder."""

    def __init__(
        self, config: TrainConfig, folder: Path, watcher: Watcher, driven: TrainConfig | None = None
    ) -> None:
        """Start afresh, or from the checkpoint in the folder. `driven`: the same configuration, with
        scenarios named as the workers find them.
        """
        self._config, self._folder, self._watcher = config, folder, watcher
        self._driven = driven or config
        keep_freed_blocks()
        device = config.training.device
        try:
            torch.zeros(1, device=device).item()
        except (RuntimeError, AssertionError) as error:
            raise InputError(f"device {device!r} cannot be used: {error}") from error
        self._round = 0
        self._learner = self._make_learner()
        self._replay = Replay(config.given, config.training.replay_size, *self._learner.masks)
        self._statistics = [field.name for field in fields(self._learner.statistics)]
        self._taken_along = config.correction.arrays(config.action)
        self._sigmas = RunningPercentiles()
        self._calibrated: Measured | None = None
        self._finished: list[Finished] = []
        self._drawn = self._left_out = 0
        self._losses: list[Statistics] = []
        self._wall_s = 0.0
        self._stop = False
        self._restore()

    @property
    def steps(self) -> int:
        """Decisions taken by the policy."""
        return max(self._round - self._config.seed_rounds, 0) * self._config.round_steps

    def run(self) -> bool:
        """Train to the end; whether it was reached. If interrupted before (`_interruptible`), the last
        checkpoint is kept.
        """
        self._since = time.monotonic()
        self._watcher.advance(self._round * self._config.round_steps)
        if self._round >= self._config.rounds:
            return True
        self._log = Log(self._folder, self.steps, self._statistics)
        self._pool = WorkerPool(self._driven)
        left = max(torch.get_num_threads() - self._config.training.envs, 1)  # a core for each world
        try:
            with self._interruptible(), torch_threads(left):
                while self._round < self._config.rounds and not self._stop:
                    self._one_round()
                    self._milestones()
        finally:
            self._pool.close()
            self._log.close()
        ended = self._round == self._config.rounds
        if not ended:
            self._watcher.note(f"interrupted; {self._kept()}")
        return ended

    # ---- its learner

    def _make_learner(self) -> Learner:
        config = self._config
        kind = config.entry.kind(config.algorithm)
        make = partial(kind, config.learner, config.given, config.training.device)
        return GuardedLearner(make, config.algorithm, self._where) if is_own(kind) else make()

    def _where(self, what: str) -> str:
        """What went wrong in a learner that is not RUDC's: at which step, and how to go on."""
        return f"at step {self.steps}: {what}; {self._kept()}; --resume is for unchanged code"

    # ---- a round

    def _one_round(self) -> None:
        config = self._config
        seeding = self._round < config.seed_rounds
        self._pool.load(self._learner.weights(), self._percentiles())
        self._pool.start(self._round, "reference" if seeding else "policy", drop=self._breaks(1))
        with widest_products():
            self._learn()
        collected = self._pool.finish()
        for part in collected:
            for transition in part.transitions:
                self._replay.add(transition)
            self._finished += part.finished
            self._drawn += part.drawn
            self._left_out += part.left_out
        if not seeding:
            self._measure(collected[0].transitions)
        self._round += 1
        self._watcher.advance(self._round * config.round_steps)

    def _learn(self) -> None:
        config = self._config
        updates = config.updates_until(self._round + 1) - config.updates_until(self._round)
        if updates and self._learner.updates == 0:
            self._learner.start(self._replay.first(len(self._replay)))
        for _ in range(updates):
            losses = self._learner.update(self._replay.sample(config.learner.batch_size))
            if astray(losses, config.training.loss_limit):
                raise TrainingError(
                    f"training went astray at step {self.steps}: "
                    + ", ".join(f"{name} {value:.3g}" for name, value in asdict(losses).items())
                    + f"; {self._kept()}"
                )
            self._losses.append(losses)

    def _measure(self, new: Sequence[Transition]) -> None:
        """Take in how uncertain the critics are about decisions of this round, if they say; there are none if
        its episodes failed.
        """
        if not new:
            return
        observation = np.stack([transition.observation for transition in new[:SIGMA_ROWS]])
        action = np.stack([transition.proposed for transition in new[:SIGMA_ROWS]])
        sigma = self._learner.sigma(observation, action)
        if sigma is not None:
            self._sigmas.add(sigma)

    # ---- milestones

    def _at(self, every: int, ahead: int = 0) -> bool:
        """Whether the round `ahead` rounds from now reaches a multiple of `every` decisions, or is the
        last."""
        config = self._config
        done = self._round + ahead - config.seed_rounds
        passed = done * config.round_steps // every > (done - 1) * config.round_steps // every
        return (done > 0 and passed) or self._round + ahead == config.rounds

    def _breaks(self, ahead: int = 0) -> bool:
        """Whether worlds begin new episodes after that round: at checkpoints, the first after seeding."""
        config = self._config
        seeded = self._round + ahead == config.seed_rounds
        every = (config.training.checkpoint_every, config.training.evaluate_every)
        return seeded or any(self._at(decisions, ahead) for decisions in every)

    def _milestones(self) -> None:
        training = self._config.training
        if self.steps and (self._at(training.log_every) or self._breaks()):
            self._write_progress()
        if self._breaks():  # only then have all episodes that were drawn ended
            self._say_left_out(self._drawn, self._left_out, "training")
            self._drawn = self._left_out = 0
        if self._round == self._config.rounds:
            self._calibrate()
        if self.steps and self._at(training.evaluate_every) and training.evaluation_episodes:
            self._evaluate()
        if self._breaks():  # last: if it is killed before, the milestone is done again
            self._finished, self._losses = [], []  # of the seeding, which has no row; else empty by now
            self._save()

    def _write_progress(self) -> None:
        row: dict[str, Any] = {
            "steps": self.steps,
            "updates": self._learner.updates,
            **episode_columns(self._finished),
        }
        for name in self._statistics:
            values = [getattr(losses, name) for losses in self._losses]
            row[name] = float(np.mean(values)) if values else math.nan
        row["sigma_l"], row["sigma_h"] = self._sigmas.values()
        row["wall_s"] = round(self._elapsed(), 1)
        self._log.write("progress", row)
        self._watcher.progress(row)
        self._finished, self._losses = [], []

    def _evaluate(self) -> None:
        training = self._driven.training
        seeds = range(HELD_OUT_SEED, HELD_OUT_SEED + training.evaluation_episodes)
        self._pool.load(self._weights(), self._percentiles())
        tasks = [(name, seed) for name in training.evaluate_on for seed in seeds]
        records = self._pool.evaluate(tasks)
        self._say_left_out(len(tasks), len(tasks) - len(records), "held-out")
        for row in evaluation_rows(self.steps, records):
            self._log.write("evaluation", row)
            if row["priority"] == "all":
                violation = sum(row[outcome] for outcome in Outcome if outcome.is_violation)
                rates = f"success {row['success']:.0%}, frozen {row['frozen']:.0%}, violation {violation:.0%}"
                self._watcher.note(f"step {self.steps}, {row['scenario']}: {rates}")

    def _calibrate(self) -> None:
        """Measure sigma of the final policy as it is deployed (see calibration.py)."""
        training = self._driven.training
        states = "sigma" in self._config.learner.offers
        if not (states and training.calibration_episodes and self._learner.updates):
            return
        self._pool.load(self._learner.weights(), self._percentiles(), critics=True)
        tasks = calibration_tasks(training.evaluate_on, training.calibration_episodes)
        heard = self._pool.hear(tasks)
        self._say_left_out(len(tasks), len(tasks) - len(heard), "held-out")
        if heard:
            self._calibrated = measured(heard)
        if not any(one.succeeded for one in heard):
            self._watcher.note("no held-out episode succeeded: sigma_l and sigma_h are not to be relied on")

    def _say_left_out(self, drawn: int, lost: int, kind: str) -> None:
        if lost:
            these = f"{lost} of {drawn} {kind} episodes"
            self._watcher.note(f"{these} could not be set up or driven to their end: left out")

    def _weights(self) -> Arrays:
        """The learner's weights, and the usual sigma along the route once it was measured."""
        return self._learner.weights() | (self._calibrated.arrays if self._calibrated else {})

    def _percentiles(self) -> tuple[float, float] | None:
        if self._calibrated is not None:
            return self._calibrated.percentiles
        low, high = self._sigmas.values()
        return (low, high) if math.isfinite(low) else None

    def _elapsed(self) -> float:
        return self._wall_s + time.monotonic() - self._since

    # ---- checkpoints

    @property
    def _latest(self) -> Path:
        return self._folder / LATEST

    def _kept(self) -> str:
        if not (self._latest / COUNTERS).is_file():
            return "there is no checkpoint yet, so --resume begins anew"
        return f"the last checkpoint is kept in {self._latest}"

    def _save(self) -> None:
        new = self._latest.with_name(LATEST + ".new")
        shutil.rmtree(new, ignore_errors=True)
        summary = {
            "steps": self.steps,
            "updates": self._learner.updates,
        }
        arrays = self._weights() | self._taken_along
        training = self._config.model_dump(mode="json")["training"]
        save_learnt(new, Learnt(self._config.agent, arrays, self._percentiles(), training, summary))
        state = grouped(learner=self._learner.state(), sigma=self._sigmas.state())
        counters = {"round": self._round, "wall_s": self._elapsed()}
        save_state(new / STATE, state)
        self._replay.save(new / REPLAY)
        write_atomically(new / COUNTERS, json.dumps(counters) + "\n")
        replace_folder(new, self._latest)

    def _restore(self) -> None:
        source = next((f for f in (self._latest, aside_of(self._latest)) if (f / COUNTERS).is_file()), None)
        if source is None:
            first = next(k for k in range(1, self._config.rounds + 1) if self._breaks(k))
            before = max(first - self._config.seed_rounds, 0) * self._config.round_steps
            refuse_lost(self._folder, self._latest / COUNTERS, before)
            return
        try:
            self._refuse_other(source)
            counters = json.loads((source / COUNTERS).read_text(encoding="utf-8"))
            state = load_state(source / STATE)
            self._round, self._wall_s = int(counters["round"]), float(counters["wall_s"])
            self._learner.load(group(state, "learner"))
            self._replay.load(source / REPLAY)
            self._sigmas.load(group(state, "sigma"))
        except (OSError, ValueError, KeyError, PartFailedError) as error:
            raise AgentError(f"{source}: training cannot be resumed from it: {error}") from error

    def _refuse_other(self, checkpoint: Path) -> None:
        """Raise InputError for a checkpoint that came from elsewhere."""
        if other := otherwise(checkpoint, self._config):
            raise InputError(
                f"{checkpoint} is of another training than {self._folder / CONFIG}, with another "
                f"{listed(other)}: take it out of the folder, or give another folder"
            )

    # ---- Ctrl-C

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Ctrl-C, SIGTERM and SIGHUP end the training after the round; a second one at once."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def stop(*_: object) -> None:
            if self._stop:
                raise KeyboardInterrupt
            self._stop = True
            self._watcher.note("interrupted, finishing this round")

        before = {number: signal.signal(number, stop) for number in _told_to_end()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def astray(losses: Statistics, limit: float) -> bool:
    """Whether one of the statistics is not finite, or larger than the limit."""
    return not all(abs(value) <= limit for value in asdict(losses).values())  # nan is not <= anything


def _told_to_end() -> list[signal.Signals]:
    """SIGINT, SIGTERM, and SIGHUP where there is one, but none that is ignored (nohup; `&` in a script)."""
    known = [signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [number for number in known if signal.getsignal(number) != signal.SIG_IGN]


def train(config: TrainConfig, folder: Path, watcher: Watcher, *, resume: bool = False) -> bool:
    """Train into a folder; see `Trainer.run`. Raises InputError if the folder holds something else, or if
    there is nothing to train on, or no such learner.
    """
    config.entry.kind(config.algorithm)
    sources = sources_now(config, folder)
    driven = with_files(config, sources)
    make_mixture(driven.training.scenario, driven.training.curriculum)
    held_out(driven.training.evaluate_on)
    with held(folder, watcher.note):
        check_folder(config, folder, sources, resume=resume)
        trainer = Trainer(config, folder, watcher, driven)
        keep_inputs(config, folder, sources)  # only now: without the device no training begins
        return trainer.run()
