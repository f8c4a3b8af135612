"""Training curves of several trainings: mean and 95 % band.

The interval of a mean over n trainings is Student's of their n values (rudc/evaluation/statistics.py). That
of a rate is at least as wide as Wilson's of all their episodes, since trainings that all succeed in their few
episodes are not certain to succeed in others; of a single training it is Wilson's. Rates stay within 0 and
100 %. Trainings are alike if their folders' names differ
only in `-seedN`; of two folders of the same name, those that lie together. Only what all of them reached is
shown. Where the values come from says rudc/training/log_curves.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rudc.errors import InputError
from rudc.evaluation.seeds import at_least_wilsons
from rudc.evaluation.statistics import student
from rudc.evaluation.sweep import Progress
from rudc.evaluation.text import csv_text, interval, markdown
from rudc.files import make_folder, past_links
from rudc.reporting.curves import Curve, draw_curves
from rudc.studies.base import Order, Report, family, write
from rudc.studies.page import OF_RATES, page
from rudc.training.log_curves import BIN, RATE_COLUMNS, Key, Measured, Series, read_training

SAID = (
    "The last evaluations of trainings that differ in their training seed only: mean over the trainings, and "
    "in brackets its 95 % interval. That of the reward is Student's over the trainings; that of a rate is at "
    "least as wide as Wilson's of all their episodes, and Wilson's alone for one training. The figure and "
    "curves.csv have the same over the whole training."
)
WORDS = {
    **OF_RATES,
    "arms": "of which arms the EV came: `all`, or those that are `major` (with priority) or `minor`",
    "trainings": "how many there are, each with a training seed of its own",
    "steps": "decisions that had been trained when the evaluation was driven",
    "episodes": "of all trainings together, in that evaluation",
    "reward": "sum of an episode's rewards, mean over episodes",
}


class Band(NamedTuple):
    """A mean over trainings with its interval."""

    mean: float
    low: float
    high: float


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Read the trainings' logs and draw them."""
    if not order.folders:
        raise InputError("which trainings? give their folders: rudc study curves DIR...")
    trainings: dict[str, list[dict[Key, Series]]] = {}
    without: list[str] = []
    for folder, name in names_of(order.folders).items():
        training = read_training(folder)
        trainings.setdefault(name, []).append(training)
        if not training:
            without.append(
                f"{folder} has no curve yet: fewer than {BIN:,} decisions are logged, and no evaluation"
            )
    lines = [line for name, members in trainings.items() for line in combine(name, members)]
    if not lines:
        said = "; ".join(without)
        raise InputError(said or "these trainings have no step in common that all of them reached")
    make_folder(order.out)
    table = page("curves", order, SAID, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "curves.csv", csv_text(lines)),
        write(order.out / "curves.md", table),
        draw_curves(curves(lines), order.out / "curves.png"),
    )
    return Report(table, files, (*without, *shortened(trainings)))


def names_of(folders: Sequence[Path]) -> dict[Path, str]:
    """Each folder once -> what its training is called: its last name without `-seedN`; where two have the
    very same last name, with as much of the path before it as tells them apart.
    """
    found = {past_links(folder): folder for folder in folders}
    named: dict[Path, str] = {}
    for path, folder in found.items():
        own = family(path.name)
        alike = [other for other in found if family(other.name) == own]
        parts: tuple[str, ...] = ()
        if len({other.name for other in alike}) < len(alike):
            ways = [other.parent.parts for other in alike if other.parent != path.parent]
            way = path.parent.parts
            parts = next(
                (way[-n:] for n in range(1, len(way)) if way[-n:] not in [w[-n:] for w in ways]), way
            )
        named[folder] = "/".join([*parts, own])
    return named


def combine(name: str, trainings: Sequence[Mapping[Key, Series]]) -> list[dict[str, object]]:
    """Lines of `curves.csv` of trainings that differ only in their seed."""
    lines = []
    keys = [key for key in trainings[0] if all(key in other for other in trainings)]
    for key in keys:
        series = [training[key] for training in trainings]
        for step in sorted(set.intersection(*(set(s) for s in series))):
            band = band_of([s[step] for s in series], rate=key[3] in RATE_COLUMNS)
            source, scenario, priority, metric = key
            lines.append(
                {
                    "agent": name,
                    "source": source,
                    "scenario": scenario,
                    "priority": priority,
                    "metric": metric,
                    "steps": step,
                    "trainings": len(series),
                    "episodes": sum(s[step].episodes for s in series),
                    **band._asdict(),
                }
            )
    return lines


def band_of(measured: Sequence[Measured], *, rate: bool) -> Band:
    """Mean over trainings and its 95 % interval, of a `rate` within [0, 100]; nan where there is none."""
    values = np.array([m.value for m in measured])
    mean, (low, high) = float(values.mean()), student(values)
    if not rate or np.isnan(mean):
        return Band(mean, low, high)
    counts = [(m.episodes, round(m.value * m.episodes / 100)) for m in measured]
    cells = [(np.arange(n) < happened).astype(float) for n, happened in counts]
    low, high = at_least_wilsons((low, high), cells)
    return Band(mean, max(low, 0.0), min(high, 100.0))


def shortened(trainings: Mapping[str, Sequence[Mapping[Key, Series]]]) -> list[str]:
    """A note for each kind whose trainings went on for different lengths."""
    notes = []
    for name, members in trainings.items():
        ends = [max((step for series in m.values() for step in series), default=0) for m in members]
        if len(set(ends)) > 1:
            notes.append(
                f"{name}: trainings end at {', '.join(map(str, ends))} steps; shown up to the shortest"
            )
    return notes


def as_markdown(lines: Sequence[Mapping]) -> str:
    """Where the held-out episodes ended up."""
    last: dict[tuple[str, ...], dict[str, Mapping]] = {}
    for line in lines:
        if line["source"] == "evaluation":
            key = (line["agent"], line["scenario"], line["priority"])
            last.setdefault(key, {})[line["metric"]] = line
    rows = []
    for key, metrics in last.items():
        first = next(iter(metrics.values()))
        values = [interval(*(metrics[m][part] for part in Band._fields)) for m in (*RATE_COLUMNS, "reward")]
        rows.append([*key, *(str(first[column]) for column in ("trainings", "steps", "episodes")), *values])
    names = [*(f"{rate} (%) [trainings, episodes]" for rate in RATE_COLUMNS), "reward [trainings]"]
    return markdown(["agent", "scenario", "arms", "trainings", "steps", "episodes", *names], rows, left=3)


def curves(lines: Sequence[Mapping]) -> list[Curve]:
    """What the figure shows: all arms together."""
    found: dict[tuple[str, str, str], list[Mapping]] = {}
    for line in lines:
        if line["priority"] == "all":
            place = line["scenario"] or "while training"
            found.setdefault((line["agent"], place, line["metric"]), []).append(line)
    return [
        Curve(
            *key, members[0]["trainings"], *(np.array([m[c] for m in members], dtype=float) for c in _COLUMNS)
        )
        for key, members in found.items()
    ]


_COLUMNS = ("steps", "mean", "low", "high")
