"""A search: episodes of one scenario and agent, chosen batch by batch where violations are likely.

    manifest.json      what the rows were made from
    evaluations.csv    one row an episode, written as it ends: columns of a sweep's rows, the searched keys,
                       and `weight`, what it counts for under the declared distribution
    failures.csv       the rows of violations, and the scenario file that each runs again from
    failures/          these scenario files: `rudc run FILE --agent A --seed S` is the same episode
    networks/          copies of road networks that do not come with RUDC; the episodes run on these
    errors/            a traceback for each episode that went wrong, named by its seed

Episode k has seed S + k, and its values are those of the k-th point that the sampler asks for: they depend
on the rows of earlier batches alone, not on workers, order or how many are asked for. So a search that goes
on, or gets more episodes, asks for the same points again, and runs those that have no row; an episode with an
error keeps its row, since later points depend on it, and counts for nothing. Where the EV cannot start
safely, an episode is drawn anew, the searched keys excepted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rudc.errors import SweepError
from rudc.evaluation.columns import happened
from rudc.evaluation.engine import Result, RunnerFactory, local_workers
from rudc.evaluation.limits import EPISODE_LIMIT_S
from rudc.evaluation.search.folder import SearchFolder, SearchPlan
from rudc.evaluation.search.rate import Rate, violation_rate
from rudc.evaluation.search.region import Region, likeliest_region
from rudc.evaluation.search.sampler import BATCH, Batch, Sampler
from rudc.evaluation.sweep import Progress, Silent, kept_rows, prepared
from rudc.evaluation.tasks import Task

Run = Callable[[Sequence[Task]], Iterator[Result]]


@dataclass(frozen=True)
class Findings:
    """What a search found."""

    episodes: int
    """episodes that could be run"""
    violations: tuple[int, ...]
    """seeds of those that ended in a violation"""
    kinds: Mapping[str, int]
    """outcome (of a collision, with whose fault it was) -> number of violations; the most frequent first"""
    errors: tuple[str, ...]
    """errors of the episodes that could not be run"""
    rate: Rate
    """rate of violations under the declared distribution"""
    counted_from: int
    """seed from which on episodes count for the rate"""
    region: Region | None
    """where violations are likeliest; None without any"""


def run_search(
    plan: SearchPlan,
    out: Path,
    make_runner: RunnerFactory,
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Progress | None = None,
) -> Findings:
    """Search in `out`, and write what is found there. Raises as `run_sweep` does; whatever ends it early,
    rows of finished episodes are kept.
    """
    if workers < 1:
        raise SweepError(f"a search needs at least one worker, not {workers}")
    sampler = Sampler(len(plan.space.axes), plan.seed)
    make_runner = prepared(make_runner, [plan.agent])
    with SearchFolder(out, plan) as folder:
        folder.open(resume)
        with kept_rows():
            asked = _finish(folder, plan, sampler, workers, make_runner, progress or Silent())
            found = _findings(folder, plan, asked)
            folder.complete(found.violations)
            return found


def _finish(
    folder: SearchFolder,
    plan: SearchPlan,
    sampler: Sampler,
    workers: int,
    make_runner: RunnerFactory,
    progress: Progress,
) -> list[Batch]:
    """Ask for all points, and run those episodes that have no row."""
    asked: list[Batch] = []
    progress.begin(plan.episodes, len(folder.rows), folder.warnings)
    with local_workers(min(workers, BATCH, plan.episodes), EPISODE_LIMIT_S, make_runner) as run:
        for first in range(plan.seed, plan.seed + plan.episodes, BATCH):
            count = min(BATCH, plan.seed + plan.episodes - first)
            asked.append(sampler.ask(count))
            _try(folder, plan, asked[-1], first, run, progress)
            if count == BATCH:
                rows = [folder.rows[first + k] for k in range(BATCH)]
                gaps = np.array([float(row["min_dtc_m"] or "nan") for row in rows])
                sampler.tell(asked[-1], np.array([_violated(row) for row in rows]), gaps)
    return asked


def _try(
    folder: SearchFolder, plan: SearchPlan, batch: Batch, first: int, run: Run, progress: Progress
) -> None:
    """Run those episodes of a batch that have no row; its first has the seed `first`."""
    values = [plan.space.values(z) for z in batch.z]
    todo = [
        Task(
            plan.space.fixed(folder.scenario, those),
            {},
            plan.agent,
            first + k,
            folder.agent_digest,
            folder.agent_reads,
        )
        for k, those in enumerate(values)
        if not folder.known(first + k, those, float(batch.weights[k]))
    ]
    if not todo:
        return
    with closing(run(todo)) as results:  # pyright: ignore
        for task, record in results:
            k = task.seed - first
            folder.add(record, values[k], float(batch.weights[k]))
            progress.advance(task, record)


def _violated(row: Mapping[str, str]) -> bool:
    return happened("VR", row["outcome"])


def _findings(folder: SearchFolder, plan: SearchPlan, asked: Sequence[Batch]) -> Findings:
    rows = [folder.rows[plan.seed + k] for k in range(plan.episodes)]
    weights = np.concatenate([batch.weights for batch in asked])
    fitted = np.concatenate([np.full(len(batch.z), batch.fitted) for batch in asked])
    able = np.array([not row["error"] for row in rows])
    violated = np.array([_violated(row) for row in rows])
    keys = list(plan.space.axes)
    values = np.array([[float(row[key]) for key in keys] for row in rows])
    those = [row for row in rows if _violated(row)]
    kinds = Counter(row["outcome"] + (f" (fault: {row['fault']})" if row["fault"] else "") for row in those)
    return Findings(
        int(able.sum()),
        tuple(int(row["seed"]) for row in those),
        dict(kinds.most_common()),
        tuple(row["error"] for row in rows if row["error"]),
        violation_rate(violated, able, weights, fitted),
        plan.seed + (int(fitted.argmax()) if np.count_nonzero(fitted) >= BATCH else 0),
        likeliest_region(keys, values[able], violated[able], weights[able]) if those else None,
    )
