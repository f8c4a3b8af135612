"""`rudc sweep --verify`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from rudc.cli.console import note, print_table, sweep_progress, warn
from rudc.cli.options import cores
from rudc.errors import InputError

if TYPE_CHECKING:
    from rudc.evaluation.verify import Verification

SHOWN = 8
"""episodes that are named, of those that came out differently"""


def verify_folder(
    folder: Path, others: Sequence[str], share: float | None, seed: int, workers: int | None, limit_s: float
) -> None:
    """Run a sample of a sweep's episodes again, and say whether their rows come out the same; leaves with 1
    if not. `others`: options that were given but cannot be combined with it. Raises InputError, SweepError.
    """
    from rudc.evaluation.runner import EpisodeRunner
    from rudc.evaluation.unfinished import lacking
    from rudc.evaluation.verify import SHARE, verify_sweep

    if others:
        raise InputError(f"--verify takes a sweep as it was: leave out {', '.join(others)}")
    progress = sweep_progress(rows="")
    try:
        found = verify_sweep(
            folder,
            partial(EpisodeRunner, limit_s=limit_s, folder=Path.cwd()),
            share=SHARE if share is None else share,
            seed=seed,
            workers=workers or cores(),
            limit_s=limit_s,
            progress=progress,
        )
    except KeyboardInterrupt:
        progress.close()
        note("interrupted")
        raise typer.Exit(130) from None
    finally:
        progress.close()
    if text := lacking(folder):
        warn(f"warning: {text}")
    sample = f"{found.again} of {found.of} episodes of {folder} run again"
    if found.failed:
        sample += f" ({found.failed} that failed left out)"
    if not found.other:
        typer.echo(f"{sample}: every row came out the same (timing columns apart)")
        return
    typer.echo(f"{sample}: {len(found.other)} came out differently\n")
    _tell(found)
    raise typer.Exit(1)


def _tell(found: Verification) -> None:
    """Which columns, how far off, in which episodes, and why that may be."""
    rows = [
        [off.column, str(off.episodes), "" if math.isnan(off.largest) else f"{off.largest:.6g}"]
        for off in found.columns
    ]
    print_table(["column", "episodes", "largest difference"], rows, right=(1, 2))
    typer.echo()
    for rerun, differences in found.other[:SHOWN]:
        typer.echo(f"row {rerun.number}: {rerun.task}: {'; '.join(map(str, differences))}")
    if len(found.other) > SHOWN:
        typer.echo(f"and {len(found.other) - SHOWN} more")
    if found.changes:
        typer.echo("\nWhat differs here from where the sweep ran:")
        for change in found.changes:
            typer.echo(f"  {change}")
    elif found.unfinished < len(found.other):
        typer.echo(
            "\nNothing that manifest.json names differs here: same inputs, versions and processor. Either "
            "rows were edited, or an agent does not do the same twice, or a file has changed that an agent "
            "reads and manifest.json does not name (its class can name it: reads = (...))"
        )
    if found.unfinished:
        typer.echo(
            f"\n{found.unfinished} of them could not be run again, for the reason in `error`. If time ran "
            "out, --episode-limit gives them more"
        )
