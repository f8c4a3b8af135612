"""`rudc residual`: collect, fit, evaluate."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rudc.cli.console import Quiet, note, print_table, warn
from rudc.errors import InputError
from rudc.hints import install_command

if TYPE_CHECKING:
    from rudc.safety.residual import ResidualPredictor
    from rudc.training.residual_data import Dataset

app = typer.Typer(no_args_is_help=True, help="The predictor of what the filter's model leaves out.")

USUAL = "adjustment"
"""kind of action that is taken where none is named"""

Data = Annotated[Path, typer.Argument(metavar="DATA", help="File of `rudc residual collect`.")]


@app.command()
def collect(
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Where the samples go.")],
    samples: Annotated[
        int, typer.Option(min=100, help="Samples of vehicles, and as many of road edges.")
    ] = 200_000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    agent: Annotated[
        str | None, typer.Option("--agent", "-a", help="Whose actions; random ones if left out.")
    ] = None,
    action: Annotated[
        str | None, typer.Option(metavar="KIND", help="Kind of the random actions. Default: adjustment.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Drive, and record what the filter predicts and what really follows.

    **Example**: `rudc residual collect --out out/residual.safetensors`
    """
    from rudc.agents.registry import make_agent
    from rudc.env.action import ActionKind, read_action
    from rudc.files import check_place, make_folder_of
    from rudc.training.residual_data import collect as run
    from rudc.training.residual_data import save_dataset

    if action is not None and agent is not None:
        raise InputError("--action is for random actions, and --agent drives with its own: give one of them")
    driver = read_action(action or USUAL) if agent is None else make_agent(agent)
    if not isinstance(driver, ActionKind) and driver.ego_driver == "sumo":
        raise InputError("SUMO's own driver takes no actions: nothing can be predicted of them")
    check_place(out, "a set of samples", ".safetensors")
    make_folder_of(out)
    said = lost = 0

    def advance(count: int, left_out: int) -> None:
        nonlocal said, lost
        lost = left_out
        if count - said >= 20_000:
            said = count
            note(f"{count}/{samples} samples")

    save_dataset(out, run(samples, seed, driver, advance))
    if lost:
        warn(f"warning: {lost} episodes could not be set up or driven to their end: left out")
    note(f"done: {out}")


@app.command()
def fit(
    data: Data,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Where the predictor goes.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of first weights and batches.")] = 0,
    quiet: Quiet = False,
) -> None:
    """Learn a predictor, and measure it on the episodes that were held out.

    **Example**: `rudc residual fit out/residual.safetensors --out out/adjustment.safetensors`
    """
    if find_spec("torch") is None:
        raise InputError(f"fitting needs torch: {install_command('train')}")
    from safetensors.numpy import save

    from rudc.files import check_place, make_folder_of, write_atomically
    from rudc.training.residual_data import load_dataset
    from rudc.training.residual_fit import EPOCHS
    from rudc.training.residual_fit import fit as run

    def progress(head: str, epoch: int, loss: float) -> None:
        if epoch % 50 == 0:
            note(f"{head}, epoch {epoch}/{EPOCHS}: loss {loss:.4f}")

    dataset = load_dataset(data)
    check_place(out, "a predictor", ".safetensors")
    make_folder_of(out)
    predictor = run(dataset, seed, progress=progress)
    write_atomically(out, save(predictor.arrays))
    _show(dataset, predictor, only_held_out=True)


@app.command()
def evaluate(
    data: Data,
    predictor: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The predictor; the shipped one if left out.")
    ] = None,
    action: Annotated[
        str | None,
        typer.Option(metavar="KIND", help="Kind of action of the shipped predictor. Default: adjustment."),
    ] = None,
    held_out: Annotated[
        bool, typer.Option("--held-out", help="Only on the episodes that fitting to DATA leaves out.")
    ] = False,
) -> None:
    """Measure a predictor.

    **Example**: `rudc residual evaluate out/residual.safetensors --held-out`
    """
    if find_spec("torch") is None:
        raise InputError(f"measuring needs torch: {install_command('train')}")
    from rudc.env.action import read_action
    from rudc.safety.residual import load_predictor, shipped_predictor
    from rudc.training.residual_data import load_dataset

    if action is not None and predictor is not None:
        raise InputError("--action chooses a shipped predictor, --predictor names a file: give one of them")
    kind = action or USUAL
    read_action(kind)  # refuses a kind that does not exist
    chosen = shipped_predictor(kind) if predictor is None else load_predictor(predictor)
    _show(load_dataset(data), chosen, only_held_out=held_out)


def _show(dataset: Dataset, predictor: ResidualPredictor, *, only_held_out: bool) -> None:
    from rudc.training.residual_fit import evaluate as run

    rows = []
    for found in run(dataset, predictor, only_held_out=only_held_out):
        for name, score in (("model alone", found.model), ("with predictor", found.predictor)):
            cells = [f"{score.r2:.5f}", f"{score.mae:.4f}", f"{score.rmse:.4f}"]
            explained = f"{found.explained:.3f}" if name == "with predictor" else ""
            rows.append([found.about, str(found.samples), name, *cells, explained])
    print_table(
        ["constraints", "samples", "change of h by", "R2", "MAE (m2)", "RMSE (m2)", "share of w explained"],
        rows,
    )
