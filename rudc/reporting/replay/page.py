"""Recordings (rudc/evaluation/recording.py) -> one HTML file that needs nothing else.

The template, its style and its scripts lie beside this file and are put into the page, and so are the data,
as JSON, and the colours and shapes of rudc/drawing. The page forbids itself any request.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from rudc.drawing import palette
from rudc.drawing.bodies import BODY, BRAKE_LIGHTS, DARK_PARTS, HAS_LIGHTS, PEDESTRIAN_M
from rudc.drawing.caption import REMARKS
from rudc.drawing.overlays import AHEAD_M, BEHIND_M, KEPT_M
from rudc.errors import InputError
from rudc.evaluation.recording import SERIES
from rudc.files import make_folder_of, write_atomically

_FOLDER = Path(__file__).parent
_SCRIPTS = ("data.js", "scene.js", "plots.js", "page.js")
_MARKS = {"success": "✓", "frozen": "…"}
"""stand before an outcome; before a violation a cross"""


def check_page(path: Path) -> None:
    """Raise InputError if a page cannot have such a name."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"a replay is an .html file, not {path.name!r}")


def save_replay(path: Path, runs: Sequence[Mapping[str, Any]], checks: Sequence[str] = ()) -> None:
    """Write the page of one recording, or of two beside each other. Raises InputError, StorageError.

    `checks`: for each, what comparing it with a row of a sweep said.
    """
    check_page(path)
    make_folder_of(path)
    write_atomically(path, replay_page(runs, checks))


def replay_page(runs: Sequence[Mapping[str, Any]], checks: Sequence[str] = ()) -> str:
    """The page's text; arguments as for `save_replay`."""
    loader = jinja2.FileSystemLoader(_FOLDER)
    template = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).get_template("page.html")
    return template.render(
        title=_title(runs),
        runs=[
            {"number": i, "agent": run["agent"], "outcome": _outcome(run), "row": run["row"],
             "lines": run["event_lines"], "check": checks[i] if i < len(checks) else ""}
            for i, run in enumerate(runs)
        ],
        remarks=REMARKS,
        style=_text("page.css"),
        script="\n".join(_text(name) for name in _SCRIPTS),
        data=_embedded({"runs": _shared_roads(runs), "steps": SERIES}),
        look=_embedded(_look()),
    )  # fmt: skip


def _shared_roads(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The same, without roads that the first has, too."""
    return [
        {**run, "road": None} if i and run["road"] == runs[0]["road"] else dict(run)
        for i, run in enumerate(runs)
    ]


def _look() -> dict[str, Any]:
    """Colours and shapes as rudc/drawing has them."""
    colours = {name.lower(): _css(value) for name, value in vars(palette).items() if _is_colour(value)}
    return {
        "colours": colours,
        "body": BODY.tolist(),
        "lights": BRAKE_LIGHTS,
        "lit": [kind.name.lower() for kind in HAS_LIGHTS],
        "dark": {kind.name.lower(): parts for kind, parts in DARK_PARTS.items()},
        "pedestrian_m": PEDESTRIAN_M,
        "kept_m": KEPT_M,
        "behind_m": BEHIND_M,
        "ahead_m": AHEAD_M,
        "hidden_share": palette.HIDDEN_SHARE,
        "remarks": REMARKS,
    }


def _is_colour(value: Any) -> bool:
    return isinstance(value, tuple) and len(value) in (3, 4) and all(isinstance(v, int) for v in value)


def _css(colour: palette.Colour) -> str:
    alpha = colour[3] / 255 if len(colour) == 4 else 1.0
    return f"rgba({colour[0]},{colour[1]},{colour[2]},{alpha:.3g})"


def _outcome(run: Mapping[str, Any]) -> dict[str, str]:
    name = run["outcome"]
    words, colour = palette.OUTCOMES.get(name, (name, palette.INK))
    fault = run["row"].get("fault")
    return {
        "mark": _MARKS.get(name, "✕"),
        "words": words + (f", fault: {fault}" if fault else ""),
        "colour": _css(colour),
    }


def _title(runs: Sequence[Mapping[str, Any]]) -> str:
    first = runs[0]
    agents = " and ".join(dict.fromkeys(run["agent"] for run in runs))
    return f"{first['scenario']}, {agents}, seed {first['seed']}"


def _embedded(content: Any) -> str:
    """JSON that may stand in a <script>."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _text(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
