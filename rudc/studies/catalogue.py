"""All studies by name."""

from __future__ import annotations

import difflib

from rudc.errors import InputError
from rudc.studies import curves, filter_study, sigma_study
from rudc.studies.base import Order, Study

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
            "curves",
            "Training curves, mean and 95 % band over training seeds.",
            curves.run,
            takes="folders",
        ),
    )
}


def find_study(name: str, order: Order) -> Study:
    """The study of that name, if the order fits it. Raises InputError."""
    if name not in STUDIES:
        close = difflib.get_close_matches(name, STUDIES, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        raise InputError(f"no study {name!r}{hint}; there are: {', '.join(STUDIES)}")
    study = STUDIES[name]
    if study.takes == "agents" and order.folders:
        raise InputError(f"study {name!r} takes no folders; name agents with --agent")
    if study.takes == "folders" and (order.agents or order.episodes is not None):
        raise InputError(
            f"study {name!r} drives nothing: it takes folders of trainings, no --agent or --episodes"
        )
    return study
