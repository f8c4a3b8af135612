"""Pages of one file: a template that extends `base.html`, a style, scripts, and data as JSON put into it.

The frame, its style and script lie beside this file. A page forbids itself any request, follows the system's
light or dark, and has a button for the other.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from rudc.drawing import palette
from rudc.errors import InputError
from rudc.files import try_place

_HERE = Path(__file__).parent
_MARKS = {"success": "✓", "frozen": "…"}
"""stand before an outcome; before a violation a cross"""


def check_page(path: Path, what: str) -> None:
    """Raise InputError if no page can be written to such a file; `what`: what the page is, with an
    article."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{what} is an .html file, not {path.name!r}")
    try_place(path)


def render(
    folder: Path,
    title: str,
    *,
    template: str = "page.html",
    style: str,
    scripts: Sequence[str],
    data: Mapping[str, Any],
    **content: Any,
) -> str:
    """The text of a page from a template, a style and scripts of a folder.

    `data`: id -> what a script finds there as JSON; `content`: what the template asks for.
    """
    loader = jinja2.FileSystemLoader([folder, _HERE])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    sources = [_HERE / "base.js", *(folder / name for name in scripts)]
    return environment.get_template(template).render(
        title=title,
        style="\n".join(_text(path) for path in (_HERE / "base.css", folder / style)),
        script="\n".join(map(_text, sources)),
        data={name: _embedded(value) for name, value in data.items()},
        **content,
    )


def colours() -> dict[str, str]:
    """The palette's colours, as CSS has them."""
    return {name.lower(): css(value) for name, value in vars(palette).items() if _is_colour(value)}


def css(colour: palette.Colour) -> str:
    """A colour as CSS has it."""
    alpha = colour[3] / 255 if len(colour) == 4 else 1.0
    return f"rgba({colour[0]},{colour[1]},{colour[2]},{alpha:.3g})"


def badge(outcome: str, fault: str | None = None) -> dict[str, str]:
    """An outcome in words, with a mark and a colour of its own."""
    words, colour = palette.OUTCOMES.get(outcome, (outcome, palette.INK))
    return {
        "mark": _MARKS.get(outcome, "✕"),
        "words": words + (f", fault: {fault}" if fault else ""),
        "colour": css(colour),
    }


def _is_colour(value: Any) -> bool:
    return isinstance(value, tuple) and len(value) in (3, 4) and all(isinstance(v, int) for v in value)


def _embedded(content: Any) -> str:
    """JSON that may stand in a <script>."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")
