"""All studies by name."""

from __future__ import annotations

from functools import partial

from rudc.errors import InputError
from rudc.hints import there_are
from rudc.studies import (
    ablation_case,
    cbf_grid,
    comparison,
    curves,
    filter_study,
    latency,
    ood_case,
    residual_study,
    sensitivity,
    sigma_study,
)
from rudc.studies.base import DRIVES, OPTIONS, Given, Order, Study

TRAINS: frozenset[Given] = DRIVES | frozenset[Given](("seeds", "trainings"))
"""options that take effect in studies of trainings; their agents are rows of the table"""
STUDIES = {
    study.name: study
    for study in (
        Study(
            "filter",
            "The same agents with their safety filter off, fixed, with residual, with slack, with both.",
            filter_study.run,
        ),
        Study(
            "sigma",
            "Whether sigma tells unfamiliar scenarios from familiar ones, and announces violations (AUROC).",
            sigma_study.run,
        ),
        Study(
            "comparison",
            "RUDC and the paper's baselines, from training to the paper's main table and its claims.",
            comparison.run,
            takes=TRAINS,
            budgets=("quick", "full", "paper"),
        ),
        Study(
            "ablation",
            "RUDC without one part after the other, from training to the paper's ablation table.",
            partial(comparison.run, name="ablation"),
            takes=TRAINS,
            budgets=("quick", "full", "paper"),
        ),
        Study(
            "curves",
            "Training curves, mean and 95 % band of trainings with several seeds.",
            curves.run,
            takes=frozenset(("folders",)),
        ),
        Study(
            "latency",
            "How long a decision takes, mean, p99 and peak, and the shares of its parts.",
            latency.run,
            takes=DRIVES - {"workers"},  # one, so that nothing else is timed along with it
        ),
        Study(
            "ood-case",
            "A blocked left turn in full: ways over time, h, controls, corrections, sigma, time.",
            ood_case.run,
        ),
        Study(
            "ablation-case",
            "Parts of RUDC taken away in one dense left turn; from what sigma on the filter corrects.",
            ablation_case.run,
        ),
        Study(
            "residual",
            "How well the shipped predictors foresee what the filter's model leaves out.",
            residual_study.run,
            takes=frozenset(("seed", "resume", "budget")),
        ),
        *(
            Study(
                swept.study,
                f"RUDC-T trained with several values of {swept.key}, then driven.",
                sensitivity.study_of(swept),
                takes=TRAINS - {"agents"},
                budgets=("quick", "full", "paper"),
            )
            for swept in (sensitivity.BETA, sensitivity.ENSEMBLE)
        ),
        Study(
            "cbf-grid",
            "Grids of the filter's rates, TTCBF's lambda and ECBF's two, behind drivers that need a filter.",
            cbf_grid.run,
        ),
    )
}


def find_study(name: str, order: Order, workers: int | None = None) -> Study:
    """The study of that name, if the order fits it. `workers`: how many were asked for; None if nobody did.
    Raises InputError.
    """
    if name not in STUDIES:
        raise InputError(f"no study {name!r}{there_are(name, STUDIES)}")
    study = STUDIES[name]
    given: dict[Given, object] = {
        "agents": order.agents,
        "episodes": order.episodes,
        "folders": order.folders,
        "seeds": order.training_seeds,
        "trainings": order.trainings,
        "seed": order.seed,
        "workers": workers,
        "resume": order.resume,
        "budget": order.budget != Order.budget,
    }
    for what, value in given.items():
        if value and what not in study.takes:
            raise InputError(f"study {name!r} takes no {OPTIONS[what]}; it takes {study.options}")
    if order.budget not in study.budgets:
        there = there_are(order.budget, study.budgets)
        raise InputError(f"study {name!r} has no budget {order.budget!r}{there}")
    return study
