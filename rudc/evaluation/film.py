"""An episode as a film (GIF, or MP4 with the extra `video`), or in a window as it happens."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.env.rendering import Frame, Renderer
from rudc.errors import InputError
from rudc.files import explain

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.env.episode import Episode, StepResult
    from rudc.env.window import Window
    from rudc.world.scene import Scene

SUFFIXES = (".gif", ".mp4")
PAUSE_S = 1.5
"""s for which the last frame stays"""


def check_film(path: Path) -> None:
    """Raise InputError if no film can be written to such a file here."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"a film is a .gif or a .mp4 file, not {path.name!r}")
    if path.suffix.lower() == ".mp4":
        _imageio()


class Film:
    """Draws each decision of one episode; `watch` is for `run_episode`."""

    def __init__(self, episode: Episode, window: Window | None = None, size: int = 600) -> None:
        """`window`: where frames are shown as they come; without, they are kept for `save`."""
        self._episode = episode
        self._renderer = Renderer(episode.world.network, size=size)
        self._window = window
        self._frames: list[Frame] = []
        self._rate = 1.0 / episode.world.config.decision_s

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Draw what a decision led to."""
        frame = self._renderer.frame(
            self._episode.truth,
            active=decision.corrected.active if decision.corrected else (),
            seen=set(result.scene.ids),
            outcome=str(result.outcome) if result.outcome else None,
        )
        if self._window is not None:
            self._window.show(frame)
        else:
            self._frames.append(frame)

    def save(self, path: Path) -> None:
        """Write the film. Raises InputError for another kind of file, StorageError when that fails."""
        check_film(path)
        frames = self._frames + self._frames[-1:] * round(PAUSE_S * self._rate)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix.lower() == ".gif":
                self._save_gif(path)
            else:
                _imageio().mimwrite(path, frames, fps=self._rate, macro_block_size=8)
        except OSError as error:
            explain(path, error)

    def _save_gif(self, path: Path) -> None:
        from PIL import Image

        few = np.concatenate(self._frames[:: max(len(self._frames) // 8, 1)])
        palette = Image.fromarray(few).quantize(128)
        plain = Image.Dither.NONE
        first, *rest = [Image.fromarray(f).quantize(palette=palette, dither=plain) for f in self._frames]
        step = round(1000 / self._rate)
        durations = [step] * len(rest) + [round(1000 * PAUSE_S)]
        first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, optimize=False)


def _imageio() -> Any:
    try:
        importlib.import_module("imageio_ffmpeg")
        return importlib.import_module("imageio.v2")
    except ImportError:
        raise InputError(
            "an .mp4 needs the extra `video`: pip install 'rudc[video]'; a .gif needs nothing"
        ) from None
