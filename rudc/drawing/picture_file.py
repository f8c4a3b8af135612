"""Pictures and films as files."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from rudc.drawing.frames import Frame
from rudc.errors import InputError, StorageError

FILMS = (".gif", ".mp4")
PAUSE_S = 1.5
"""s for which a film's last frame stays"""
COLOURS = 128
"""of a GIF's palette"""


def save_picture(picture: Image.Image, path: str | Path) -> Path:
    """Write a picture; its file's ending says as what. Raises StorageError."""
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        picture.save(target, optimize=True)
    except (OSError, ValueError) as error:  # no such folder, no permission, unknown kind of image
        raise StorageError(f"cannot write {target}: {error}") from None
    return target


def check_film(path: Path) -> None:
    """Raise InputError if no film can be written to such a file here."""
    if path.suffix.lower() not in FILMS:
        raise InputError(f"a film is a .gif or a .mp4 file, not {path.name!r}")
    if path.suffix.lower() == ".mp4":
        _imageio()


def save_film(frames: Sequence[Frame], path: Path, frames_per_s: float) -> None:
    """Write frames (height, width, 3) as a film. Raises InputError for another kind of file, StorageError."""
    check_film(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix.lower() == ".gif":
            _save_gif(frames, path, frames_per_s)
        else:
            longer = [*frames, *[frames[-1]] * round(PAUSE_S * frames_per_s)]
            _imageio().mimwrite(path, longer, fps=frames_per_s, macro_block_size=8)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from None


def _save_gif(frames: Sequence[Frame], path: Path, frames_per_s: float) -> None:
    few = np.concatenate(frames[:: max(len(frames) // 8, 1)])
    palette = Image.fromarray(few).quantize(COLOURS)
    plain = Image.Dither.NONE
    first, *rest = [Image.fromarray(frame).quantize(palette=palette, dither=plain) for frame in frames]
    durations = [round(1000 / frames_per_s)] * len(rest) + [round(1000 * PAUSE_S)]
    first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, optimize=False)


def _imageio() -> Any:
    try:
        importlib.import_module("imageio_ffmpeg")
        return importlib.import_module("imageio.v2")
    except ImportError:
        raise InputError(
            "an .mp4 needs imageio and ffmpeg (the extra `video`): "
            f"{sys.executable} -m pip install imageio imageio-ffmpeg; a .gif needs nothing"
        ) from None
