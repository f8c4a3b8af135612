"""How well the shipped residual predictors foresee what the filter's model leaves out (paper, Appx.
"Validation of CBF residual predictor", Fig. "cbf_predictor": R2, MAE, RMSE, predicted against true change of
h).

The scores are for each kind of action that a predictor is shipped for, and for both heads (vehicles, road
edges). The samples are of random exploration as in the paper, of episodes that the predictors were not fitted
to. The residual is of h itself, so TTCBF and ECBF share it. Scores are those of `rudc residual evaluate`.
Three things are added: the picture; w itself, since the R2 of the change says little where h changes by tens
of m2 and w by hundredths; and scores of the samples within grip, whose action a dry road allows: |(a, v^2
sin(slip) / l_r)| <= mu g (rudc/world/ego.py). Random actions exceed that now and then, drivers seldom.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rudc.env.action import read_action
from rudc.errors import InputError
from rudc.evaluation.sweep import Progress
from rudc.evaluation.text import csv_text, markdown
from rudc.files import make_folder
from rudc.hints import install_command
from rudc.reporting.agreement import Agreement, draw_agreement
from rudc.safety.barrier import COMMON
from rudc.safety.residual import shipped_predictor
from rudc.studies.base import Order, Report, write
from rudc.studies.page import page
from rudc.training.residual_data import Dataset, Samples, collect, load_dataset, save_dataset
from rudc.vehicle import EgoVehicle
from rudc.world.ego import DRY, GRAVITY

KINDS = ("adjustment", "direct")
"""kinds of actions for which a predictor is shipped"""
SAMPLES = {"quick": 2_000, "full": 100_000}
"""samples of each head, by budget; full: as many as in the paper"""
WORDS = {
    "action": "which kind of actions: `adjustment` of a path follower's steering, or `direct`",
    "constraints": "towards vehicles or road edges; within grip: the samples whose action a dry road allows",
    "change of h by": "what foresees it: the filter's model alone, or with the predictor of w",
    "R2, MAE, RMSE": "share of the variance that is foreseen, mean absolute error, root of the mean square "
    "error",
    "share of w": "share of the squares of w, what the model leaves out, that the predictor foresees; below "
    "0 it is worse than none",
}
FRESH = 1_000
"""added to the seed asked for: the shipped predictors were fitted to samples of seed 0"""


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Collect, predict, compare."""
    if find_spec("torch") is None:
        raise InputError(f"measuring needs torch: {install_command('train')}")
    from rudc.training.residual_fit import evaluate

    make_folder(order.out)
    lines: list[dict[str, Any]] = []
    pictures: list[Agreement] = []
    for kind in KINDS:
        progress(f"{SAMPLES[order.budget]} samples of each head, action={kind}")
        dataset = _samples(order, kind)
        predictor = shipped_predictor(kind)
        parts = evaluate(dataset, predictor, only_held_out=False)
        gripped = evaluate(within_grip(dataset), predictor, only_held_out=False)
        parts += [
            part._replace(about=f"{part.about}, within grip") for part in gripped if part.about in dataset
        ]
        for found in parts:
            for name, score in (("model alone", found.model), ("with predictor", found.predictor)):
                line = {"action": kind, "constraints": found.about, "samples": found.samples, "by": name}
                explained = found.explained if score is found.predictor else 0.0
                lines.append(line | score._asdict() | {"share_of_w": explained})
        for head in dataset:
            samples = dataset[head]
            w = samples.w.astype(float)
            expected = predictor.of(head, samples.xi.astype(float))
            pictures.append(Agreement(kind, head, samples.change.astype(float), w, expected))
    said = (
        f"What the filter's model of one step and the shipped predictors foresee of the change of h, in "
        f"{SAMPLES[order.budget]} samples of random actions for each action and head."
    )
    table = page("residual", order, said, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "residual.csv", csv_text(lines)),
        write(order.out / "residual.md", table),
        draw_agreement(pictures, order.out / "residual.png"),
    )
    return Report(table, files)


def _samples(order: Order, kind: str) -> Dataset:
    """The samples in the study's folder, if it is resumed and they are as many as wanted; else new ones."""
    wanted, path = SAMPLES[order.budget], _path(order.out, kind, order.seed)
    if path.is_file():
        if not order.resume:
            raise InputError(f"{path} is there already: add --resume to take it, or give another --out")
        dataset = load_dataset(path)
        if len(dataset["vehicle"].w) == wanted:
            return dataset
    dataset = collect(wanted, order.seed + FRESH, read_action(kind), lambda *_: None)
    save_dataset(path, dataset)
    return dataset


def _path(out: Path, kind: str, seed: int) -> Path:
    return out / f"samples-{kind}-{seed}.safetensors"


def within_grip(dataset: Dataset) -> Dataset:
    """The samples whose action a dry road allows."""
    body, chosen = EgoVehicle(), {}
    for head, samples in dataset.items():
        a, z, v = (
            unit * samples.xi[:, COMMON.index(name)].astype(float)
            for name, unit in (("acceleration / 6", 6.0), ("tan(steering)", 1.0), ("speed / 10", 10.0))
        )
        slip = np.arctan(body.cg_to_rear / body.wheelbase * z)
        asked = np.hypot(a, v**2 * np.sin(slip) / body.cg_to_rear)
        kept = asked <= DRY * GRAVITY
        chosen[head] = Samples(samples.xi[kept], samples.change[kept], samples.w[kept], samples.episode[kept])
    return chosen


def as_markdown(lines: Sequence[dict[str, Any]]) -> str:
    """The lines, to read."""
    headings = [
        "action", "constraints", "samples", "change of h by", "R2", "MAE (m²)", "RMSE (m²)", "share of w",
    ]  # fmt: skip
    rows = [
        [
            line["action"],
            line["constraints"],
            str(line["samples"]),
            line["by"],
            f"{line['r2']:.5f}",
            f"{line['mae']:.4f}",
            f"{line['rmse']:.4f}",
            f"{line['share_of_w']:.3f}",
        ]
        for line in lines
    ]
    return markdown(headings, rows, left=2)
