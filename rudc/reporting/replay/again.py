"""An episode of a sweep driven again for its page, and compared with its row."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.evaluation.film import Film
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.recording import Recording
from rudc.evaluation.rerun import Rerun, differences
from rudc.evaluation.rollout import run_until_failure
from rudc.network.network import load_network
from rudc.world.world import World

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.env.episode import StepResult
    from rudc.scenario.model import Scenario
    from rudc.world.scene import Scene

CLIP_PX, CLIP_EVERY = 320, 2
"""width of a clip in pixels; it keeps one in so many frames"""


class Replayed(NamedTuple):
    """An episode of a sweep that was run again."""

    page: dict[str, Any]
    """its recording"""
    check: str
    """what comparing it with its row says"""
    same: bool
    line: str
    """all of that in a line"""


def replayed(folder: Path, found: Rerun, clip: Path | None = None) -> Replayed:
    """Run an episode that was found in a sweep's folder again, and say how it went. `clip`: where a small
    film of it goes. Raises AgentError.
    """
    record, page = recorded(found.task.scenario, found.task.seed, make_agent(found.task.agent), clip)
    other = [str(difference) for difference in differences(found.row, record)]
    check = _check(folder, found.number, other, found.changes)
    return Replayed(page, check, not other, f"{found.task}: {record.outcome or record.error}; {check}")


def recorded(
    scenario: Scenario, seed: int, driver: Agent, clip: Path | None = None
) -> tuple[EpisodeRecord, dict[str, Any]]:
    """An episode driven, and its recording; `clip` as for `replayed`. If a user's own agent fails on the way,
    the recording ends there; raises AgentFailedError if it fails before the first decision.
    """
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        recording = Recording(episode, driver)
        film = Film(episode, driver.name, size=CLIP_PX, every=CLIP_EVERY) if clip else None

        def watch(scene: Scene, decision: Decision, result: StepResult) -> None:
            recording.watch(scene, decision, result)
            if film is not None:
                film.watch(scene, decision, result)

        record, _ = run_until_failure(episode, scenario.plan(seed), driver, watch=watch)
        page = recording.data(record)
    if film is not None and clip is not None:
        film.save(clip)
    return record, page


def _check(folder: Path, number: int, other: Sequence[str], changes: Sequence[str]) -> str:
    row = f"row {number} of {folder.resolve().name}/episodes.csv"
    if not other:
        return f"came out the same as {row}"
    why = f" (what differs here: {'; '.join(changes)})" if changes else ""
    return f"came out differently from {row}: {'; '.join(other)}{why}"
