"""Scenarios and sweeps in which agents drove them -> a folder to look at, offline.

    index.html                       every scenario: picture, clip, why it is out of distribution, its file,
                                     rates of each agent, and replays, of the first sweep that has it
    pictures/, clips/, replays/      NAME.png, NAME.webp, NAME-OUTCOME.html, NAME-both.html
    SWEEP.html                       the report of each sweep, or SWEEP-2.html where that name is taken

Replays are episodes of the sweeps, found by their rows and driven again: one of each outcome that occurs; and
two of these beside each other where they are the same episode, driven by two
agents. The folder depends on scenarios, sweeps and code alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any, NamedTuple

from rudc.drawing.preview import draw_preview
from rudc.evaluation.columns import RATES, rates_of
from rudc.evaluation.rerun import Swept
from rudc.files import make_folder, write_atomically
from rudc.reporting.html.page import badge, render
from rudc.reporting.replay.again import Replayed, replayed
from rudc.reporting.replay.page import save_replay
from rudc.reporting.report.page import save_report
from rudc.scenario.keys import sections
from rudc.scenario.library import find_file, text_of
from rudc.scenario.model import Scenario

_FOLDER = Path(__file__).parent
INDEX = "index.html"
PICTURE_SEED = 1
"""seed of the episode whose first scene is drawn"""
FAILURES = ("collision", "off_road", "wrong_way", "frozen")
"""outcomes, the worst first"""


class Shown(NamedTuple):
    """An episode to be shown."""

    folder: Path
    number: int
    """of its row, from 1"""
    row: Mapping[str, str]
    swept: tuple[str, ...] = ()
    """columns of swept values"""

    @property
    def episode(self) -> tuple[str, ...]:
        """What tells the episode from others, whoever drives in it."""
        return tuple(self.row[name] for name in ("seed", *self.swept))


def save_gallery(
    out: Path, sweeps: Sequence[Path], scenarios: Sequence[Scenario], say: Callable[[str], None]
) -> None:
    """Write the folder; `say` is told of each scenario. Raises SweepError, ScenarioError, StorageError."""
    make_folder(out)
    swept = {folder: Swept(folder) for folder in sweeps}  # read once: a sweep that ends sorts its rows
    rows = {folder: _numbered(folder, sweep) for folder, sweep in swept.items()}
    cards = []
    for scenario in scenarios:
        cards.append(_card(out, scenario, rows, swept))
        say(f"{scenario.name}: {', '.join(shown['what'] for shown in cards[-1]['replays']) or 'picture'}")
    names = report_names(sweeps)
    reports = [{"name": str(folder), "file": name} for folder, name in zip(sweeps, names, strict=True)]
    for folder, report in zip(sweeps, reports, strict=True):
        save_report(folder, out / report["file"])
    text = render(
        _FOLDER, "Gallery of scenarios", template="gallery.html", style="gallery.css",
        scripts=("gallery.js",), data={}, cards=cards, reports=reports,
    )  # fmt: skip
    write_atomically(out / INDEX, text)
    say(f"{out / INDEX} written")


def report_names(sweeps: Sequence[Path]) -> list[str]:
    """The file of each sweep's report, no two the same and none the gallery's own page."""
    found = [INDEX]
    for folder in sweeps:
        own = folder.absolute().name
        numbered = (f"{own}-{k}.html" for k in count(2))
        found.append(next(name for name in chain([f"{own}.html"], numbered) if name not in found))
    return found[1:]


def _numbered(folder: Path, sweep: Swept) -> dict[str, list[Shown]]:
    """Scenario -> its episodes that ran to an end."""
    found: dict[str, list[Shown]] = {}
    for number, row in enumerate(sweep.rows, 1):
        if not row["error"]:
            found.setdefault(row["scenario"], []).append(Shown(folder, number, row, sweep.parameters))
    return found


def _card(
    out: Path,
    scenario: Scenario,
    rows: Mapping[Path, Mapping[str, Sequence[Shown]]],
    swept: Mapping[Path, Swept],
) -> dict[str, Any]:
    """What the page says of a scenario; its picture, clip and replays are written."""
    name, kinds = scenario.name, list(dict.fromkeys(event.kind for event in scenario.events))
    draw_preview(scenario, PICTURE_SEED, out / "pictures" / f"{name}.png")
    episodes = next((known[name] for known in rows.values() if name in known), [])
    clip = out / "clips" / f"{name}.webp"
    shown = chosen(episodes)
    driven = {
        what: replayed(one.folder, swept[one.folder].episode(one.number), clip if what == "success" else None)
        for what, one in shown.items()
    }
    replays = [_replay(out, what, shown[what], done) for what, done in driven.items()]
    return {
        "scenario": scenario,
        "events": [kind.replace("_", " ") for kind in kinds],
        "keys": [section for kind in kinds for section in sections(kind)],
        "file": text_of(find_file(name)),
        "rates": agent_rates(episodes),
        "replays": replays,
        "pair": _pair(out, shown, driven),
        "clip": f"clips/{name}.webp" if "success" in shown else "",
        "sweep": episodes[0].folder if episodes else "",
    }


def chosen(episodes: Sequence[Shown]) -> dict[str, Shown]:
    """Outcome -> an episode that ended so, of those there are. Failures are those of the agent that has most
    of them; success is the best agent's, if it can be in an episode that is shown to fail.
    """
    found: dict[str, Shown] = {}
    for outcome in (*FAILURES, "success"):
        theirs = [one for one in episodes if one.row["outcome"] == outcome]
        if not theirs:
            continue
        counts = {agent: sum(o.row["agent"] == agent for o in theirs) for agent in _agents(theirs)}
        most = max(counts.values())
        agents = [agent for agent, count in counts.items() if count == most]
        agent = agents[-1] if outcome == "success" else agents[0]
        known = {shown.episode: k for k, shown in reversed([*enumerate(found.values())])}
        own = [one for one in theirs if one.row["agent"] == agent]
        found[outcome] = min(own, key=lambda one: known.get(one.episode, len(known)))
    return {outcome: found[outcome] for outcome in ("success", *FAILURES) if outcome in found}


def agent_rates(episodes: Sequence[Shown]) -> list[dict[str, Any]]:
    """SR, FR and VR of each agent, in percent."""
    return [
        {"agent": agent, "episodes": len(ends), "rates": [rates_of(Counter(ends))[name] for name in RATES]}
        for agent in _agents(episodes)
        if (ends := [one.row["outcome"] for one in episodes if one.row["agent"] == agent])
    ]


def _agents(episodes: Sequence[Shown]) -> list[str]:
    return list(dict.fromkeys(one.row["agent"] for one in episodes))


def pair_of(shown: Mapping[str, Shown]) -> tuple[str, str] | None:
    """Of the episodes shown, one that fails and the success in the same episode, if there are such."""
    best = shown.get("success")
    for what in FAILURES:
        if best is not None and what in shown and shown[what].episode == best.episode:
            return what, "success"
    return None


def _pair(out: Path, shown: Mapping[str, Shown], driven: Mapping[str, Replayed]) -> dict[str, str]:
    """A page of two agents in one episode; empty where there are none."""
    both = pair_of(shown)
    if both is None:
        return {}
    rows = [shown[what].row for what in both]
    path = Path("replays") / f"{rows[0]['scenario']}-both.html"
    save_replay(out / path, [driven[what].page for what in both], [driven[what].check for what in both])
    return {"file": str(path), "agents": " and ".join(row["agent"] for row in rows), "seed": rows[0]["seed"]}


def _replay(out: Path, what: str, shown: Shown, done: Replayed) -> dict[str, Any]:
    """Write the page of an episode that was driven again."""
    row, path = shown.row, Path("replays") / f"{shown.row['scenario']}-{what}.html"
    save_replay(out / path, [done.page], [done.check])
    return {
        "what": what,
        "file": str(path),
        "agent": row["agent"],
        "seed": row["seed"],
        "badge": badge(done.page["outcome"], done.page["row"].get("fault")),
        "same": done.same,
    }
