"""What all figures share: size, type, colours, saving. matplotlib by its object interface (Agg: no window, no
global state); a figure depends on its data alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rudc.drawing.palette import SERIES
from rudc.errors import StorageError
from rudc.files import replacing

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    """A figure of `size` inches with (rows, columns) axes, saved to `path` in the end. Raises
    StorageError.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=size, dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure, figure.subplots(rows, columns, squeeze=False, **sharing)
        try:
            with replacing(path) as file:
                figure.savefig(file, format=path.suffix[1:] or "png", metadata={"Software": None})
        except ValueError as error:
            raise StorageError(f"cannot write {path}: {error}") from None


def bare(axes: Axes, text: str) -> None:
    """Say why a panel shows nothing."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#767d88")
    axes.grid(False)


def legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """One legend for all panels."""
    figure.legend(handles=list(handles), loc="outside lower center", ncols=len(handles))
