"""Scenarios and sweeps in which agents drove them -> a folder to look at, offline.

    index.html                       every scenario: picture, clip, why it is out of distribution, its file,
                                     rates of each agent, and replays
    pictures/, clips/, replays/      NAME.png, NAME.webp, NAME-OUTCOME.html
    SWEEP.html                       the report of each sweep

Replays are episodes of the sweeps, found by their rows and driven again: where they occur, a success, a
standstill and a violation. The folder depends on scenarios, sweeps and code alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rudc.drawing.preview import draw_preview
from rudc.evaluation.columns import RATES, happened, rates_of
from rudc.evaluation.folder import read_sweep
from rudc.files import make_folder, write_atomically
from rudc.reporting.html.page import badge, render
from rudc.reporting.replay.again import replayed
from rudc.reporting.replay.page import save_replay
from rudc.reporting.report.page import save_report
from rudc.scenario.library import find_file, text_of
from rudc.scenario.model import Scenario

_FOLDER = Path(__file__).parent
PICTURE_SEED = 1
"""of the episode whose first scene is drawn"""
WANTED = {"SR": "success", "FR": "standstill", "VR": "violation"}
"""rate -> what an episode is called that counts in it"""


class Shown(NamedTuple):
    """An episode to be shown."""

    folder: Path
    number: int
    """of its row, from 1"""
    row: Mapping[str, str]


def save_gallery(
    out: Path, sweeps: Sequence[Path], scenarios: Sequence[Scenario], say: Callable[[str], None]
) -> None:
    """Write the folder; `say` is told of each scenario. Raises SweepError, ScenarioError, StorageError."""
    make_folder(out)
    rows = {folder: _numbered(folder) for folder in sweeps}
    cards = []
    for scenario in scenarios:
        cards.append(_card(out, scenario, rows))
        say(f"{scenario.name}: {', '.join(shown['what'] for shown in cards[-1]['replays']) or 'picture'}")
    reports = [{"name": str(folder), "file": f"{folder.name}.html"} for folder in sweeps]
    for folder, report in zip(sweeps, reports, strict=True):
        save_report(folder, out / report["file"])
    text = render(
        _FOLDER, "Gallery of scenarios", template="gallery.html", style="gallery.css",
        scripts=("gallery.js",), data={}, cards=cards, reports=reports,
    )  # fmt: skip
    write_atomically(out / "index.html", text)
    say(f"{out / 'index.html'} written")


def _numbered(folder: Path) -> dict[str, list[Shown]]:
    """Scenario -> its episodes that ran to an end."""
    found: dict[str, list[Shown]] = {}
    for number, row in enumerate(read_sweep(folder)[0], 1):
        if not row["error"]:
            found.setdefault(row["scenario"], []).append(Shown(folder, number, row))
    return found


def _card(
    out: Path, scenario: Scenario, rows: Mapping[Path, Mapping[str, Sequence[Shown]]]
) -> dict[str, Any]:
    """What the page says of a scenario; its picture, clip and replays are written."""
    name = scenario.name
    draw_preview(scenario, PICTURE_SEED, out / "pictures" / f"{name}.png")
    episodes = next((known[name] for known in rows.values() if name in known), [])
    clip = out / "clips" / f"{name}.webp"
    replays = [
        _replay(out, what, shown, clip if what == "success" else None)
        for what, shown in chosen(episodes).items()
    ]
    return {
        "scenario": scenario,
        "events": list(dict.fromkeys(event.kind.replace("_", " ") for event in scenario.events)),
        "file": text_of(find_file(name)),
        "rates": agent_rates(episodes),
        "replays": replays,
        "clip": f"clips/{name}.webp" if any(shown["what"] == "success" for shown in replays) else "",
        "sweep": episodes[0].folder if episodes else "",
    }


def chosen(episodes: Sequence[Shown]) -> dict[str, Shown]:
    """`success`, `standstill`, `violation` -> an episode of it, of those there are. Failures are those of the
    agent that has most of them, collisions before other violations; success is the best agent's, if it can
    be in an episode that is shown to fail.
    """
    found: dict[str, Shown] = {}
    for rate in ("VR", "FR", "SR"):
        theirs = [one for one in episodes if happened(rate, one.row["outcome"])]
        if not theirs:
            continue
        counts = {agent: sum(o.row["agent"] == agent for o in theirs) for agent in _agents(theirs)}
        most = max(counts.values())
        agents = [agent for agent, count in counts.items() if count == most]
        agent = agents[-1] if rate == "SR" else agents[0]
        seeds = {shown.row["seed"] for shown in found.values()}
        own = [one for one in theirs if one.row["agent"] == agent]
        own.sort(key=lambda o: (o.row["outcome"] != "collision", o.row["seed"] not in seeds))
        found[WANTED[rate]] = own[0]
    return {what: found[what] for what in WANTED.values() if what in found}


def agent_rates(episodes: Sequence[Shown]) -> list[dict[str, Any]]:
    """SR, FR and VR of each agent, in percent."""
    return [
        {"agent": agent, "episodes": len(ends), "rates": [rates_of(ends)[name] for name in RATES]}
        for agent in _agents(episodes)
        if (ends := [one.row["outcome"] for one in episodes if one.row["agent"] == agent])
    ]


def _agents(episodes: Sequence[Shown]) -> list[str]:
    return list(dict.fromkeys(one.row["agent"] for one in episodes))


def _replay(out: Path, what: str, shown: Shown, clip: Path | None) -> dict[str, Any]:
    """Drive an episode again and write its page."""
    row, path = shown.row, Path("replays") / f"{shown.row['scenario']}-{what}.html"
    done = replayed(shown.folder, str(shown.number), clip)
    save_replay(out / path, [done.page], [done.check])
    return {
        "what": what,
        "file": str(path),
        "agent": row["agent"],
        "seed": row["seed"],
        "badge": badge(done.page["outcome"], done.page["row"].get("fault")),
        "same": done.same,
    }
