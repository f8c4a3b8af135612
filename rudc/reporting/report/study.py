"""What a study's folder says, for a page: its figures, the tables and text it wrote, the sweeps below it."""

from __future__ import annotations

import base64
import contextlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rudc.errors import SweepError
from rudc.evaluation.manifest import read_manifest
from rudc.imports import rudc_command

_FENCE = re.compile(r"^```.*$", re.MULTILINE)
_CELL = re.compile(r"(?<!\\)\|")


def is_study(folder: Path) -> bool:
    """Whether a folder holds what `rudc study` writes: a table as Markdown with its CSV, or as a figure."""
    return any(
        text.with_suffix(other).is_file() for text in folder.glob("*.md") for other in (".csv", ".png")
    )


def study_content(folder: Path) -> dict[str, Any]:
    """What the page's template asks for. Raises SweepError for a folder that cannot be read."""
    try:
        texts = [
            {"name": path.name, "csv": _beside(path, ".csv"), "parts": list(parts(path.read_text("utf-8")))}
            for path in sorted(folder.glob("*.md"))
        ]
        figures = [
            {"name": path.name, "vector": _beside(path, ".pdf"), "source": _inlined(path)}
            for path in sorted(folder.glob("*.png"))
        ]
    except (OSError, UnicodeDecodeError) as error:
        raise SweepError(f"{folder} cannot be read: {error}") from None
    manifests = dict(_manifests(folder))
    return {
        "data": {},
        "source": str(folder),
        "texts": texts,
        "figures": figures,
        "commands": [rudc_command("report", str(sweep)) for sweep in manifests],
        "versions": next((said.get("versions", {}) for said in manifests.values()), {}),
    }


def _manifests(folder: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Folder and manifest of each sweep below; a folder whose manifest says no sweep is none."""
    for sweep in sorted(path.parent for path in folder.rglob("manifest.json")):
        with contextlib.suppress(SweepError):
            yield sweep, read_manifest(sweep)


def parts(text: str) -> Iterator[dict[str, Any]]:
    """A Markdown text as headings (`title`), fenced `code`, tables (`head`, `rows`, and `right`: which
    columns are numbers) and paragraphs (`text`: plain words and words set as code, by turns).
    """
    for k, stretch in enumerate(_FENCE.split(text)):
        if k % 2:
            yield {"code": stretch.strip("\n")}
            continue
        for block in re.split(r"\n\s*\n", stretch.strip()):
            yield from _block([line.strip() for line in block.splitlines()])


def _block(lines: Sequence[str]) -> Iterator[dict[str, Any]]:
    """What stands between two empty lines."""
    while lines and lines[0].startswith("#"):
        yield {"title": lines[0].lstrip("# ")}
        lines = lines[1:]
    table = [_cells(line) for line in lines if line.startswith("|")]
    before = "\n".join(line for line in lines if not line.startswith("|"))
    for text in re.split(r"^- |\n- ", before):  # each point of a list is a paragraph
        if text:
            yield {"text": text.replace("\n", " ").split("`")}
    if len(table) > 1:
        head, marks, *rows = table
        yield {"head": head, "rows": rows, "right": [mark.endswith(":") for mark in marks]}


def _cells(line: str) -> Sequence[str]:
    return [cell.strip().strip("*`").replace("\\|", "|") for cell in _CELL.split(line.strip("|"))]


def _beside(path: Path, suffix: str) -> str:
    """Name of the file beside it with another ending, if it is there."""
    other = path.with_suffix(suffix)
    return other.name if other.is_file() else ""


def _inlined(path: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"
