"""Recordings (rudc/evaluation/recording.py) -> one HTML file that needs nothing else.

The template, its style and its scripts lie beside this file and are put into the page, and so are the data
and the shapes of rudc/drawing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rudc.drawing import palette
from rudc.drawing.bodies import (
    BLINKERS,
    BODY,
    BRAKE_LIGHTS,
    BRAKES_MPS2,
    DARK_PARTS,
    HAS_LIGHTS,
    PEDESTRIAN_M,
    STANDS_MPS,
)
from rudc.drawing.caption import REMARKS
from rudc.drawing.overlays import AHEAD_M, BEHIND_M, KEPT_M
from rudc.evaluation.recording import SERIES
from rudc.files import make_folder_of, write_atomically
from rudc.reporting.html.page import badge, check_page, colours, render

_FOLDER = Path(__file__).parent
_SCRIPTS = ("data.js", "scene.js", "plots.js", "page.js")
WHAT = "a replay"
"""as `check_page` calls it"""


def save_replay(path: Path, runs: Sequence[Mapping[str, Any]], checks: Sequence[str] = ()) -> None:
    """Write the page of one recording, or of two beside each other. Raises InputError, StorageError.

    `checks`: for each, what comparing it with a row of a sweep said.
    """
    check_page(path, WHAT)
    make_folder_of(path)
    write_atomically(path, replay_page(runs, checks))


def replay_page(runs: Sequence[Mapping[str, Any]], checks: Sequence[str] = ()) -> str:
    """The page's text; arguments as for `save_replay`."""
    places = [f"{run['scenario']}, seed {run['seed']}" for run in runs]
    return render(
        _FOLDER,
        _title(runs),
        style="page.css",
        scripts=_SCRIPTS,
        data={"data": {"runs": _shared_roads(runs), "steps": SERIES}, "look": _look()},
        runs=[
            {"number": i, "agent": run["agent"], "place": places[i] if len(set(places)) > 1 else "",
             "outcome": badge(run["outcome"], run["row"].get("fault")),
             "row": run["row"], "lines": run["event_lines"], "check": checks[i] if i < len(checks) else ""}
            for i, run in enumerate(runs)
        ],
    )  # fmt: skip


def _shared_roads(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The same, without roads that the first has, too."""
    return [
        {**run, "road": None} if i and run["road"] == runs[0]["road"] else dict(run)
        for i, run in enumerate(runs)
    ]


def _look() -> dict[str, Any]:
    """Colours and shapes as rudc/drawing has them."""
    return {
        "colours": colours(),
        "body": BODY.tolist(),
        "lights": BRAKE_LIGHTS,
        "blinkers": BLINKERS,
        "brakes_mps2": BRAKES_MPS2,
        "stands_mps": STANDS_MPS,
        "lit": [kind.name.lower() for kind in HAS_LIGHTS],
        "dark": {kind.name.lower(): parts for kind, parts in DARK_PARTS.items()},
        "pedestrian_m": PEDESTRIAN_M,
        "kept_m": KEPT_M,
        "behind_m": BEHIND_M,
        "ahead_m": AHEAD_M,
        "hidden_share": palette.HIDDEN_SHARE,
        "remarks": REMARKS,
    }


def _title(runs: Sequence[Mapping[str, Any]]) -> str:
    scenarios, agents, seeds = (
        list(dict.fromkeys(str(run[name]) for run in runs)) for name in ("scenario", "agent", "seed")
    )
    counted = "seeds" if len(seeds) > 1 else "seed"
    return f"{' and '.join(scenarios)}, {' and '.join(agents)}, {counted} {' and '.join(seeds)}"
