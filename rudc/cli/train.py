"""`rudc train`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rudc.cli.console import SILENCE_S, Quiet, note, progress_bar, shows_bars, warn
from rudc.cli.options import LiveReport, parse_overrides
from rudc.errors import InputError
from rudc.hints import install_command

if TYPE_CHECKING:
    from rudc.training.config import TrainConfig


def train(
    algorithm: Annotated[
        str | None,
        typer.Argument(
            metavar="ALGORITHM",
            help="Such as rudc-t, rudc-e, rudc-wo-cbf, sac, sac-lagrangian; may be left out to resume.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Folder for agent and logs; must be given."),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            metavar="SCENARIO", help="Train on this as it is, without the curriculum, unless --set gives one."
        ),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Decisions of the policy, in whole rounds. Default: 100000.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of everything random. Default: 0.")] = None,
    device: Annotated[
        str | None, typer.Option(help="Device that the learner runs on: cpu, cuda, ... Default: cpu.")
    ] = None,
    envs: Annotated[
        int | None, typer.Option(min=1, help="Worlds, each in a process of its own. Default: 2.")
    ] = None,
    configuration: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Preset: `default` (if left out), `paper` (everything as the paper has it), or a YAML file.",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Any value of config.json, e.g. learner.n_step=1."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the training in DIR; start it if there is none.")
    ] = False,
    report: LiveReport = False,
    quiet: Quiet = False,
) -> None:
    """Train an agent from scratch.

    DIR gets `checkpoint/` (the agent, which every `--agent` takes as `--agent DIR`, and what resuming needs),
    `progress.csv`, `evaluation.csv` (how it drives as training goes, in episodes that it does not learn
    from), `config.json`, `scenarios.json` (what it learns from) and `code.json` (digests of code that is not
    RUDC's). Ctrl-C keeps the last checkpoint, and `--resume` goes on from there to the same numbers as
    without a stop.

    **Examples**

    `rudc train rudc-wo-cbf --steps 20000 --out out/first`

    `rudc sweep dense_left_turn --agent out/first --episodes 100 --out out/first-sweep`

    `rudc train rudc-t --set observation=paper --set learner.n_step=1 --out out/ablation`
    """
    if out is None:
        raise InputError("where to? give a folder for the agent: --out DIR")
    if find_spec("torch") is None:
        raise InputError(f"training needs torch: {install_command('train')}")
    from rudc.agents.registry import name_of
    from rudc.imports import rudc_command

    given = {"scenario": scenario, "steps": steps, "seed": seed, "device": device, "envs": envs}
    changes = {f"training.{k}": v for k, v in given.items() if v is not None}
    if scenario is not None:
        changes["training.curriculum"] = None
    config = _config(algorithm, changes, configuration, parse_overrides(settings), out, resume)
    from rudc.training.trainer import train as run  # torch: what is wrong is said before it is loaded

    watcher = TrainBar(config) if shows_bars() else TrainLines(config)
    if report:
        watcher = Reported(watcher, out)
    try:
        done = run(config, out, watcher, resume=resume)
    finally:
        watcher.close()
    if not done:
        note("add --resume to go on")
        raise typer.Exit(130)
    note(f"done: {rudc_command('sweep', 'SCENARIO', '--agent', name_of(out), '--out', 'DIR')}")


def _config(
    algorithm: str | None,
    changes: dict[str, Any],
    preset: str | None,
    settings: dict[str, Any],
    out: Path,
    resume: bool,
) -> TrainConfig:
    from rudc.learning.algorithms import ALGORITHMS
    from rudc.training.config import TrainConfig
    from rudc.training.folder import stored_config
    from rudc.training.presets import fitting, left_out, preset_names, read_preset, set_otherwise

    twice = sorted(changes.keys() & settings.keys() - {"training.curriculum"})
    if twice:
        raise InputError(f"{twice[0]} is given twice, as an option and by --set")
    stored = stored_config(out) if resume else None
    if stored is None:
        if algorithm is None:
            known = ", ".join(ALGORITHMS)
            told = (
                f"{out} holds no training to go on with; give one of {known}"
                if resume
                else f"there are {known}"
            )
            raise InputError(f"which algorithm? {told}")
        config = TrainConfig.of(algorithm, changes | settings, preset or "default")
        if preset is not None and preset not in preset_names():
            own = read_preset(preset)
            fit = fitting(ALGORITHMS[algorithm], own, preset)
            _note_left_out(preset, [*left_out(own, fit), *left_out(fit, config.model_dump())])
        return config
    if algorithm not in (None, stored.algorithm):
        raise InputError(
            f"{out} holds a training with algorithm {stored.algorithm}, not {algorithm}: resume it as it is"
        )
    given = changes | settings
    # One key alone may differ: a section may be set, and then its parts.
    same = stored.changed(given) == stored
    other = [] if same else [key for key in given if stored.changed({key: given[key]}) != stored]
    if other == ["training.steps"]:
        raise InputError(
            f"{out} holds a training of {stored.training.steps} steps: resume it as it is (without --steps), "
            "or train anew in another folder; its learning rates fall over all its steps, so a longer one is "
            "another training from the first step on"
        )
    if other:
        raise InputError(f"{out} holds a training with another {', '.join(other)}: resume it as it is")
    if preset is not None:
        wanted = TrainConfig.of(stored.algorithm, given, preset)
        other = list(set_otherwise(read_preset(preset), wanted.model_dump(), stored.model_dump()))
        if other:
            raise InputError(
                f"{out} holds a training with another {', '.join(other)} than with --configuration {preset}: "
                "resume it as it is"
            )
    return stored


def _note_left_out(file: str, keys: list[str]) -> None:
    """Say which settings of a user's file have no effect with this algorithm and the other settings."""
    if keys:
        note(f"{file}: without effect here, and left out: {', '.join(keys)}")


def _note_rounding(config: TrainConfig) -> None:
    """Say how many steps will be made, where that is not the number given."""
    asked, made = config.training.steps, _Count(config).total
    if made != asked:
        note(f"{made} steps instead of {asked}: whole rounds of {config.round_steps} are made")


class _Count:
    """How far a training is, in the steps that `--steps` counts: decisions of the policy. Those of the
    reference driver, which come first, are counted apart.
    """

    def __init__(self, config: TrainConfig) -> None:
        self.before = config.seed_rounds * config.round_steps
        self.total = config.rounds * config.round_steps - self.before

    def of(self, decisions: int) -> str:
        """`STEPS/TOTAL steps` after so many decisions in all."""
        if decisions < self.before:
            return f"{decisions}/{self.before} steps of the reference driver"
        return f"{decisions - self.before}/{self.total} steps"


class TrainLines:
    """A line once it has begun, for each row of progress.csv, and at least every 30 s."""

    def __init__(self, config: TrainConfig) -> None:
        self._config, self._count = config, _Count(config)
        self._start = self._last = time.monotonic()
        self._first: int | None = None

    def advance(self, steps: int) -> None:
        """Say that it begins, the first time; then how far it is, if nothing was said for a while."""
        now = time.monotonic()
        if self._first is None:
            self._first, self._start, self._last = steps, now, now
            _note_rounding(self._config)
            before = f", after {self._count.before} of a reference driver" if self._count.before else ""
            note(f"training: {self._count.total} steps{before}")
        elif now - self._last > SILENCE_S:
            rate = (steps - self._first) / (now - self._start)
            self._say(f"{self._count.of(steps)}, {rate:.0f}/s")

    def progress(self, row: Mapping[str, Any]) -> None:
        """The row in short."""
        self._say(f"{row['steps']}/{self._count.total} steps, {_shown(row)}, {row['wall_s']:.0f} s")

    def note(self, text: str) -> None:
        """A line of its own."""
        self._say(text)

    def close(self) -> None:
        """Nothing to tidy up."""

    def _say(self, text: str) -> None:
        self._last = time.monotonic()
        note(text)


class TrainBar:
    """A bar that shows how far training is and how it goes, once it has begun."""

    def __init__(self, config: TrainConfig) -> None:
        self._config = config
        self._progress, self._count = progress_bar(), _Count(config)
        self._id = self._progress.add_task("starting", total=self._count.total)
        self._begun, self._seeding = False, True

    def advance(self, steps: int) -> None:
        """Show the bar, the first time; then move it. While the reference driver drives, say so."""
        if not self._begun:
            self._begun = True
            _note_rounding(self._config)
            self._progress.start()
        elif steps < self._count.before:
            self._progress.update(self._id, description=self._count.of(steps))
        elif self._seeding:
            self._seeding = False
            self._progress.update(self._id, description="")
        self._progress.update(self._id, completed=max(steps - self._count.before, 0))

    def progress(self, row: Mapping[str, Any]) -> None:
        """How it goes, beside the bar."""
        self._progress.update(self._id, description=_shown(row))

    def note(self, text: str) -> None:
        """A line above the bar."""
        self._progress.console.print(text, markup=False)

    def close(self) -> None:
        """Take it away."""
        if self._begun:  # else it would leave an empty line
            self._progress.stop()


class Reported:
    """A watcher, with a page that is kept fresh beside it, once the training has begun."""

    def __init__(self, inner: TrainBar | TrainLines, folder: Path) -> None:
        from rudc.reporting.report.live import LivePage

        self._inner, self._page, self._begun = inner, LivePage(folder), False

    def advance(self, steps: int) -> None:
        """Say how far it is; the first time, where the page is."""
        self._inner.advance(steps)
        if not self._begun:
            self._begun = True
            self._inner.note(f"live page: {self._page.path}")

    def progress(self, row: Mapping[str, Any]) -> None:
        """The row in short, and in the page."""
        self._inner.progress(row)
        self._page.refresh()

    def note(self, text: str) -> None:
        """A line of its own."""
        self._inner.note(text)

    def close(self) -> None:
        """Write the page for the last time, if there is anything to write."""
        self._inner.close()
        if self._begun:
            self._page.finish()
            if self._page.problem:
                warn(f"warning: no report: {self._page.problem}")


def _shown(row: Mapping[str, Any]) -> str:
    if not row["episodes"]:
        return "no episode ended"
    return f"{row['success']:.0%} success, reward {row['episode_reward']:.0f}"
