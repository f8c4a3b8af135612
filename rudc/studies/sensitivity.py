"""What difference one setting of RUDC-T's learning makes: the CVaR level beta, or the number of critics
(paper, Sec. "Sensitivity Analysis", Fig. "sensitivity").

An agent is trained for each value, or taken from trainings made before (rudc/studies/trained.py: they are
called rudc-t-beta0.1-seed0, rudc-t-members3-seed0, ...; at the value that it has anyway, rudc-t-seed0), and
drives both tasks. Training seeds are pooled. Besides the paper's metrics: mean sigma_total over episodes and
its standard deviation; the number of weights that driving needs; and the processor's time for one call of the
critics.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rudc.agents.checkpoint import find_checkpoint, load_learnt
from rudc.errors import InputError
from rudc.evaluation.columns import METRICS, Metric, metric_of
from rudc.evaluation.metrics import group_metrics
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import csv_text, interval_of, markdown, number
from rudc.files import make_folder, past_links
from rudc.learning.inference import Decider
from rudc.reporting.sensitivity import draw_sensitivity
from rudc.studies.base import Budget, Order, Report, in_distribution, kinds_of_errors, write
from rudc.studies.page import OF_RATES, page
from rudc.studies.trained import Trained, Trainings, Wanted, trainings_for
from rudc.training.config import TrainConfig

ALGORITHM = "rudc-t"
ALL = "both tasks"
EPISODES: Mapping[Budget, int] = {"quick": 1, "full": 100, "paper": 500}
"""for each task and agent"""
SEEDS: Mapping[Budget, tuple[int, ...]] = {"quick": (0,), "full": (0,), "paper": (0, 1, 2)}
"""seeds of the trainings"""
TRAINING: Mapping[Budget, Mapping[str, Any]] = {
    "quick": {
        "training.steps": 600,
        "training.seed_steps": 600,
        "training.learning_starts": 500,
        "training.evaluation_episodes": 0,
        "training.calibration_episodes": 1,
    },
    "full": {"training.steps": 20_000, "training.evaluation_episodes": 0},
    "paper": {"training.steps": 100_000},
}
"""settings of the trainings that are made"""
WORDS = {
    **OF_RATES,
    "beta": "share of the worst outcomes that CVaR looks at; 1 is the expectation",
    "members": "critics of the ensemble",
    "steps": "decisions of each training",
    "σ, std of σ": "mean of sigma_total over an episode's decisions, mean over episodes, and its standard "
    "deviation",
    "weights": "how many numbers of its networks driving needs",
    "critics (ms)": "processor's time of one call of the critics, median",
}
ASKED = 200
"""calls of the critics that are timed"""


@dataclass(frozen=True)
class Swept:
    """A setting, and the values that it is given."""

    study: str
    short: str
    """in the trainings' names and as the table's heading"""
    key: str
    label: str
    """in figures"""
    values: Mapping[Budget, tuple[float, ...]]
    panels: tuple[str, ...]
    """what the figure shows"""

    def wanted(self, value: float) -> Wanted:
        """The training at a value."""
        own = TrainConfig.of(ALGORITHM).model_dump()["learner"][self.key.rpartition(".")[2]]
        if value == own:
            return Wanted(ALGORITHM, ALGORITHM)
        return Wanted(f"{ALGORITHM}-{self.short}{value:g}", ALGORITHM, {self.key: value})


BETA = Swept(
    "sensitivity-beta",
    "beta",
    "learner.beta",
    "CVaR level β",
    {"quick": (0.1, 1.0), "full": (0.1, 0.25, 0.5, 0.75, 1.0), "paper": (0.1, 0.25, 0.5, 0.75, 1.0)},
    ("SR", "VR", "FR", "AER", "AES", "mean_sigma"),
)
ENSEMBLE = Swept(
    "sensitivity-ensemble",
    "members",
    "learner.members",
    "critics",
    {"quick": (3, 5), "full": (3, 5, 7, 10), "paper": (3, 5, 7, 10)},
    ("SR", "VR", "FR", "AER", "weights", "critics_ms"),
)
_SIGMA = metric_of("mean_sigma")
assert _SIGMA is not None
MEASURED: tuple[Metric, ...] = (*METRICS, _SIGMA)


def study_of(swept: Swept) -> Callable[[Order, Callable[[str], Progress]], Report]:
    """The study of a setting."""

    def run(order: Order, progress: Callable[[str], Progress]) -> Report:
        return _run(swept, order, progress)

    return run


def _run(swept: Swept, order: Order, progress: Callable[[str], Progress]) -> Report:
    out, values = past_links(order.out), swept.values[order.budget]
    seeds = order.training_seeds or SEEDS[order.budget]
    wanted = {value: swept.wanted(value) for value in values}
    trainings = trainings_for(list(wanted.values()), seeds, order, TRAINING[order.budget], progress)
    value_of = {t.agent: value for value, want in wanted.items() for t in trainings.of(want.name)}
    if not value_of:
        where = "" if order.trainings is None else f" in {order.trainings}"
        raise InputError(f"no training to drive with{where}: {'; '.join(trainings.missing)}")
    make_folder(out)
    plan = SweepPlan(in_distribution(), tuple(value_of), order.episodes or EPISODES[order.budget], order.seed)
    with trainings.named_from():
        result = run_sweep(
            plan, out / "sweep", EpisodeRunner, workers=order.workers, resume=order.resume,
            progress=progress(swept.study),
        )  # fmt: skip
        lines = lines_of(swept, result.rows, value_of, trainings)
    name = swept.study.replace("-", "_")
    said = (
        f"{ALGORITHM} was trained with each value of {swept.key}, and each training drove {plan.episodes} "
        "episode(s) of each of the two tasks. Training seeds are pooled."
    )
    table = page(swept.study, order, said, [as_markdown(swept, lines)], WORDS)
    files = (
        write(out / f"{name}.csv", csv_text(lines)),
        write(out / f"{name}.md", table),
        draw_sensitivity(lines, swept.short, swept.label, swept.panels, ALL, out / f"{name}.png"),
    )
    notes = tuple(f"missing: {text}" for text in trainings.missing)
    return Report(table, files, notes, kinds_of_errors(result.rows))


def lines_of(
    swept: Swept, rows: Sequence[Mapping[str, str]], value_of: Mapping[str, float], trainings: Trainings
) -> list[dict[str, Any]]:
    """A line for each value, in each task and in both, training seeds pooled."""
    lines = []
    for value in dict.fromkeys(value_of.values()):
        members = [t for t in trainings.found if value_of.get(t.agent) == value]
        own = [row for row in rows if value_of[row["agent"]] == value]
        about = {
            swept.short: value,
            "trainings": len(members),
            "steps": min(t.steps for t in members),
            "weights": weights(members[0]),
            "critics_ms": critics_ms(members[0]),
        }
        tasks = [*dict.fromkeys(row["scenario"] for row in own), ALL]
        for task in tasks:
            (group,) = group_metrics([r for r in own if task in (r["scenario"], ALL)], (), MEASURED)
            line: dict[str, Any] = {**about, "scenario": task, "episodes": group.episodes}
            for metric in MEASURED:
                found = group.metrics[metric.name]
                line |= {metric.name: found.mean, f"{metric.name}_std": found.std}
                line |= {f"{metric.name}_low": found.low, f"{metric.name}_high": found.high}
            lines.append(line)
    return lines


def _folder(training: Trained) -> Path:
    folder = find_checkpoint(training.agent)
    if folder is None:
        raise InputError(f"no checkpoint in {training.agent}")
    return folder


def weights(training: Trained) -> int:
    """How many weights driving needs: those of policy, critics and priors."""
    arrays = load_learnt(_folder(training)).arrays
    parts = ("policy/", "critic/", "prior/")
    return sum(int(array.size) for name, array in arrays.items() if name.startswith(parts))


def critics_ms(training: Trained) -> float:
    """ms of the processor for one call of the critics, the median of ASKED."""
    learnt = load_learnt(_folder(training))
    layout = learnt.config.problem().layout
    decider = Decider(learnt.config.learner, layout, learnt.arrays)
    rng = np.random.default_rng(0)
    spent = []
    for _ in range(ASKED):
        observation = rng.uniform(-1.0, 1.0, layout.size).astype(np.float32)
        action = decider.action(observation)
        start = time.thread_time()
        decider.uncertainty(observation, action)
        spent.append(1000.0 * (time.thread_time() - start))
    return float(np.median(spent))


def as_markdown(swept: Swept, lines: Sequence[Mapping[str, Any]]) -> str:
    """The lines, to read."""
    shown = ("SR", "VR", "FR", "AES", "AER", "mean_sigma")
    headings = [swept.short, "scenario", "trainings", "steps", "episodes"]
    units = ("SR (%)", "VR (%)", "FR (%)", "AES (m/s)", "AER", "σ")
    rows = [
        [
            f"{line[swept.short]:g}",
            line["scenario"],
            str(line["trainings"]),
            str(line["steps"]),
            str(line["episodes"]),
            *(interval_of(line, metric) for metric in shown),
            number(line["mean_sigma_std"], 2),
            f"{line['weights'] / 1000:.0f}",
            f"{line['critics_ms']:.3f}",
        ]
        for line in lines
    ]
    return markdown([*headings, *units, "std of σ", "weights (thousands)", "critics (ms)"], rows, left=2)
