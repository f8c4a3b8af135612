"""Trainings compared, from training to tables: Tab. "Performance comparison" and "Ablation study".

The campaign's file says what is compared (rudc/studies/campaign.py). Trainings are taken or made
(rudc/studies/trained.py). Every agent drives the same episodes of both tasks and of all scenarios out of
distribution, in sweeps of its own, so that rows and training seeds can be added later: the tables then also
have what earlier calls left in the folder. The folder gets

    NAME.md             everything below, to read
    metrics.csv         each row in each place: mean, std over training seeds, interval, IQM and its interval
    pairs.csv           each two rows in the same episodes, with McNemar's p
    against_paper.csv   ours and the paper's one after the other
    trainings.csv       what drove: training seeds, decisions, and what is missing, with the reason
    curves.csv, .png, .pdf    success, violations, frozen and reward over training
    claims.csv, .md     what the paper says, held or not (rudc/studies/claims.py)
    in_distribution/, out_of_distribution/    episodes.csv of all rows, for `rudc table`
    sweeps/, trainings/ what all of it was made from
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rudc.agents.registry import make_agent
from rudc.errors import AgentError, InputError
from rudc.evaluation.manifest import manifest, read_manifest, resumed
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import MISSING, csv_text, markdown
from rudc.files import make_folder, past_links
from rudc.hints import listed
from rudc.reporting.curves import draw_curves
from rudc.scenario.model import Scenario
from rudc.studies.base import (
    Order,
    Report,
    in_distribution,
    kinds_of_errors,
    out_of_distribution,
    write,
)
from rudc.studies.campaign import OUTSIDE, Campaign, Effort, Row, read_campaign
from rudc.studies.claims import claims_markdown, judge
from rudc.studies.curves import combine, curves, shortened
from rudc.studies.outcomes import Outcomes
from rudc.studies.seed_tables import (
    Line,
    iqm_markdown,
    lines_of,
    metrics_markdown,
    pair_lines,
    pairs_markdown,
    paper_lines,
    paper_markdown,
)
from rudc.studies.trained import Trained, Trainings, trainings_for, trainings_there
from rudc.training.log_curves import Key, Series, read_training

INSIDE = "in distribution"


class Driver(NamedTuple):
    """A trained agent in a row of the tables."""

    row: Row
    trained: Trained
    agent: str

    @property
    def name(self) -> str:
        """Of its sweeps."""
        return f"{self.row.name}-seed{self.trained.seed}"


class Ran(NamedTuple):
    """What was driven."""

    campaign: Campaign
    rows: tuple[Row, ...]
    """rows of the tables, whether they drove or not"""
    effort: Effort
    drivers: tuple[Driver, ...]
    missing: tuple[str, ...]
    """trainings that did not drive, and why"""
    domains: Mapping[str, tuple[Scenario, ...]]
    outcomes: Outcomes

    @property
    def places(self) -> dict[str, tuple[str, ...]]:
        """Each task, and all scenarios out of distribution together -> their scenarios."""
        tasks = {scenario.name: (scenario.name,) for scenario in self.domains[INSIDE]}
        return {**tasks, OUTSIDE: tuple(scenario.name for scenario in self.domains[OUTSIDE])}


def run(order: Order, progress: Callable[[str], Progress], name: str = "comparison") -> Report:
    """The campaign of that name, as ordered."""
    campaign = read_campaign(name)
    chosen = campaign.chosen(order.agents)
    effort = campaign.budgets[order.budget].with_episodes(order.episodes)
    order = replace(order, out=past_links(order.out))
    seeds = order.training_seeds or effort.seeds
    asked = [(row, seed) for row in chosen for seed in seeds]
    before = _driven_before(campaign, order, asked)
    domains = {INSIDE: in_distribution(), OUTSIDE: out_of_distribution(order.budget)}
    rows = tuple(row for row in campaign.rows if row in (*chosen, *(row for row, _ in before)))
    ran = Ran(campaign, rows, effort, (), (), domains, Outcomes())
    kept, left_out = _kept(ran, before, order)
    wanted = list({row.wanted.name: row.wanted for row in chosen}.values())
    trainings = trainings_for(wanted, seeds, order, effort.settings, progress)
    added, missing = _drivers(asked, trainings)
    drivers = sorted([*added, *kept], key=lambda driver: (rows.index(driver.row), driver.trained.seed))
    if not drivers:
        where = "" if order.trainings is None else f" in {order.trainings}"
        raise InputError(f"no agent to drive{where}: {'; '.join(missing)}")
    make_folder(order.out)
    ran = ran._replace(drivers=tuple(drivers), missing=(*missing, *left_out))
    errors: list[str] = []
    with trainings.named_from():
        for driver in drivers:
            for domain in domains:
                errors += _drive(ran, driver, domain, order, progress)
    return _report(ran, order.out, tuple(dict.fromkeys(errors)))


def _driven_before(
    campaign: Campaign, order: Order, asked: Sequence[tuple[Row, int]]
) -> list[tuple[Row, int]]:
    """Rows and training seeds of the campaign whose sweeps the folder holds, without those asked for now.
    Raises InputError if there are some and `--resume` was not given.
    """
    there = {path.parent.name for path in (order.out / "sweeps").glob("*/*-seed*/manifest.json")}
    names = [name.rpartition("-seed") for name in sorted(there)]
    seeds = [(name, int(seed)) for name, _, seed in names if seed.isdecimal()]
    found = [(row, seed) for row in campaign.rows for name, seed in seeds if name == row.name]
    found = [pair for pair in found if pair not in asked]
    if found and not order.resume:
        others = listed([f"{row.name}-seed{seed}" for row, seed in found], 4)
        raise InputError(
            f"{order.out} is not empty ({others} drove); add --resume to add to its tables, or give another "
            "--out"
        )
    return found


def _kept(ran: Ran, before: Sequence[tuple[Row, int]], order: Order) -> tuple[list[Driver], list[str]]:
    """Who drove before and stays in the tables, and who is left out, since the training is gone. Raises
    SweepError where one drove other episodes.
    """
    if not before:
        return [], []
    trainings = trainings_there([(row.wanted, seed) for row, seed in before], order, ran.effort.settings)
    kept, missing = _drivers(before, trainings)
    with trainings.named_from():
        for driver in kept:
            for domain in ran.domains:
                plan, folder = _sweep(ran, driver, domain, order)
                if (folder / "manifest.json").is_file():
                    resumed(read_manifest(folder), manifest(plan), folder)
    return kept, [f"{text}; what it drove before is left out" for text in missing]


def _drivers(pairs: Sequence[tuple[Row, int]], trainings: Trainings) -> tuple[list[Driver], list[str]]:
    """The drivers for pairs of row and training seed, and what is missing. An agent that cannot be made as
    its row says (for example sigma by route for an agent that was never calibrated) counts as missing.
    """
    found, missing = [], list(trainings.missing)
    with trainings.named_from():
        for row, seed in pairs:
            for trained in trainings.of(row.wanted.name):
                if trained.seed != seed:
                    continue
                driver = Driver(row, trained, row.agent(trained.agent))
                try:
                    make_agent(driver.agent)
                except AgentError as error:
                    missing.append(f"{row.name}-seed{trained.seed}: {error}")
                else:
                    found.append(driver)
    return found, missing


def _sweep(ran: Ran, driver: Driver, domain: str, order: Order) -> tuple[SweepPlan, Path]:
    """What one agent drives in one domain, and where."""
    episodes = ran.effort.episodes if domain == INSIDE else ran.effort.outside
    plan = SweepPlan(ran.domains[domain], (driver.agent,), episodes, order.seed)
    return plan, order.out / "sweeps" / _folder(domain) / driver.name


def _drive(
    ran: Ran, driver: Driver, domain: str, order: Order, progress: Callable[[str], Progress]
) -> tuple[str, ...]:
    """One agent's sweep in one domain; what went wrong, once each."""
    plan, folder = _sweep(ran, driver, domain, order)
    result = run_sweep(
        plan,
        folder,
        partial(EpisodeRunner, folder=Path.cwd()),
        workers=order.workers,
        resume=order.resume,
        progress=progress(f"{driver.name}, {domain}"),
    )
    ran.outcomes.add(driver.row.name, driver.trained.seed, result.rows)
    return kinds_of_errors(result.rows)


def _folder(domain: str) -> str:
    return domain.replace(" ", "_")


def _report(ran: Ran, out: Path, errors: tuple[str, ...]) -> Report:
    each = {scenario.name: (scenario.name,) for scenario in ran.domains[OUTSIDE]}
    every = {**ran.places, **each}
    lines = lines_of(ran.rows, ran.outcomes, every)
    pairs = pair_lines(ran.rows, ran.campaign.reference, ran.outcomes, every)
    papers = paper_lines(ran.campaign, ran.rows, lines)
    verdicts = judge(ran.campaign, ran.outcomes, ran.places)
    drawn, notes = _curves(ran, out)
    claims = claims_markdown(verdicts)
    text = _page(ran, lines, pairs, papers, claims)
    tables = {
        "metrics.csv": lines,
        "pairs.csv": pairs,
        "against_paper.csv": papers,
        "trainings.csv": _trainings(ran),
        "claims.csv": [verdict._asdict() for verdict in verdicts],
    }
    files = [
        write(out / f"{ran.campaign.name}.md", text),
        *(write(out / name, csv_text(table)) for name, table in tables.items() if table),
        write(out / "claims.md", claims),
        *_episodes(ran, out),
        *drawn,
    ]
    return Report(text, tuple(files), (*ran.missing, *notes), errors)


def _page(ran: Ran, lines: Sequence[Line], pairs: Sequence[Line], papers: Sequence[Line], claims: str) -> str:
    """Everything to read, in one file."""
    effort, reference = ran.effort, next(r for r in ran.campaign.rows if r.name == ran.campaign.reference)
    parts = [
        f"# Study {ran.campaign.name}\n",
        f"{effort.episodes} episodes of each task, {effort.outside} of each of the "
        f"{len(ran.domains[OUTSIDE])} scenarios out of distribution, for each training; the same for all. "
        "`mean (std) [low, high]`: std over training seeds, 95 % interval over seeds and episodes "
        "(rudc/evaluation/seeds.py).\n",
        "## What drove\n",
        _trainings_markdown(ran),
    ]
    for place in ran.places:
        here = [line for line in lines if line["place"] == place]
        tested = [p for p in pairs if (p["place"], p["against"]) == (place, reference.name)]
        beside = [line for line in papers if line["place"] == place]
        parts += [f"## {place}\n", metrics_markdown(here)]
        parts += ["Interquartile means:\n", iqm_markdown(here)]
        if tested:
            parts += [f"Against {reference.heading} in the same episodes (McNemar's p):\n"]
            parts += [pairs_markdown(tested)]
        if beside:
            parts += ["Beside the paper's, which drove in another simulator:\n", paper_markdown(beside)]
    return "\n".join([*parts, "## What the paper says\n", claims])


def _trainings(ran: Ran) -> list[Line]:
    """A line for each training that drove, and for each that is missing."""
    drove = [
        {
            "row": driver.row.name,
            "title": driver.row.heading,
            "training_seed": driver.trained.seed,
            "steps": driver.trained.steps,
            "agent": driver.agent,
            "missing": "",
        }
        for driver in ran.drivers
    ]
    absent = [text.partition(": ") for text in ran.missing]
    return drove + [
        {"row": name.rpartition("-seed")[0], "title": "", "training_seed": name.rpartition("-seed")[2],
         "steps": "", "agent": "", "missing": reason}
        for name, _, reason in absent
    ]  # fmt: skip


def _trainings_markdown(ran: Ran) -> str:
    rows = []
    for row in ran.rows:
        own = [d.trained for d in ran.drivers if d.row == row]
        stems = {f"{row.wanted.name}-seed", f"{row.name}-seed"}
        absent = [t for t in ran.missing if t.partition(": ")[0].rstrip("0123456789") in stems]
        steps = ", ".join(map(str, dict.fromkeys(t.steps for t in own)))
        seeds = ", ".join(str(t.seed) for t in own)
        agents = ", ".join(d.trained.agent for d in ran.drivers if d.row == row)
        said = [agents, seeds, steps, "; ".join(absent)]
        rows.append([row.heading, row.name, *(text or MISSING for text in said)])
    headings = ["", "row", "trainings", "training seeds", "decisions", "missing"]
    return markdown(headings, rows, left=len(headings))


def _episodes(ran: Ran, out: Path) -> list[Path]:
    """The episodes of all rows, one file a domain."""
    table, files = ran.outcomes.table(), []
    for domain, scenarios in ran.domains.items():
        names = {scenario.name for scenario in scenarios}
        mine = [episode for episode in table if episode["scenario"] in names]
        if mine:
            make_folder(out / _folder(domain))
            files.append(write(out / _folder(domain) / "episodes.csv", csv_text(mine)))
    return files


def _curves(ran: Ran, out: Path) -> tuple[list[Path], list[str]]:
    """The files of training curves, each training once under the title of its first row, and notes about
    them. A training whose logs cannot be read is left out.
    """
    titles = {row.wanted.name: row.heading for row in reversed(ran.rows)}
    read: dict[str, list[dict[Key, Series]]] = {}
    notes = []
    for trained in {driver.trained.agent: driver.trained for driver in ran.drivers}.values():
        try:
            training = read_training(trained.logs)
        except InputError as error:
            notes.append(f"{trained.name}-seed{trained.seed} is not in the curves: {error}")
        else:
            read.setdefault(titles[trained.name], []).append(training)
    notes += shortened(read)
    lines = [line for title, members in read.items() for line in combine(title, members)]
    if not lines:
        return [], notes
    files = [write(out / "curves.csv", csv_text(lines)), draw_curves(curves(lines), out / "curves.png")]
    return [*files, files[-1].with_suffix(".pdf")], notes
