"""An episode as a film (GIF, WebP, or MP4 with the extra `video`), or in a window as it happens."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rudc.drawing.frames import Renderer
from rudc.drawing.picture_file import save_film
from rudc.drawing.reel import MOST, Reel
from rudc.drawing.view import Driving, view_of

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.drawing.window import Window
    from rudc.env.episode import Episode, StepResult
    from rudc.world.scene import Scene


class Film:
    """Draws each decision of one episode; `watch` is for `run_episode`."""

    def __init__(
        self,
        episode: Episode,
        agent: str = "",
        window: Window | None = None,
        size: int = 600,
        every: int = 1,
    ) -> None:
        """`agent`: the driver's name. `window`: where frames are shown as they come; without, they are kept
        for `save`. `every`: one in so many decisions is drawn, and the last; of a long episode fewer, so
        that no more than `MOST` frames are kept.
        """
        self._episode = episode
        self._agent = agent
        self._renderer = Renderer(episode.world.network, size=size)
        self._window = window
        self._frames = Reel()
        self._every, self._seen = every, 0

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Draw what a decision led to."""
        self._seen += 1
        if len(self._frames) == MOST:
            self._frames.thin()
            self._every *= 2
        if (self._seen - 1) % self._every and not result.outcome:
            return
        view = view_of(self._episode.world, result.outcome)
        frame = self._renderer.frame(view, driving(self._agent, decision))
        if self._window is not None:
            self._window.show(frame)
        else:
            self._frames.append(frame)

    def save(self, path: Path) -> None:
        """Write the film. Raises InputError for another kind of file, StorageError when that fails."""
        save_film(self._frames, path, 1.0 / (self._every * self._episode.world.config.decision_s))


def driving(agent: str, decision: Decision) -> Driving:
    """What a picture shows of an agent's decision."""
    done = decision.corrected
    if done is None:
        return Driving(agent, decision.sigma)
    a, steering = (float(v) for v in done.correction)
    return Driving(agent, decision.sigma, done.status, (a, steering), done.active, done.names)
