"""What all figures share: size, type, colours, saving. matplotlib by its object interface (Agg: no window, no
global state); a figure depends on its data alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rudc.drawing.palette import SERIES
from rudc.errors import StorageError
from rudc.files import replacing

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

INK, FAINT = "#22262d", "#c9ced6"
PALETTE = tuple("#{:02x}{:02x}{:02x}".format(*colour[:3]) for colour in SERIES)
"""of curves, as matplotlib has them"""

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8eaee",
    "grid.linewidth": 0.7,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}


@contextmanager
def grid(
    rows: int, columns: int, size: tuple[float, float], path: Path, **sharing: Any
) -> Iterator[tuple[Figure, np.ndarray]]:
    """A figure of `size` inches with (rows, columns) axes, saved to `path` in the end, and as a PDF beside
    it. Raises StorageError.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=size, dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, figure.subplots(rows, columns, squeeze=False, **sharing)
        for target in dict.fromkeys((path, path.with_suffix(".pdf"))):
            _save(figure, target)
            figure.set_layout_engine(None)  # it is laid out


def _save(figure: Figure, path: Path) -> None:
    """Write a figure, without metadata that depend on the day or the version."""
    form = path.suffix[1:] or "png"
    metadata = {"pdf": {"CreationDate": None, "Creator": None, "Producer": None}, "png": {"Software": None}}
    try:
        with replacing(path) as file:
            figure.savefig(file, format=form, metadata=metadata.get(form))
    except ValueError as error:
        raise StorageError(f"cannot write {path}: {error}") from None


LABEL_SIZE = 7.5
"""points, height of a label's text"""
NEAR = 4.0
"""points between a label and its point, where there is room"""


class Label(NamedTuple):
    """A text that belongs to a point."""

    axes: Axes
    place: tuple[float, float]
    """the point, in the data's units"""
    text: str
    colour: str


def place_labels(figure: Figure, labels: Sequence[Label]) -> list[Annotation]:
    """Write each label as near to its point as it can stand without lying over another; a thin line leads to
    the point where that is farther off. To be called when everything else is drawn.
    """
    figure.draw_without_rendering()
    taken: list[Bbox] = []
    written = []
    for label in labels:
        note = label.axes.annotate(
            label.text, label.place, xytext=(0, 0), textcoords="offset points", fontsize=LABEL_SIZE,
            color=label.colour, zorder=6,
        )  # fmt: skip
        note.set_in_layout(False)
        offset = _settle(note, taken)
        if max(map(abs, offset)) > NEAR:
            label.axes.annotate(
                "", label.place, xytext=offset, textcoords="offset points",
                arrowprops={"arrowstyle": "-", "color": label.colour, "lw": 0.4, "shrinkA": 0, "shrinkB": 0},
            ).set_in_layout(False)  # fmt: skip
        taken.append(note.get_window_extent())
        written.append(note)
    return written


def _settle(note: Annotation, taken: Sequence[Bbox]) -> tuple[float, float]:
    """Move a label to the nearest free place, or the farthest if none is free; its offset in points."""
    offset = (0.0, 0.0)
    for offset in _around():
        x, y = offset
        note.set_position(offset)
        note.set_horizontalalignment("left" if x > 0 else "right" if x < 0 else "center")
        note.set_verticalalignment("bottom" if y > 0 else "top" if y < 0 else "center")
        box = note.get_window_extent()
        if not any(box.overlaps(other) for other in taken):
            break
    return offset


def _around() -> Iterator[tuple[float, float]]:
    """Offsets in points round a point, the nearest first."""
    for ring in range(12):
        reach = NEAR + 7.0 * ring
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0)):
            yield reach * x, reach * y


def bare(axes: Axes, text: str) -> None:
    """Say why a panel shows nothing."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#767d88")
    axes.grid(False)


def legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """One legend for all panels, in as few lines as the figure's width takes."""
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()
