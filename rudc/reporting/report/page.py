"""A sweep's, a training's or a study's folder -> one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path

from rudc.drawing.palette import OUTCOMES, SERIES
from rudc.errors import SweepError
from rudc.files import make_folder_of, write_atomically
from rudc.reporting.html.page import check_page, css, render
from rudc.reporting.report.study import is_study, study_content
from rudc.reporting.report.sweep import sweep_content
from rudc.reporting.report.training import is_training, training_content

_FOLDER = Path(__file__).parent
NAME = "report.html"
"""default name of the page, in the folder that it is about"""


def save_report(folder: Path, path: Path, *, live: bool = False) -> None:
    """Write the page of a folder. `live`: it will be written again, and loads itself again. Raises SweepError
    for a folder of none of these, InputError, StorageError.
    """
    check_page(path, "a report")
    text = report_page(folder, path, live=live)
    make_folder_of(path)
    write_atomically(path, text)


def report_page(folder: Path, path: Path, *, live: bool = False) -> str:
    """The page's text; arguments as for `save_report`."""
    if not folder.is_dir():
        raise SweepError(f"{folder} is no folder; give that of a sweep, a training or a study")
    name = folder.resolve().name
    look = {
        "series": [css(colour) for colour in SERIES],
        "outcomes": {
            key: {"words": words, "colour": css(colour)} for key, (words, colour) in OUTCOMES.items()
        },
        "live": live,
    }
    if is_training(folder):
        content = training_content(folder)
        title, own = f"Training {name}", "training"
    elif is_study(folder) and not (folder / "episodes.csv").is_file():
        content = study_content(folder)
        title, own = f"Study {name}", "study"
    else:
        content = sweep_content(folder, path)
        title, own = f"Sweep {name}", "sweep"
    data = {"data": content.pop("data"), "look": look}
    return render(
        _FOLDER,
        title,
        template=f"{own}.html",
        style="report.css",
        scripts=_SCRIPTS[own],
        data=data,
        live=live,
        **content,
    )


_SCRIPTS = {
    "sweep": ("charts.js", "state.js", "table.js", "compare.js", "episodes.js", "sweep.js"),
    "training": ("charts.js", "state.js", "training.js"),
    "study": ("study.js",),
}
