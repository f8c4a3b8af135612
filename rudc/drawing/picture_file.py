"""Pictures and films as files."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from itertools import chain, repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

from rudc.drawing.frames import Frame
from rudc.drawing.palette import SIGNS
from rudc.drawing.reel import Moving
from rudc.errors import InputError
from rudc.files import make_folder_of, replacing, try_place
from rudc.hints import install_command

FILMS = (".gif", ".webp", ".mp4")
PAUSE_S = 1.5
"""s for which a film's last frame stays"""
COLOURS = 128
"""of a GIF's palette"""
QUALITY = 45
"""of a WebP, 0 to 100: text stays sharp"""
_LOOPS: dict[str, Any] = {"save_all": True, "loop": 0}


def save_picture(picture: Image.Image, path: str | Path) -> Path:
    """Write a picture; its file's ending says as what. Raises InputError for an ending that says nothing,
    StorageError.
    """
    target = Path(path)
    kind = check_picture(target)
    make_folder_of(target)
    with replacing(target) as file:
        picture.save(file, format=kind, optimize=True)
    return target


def check_picture(path: Path) -> str:
    """What kind of picture a file's ending says. Raises InputError if none can be written to such a file."""
    known = Image.registered_extensions()
    kind = known.get(path.suffix.lower())
    if kind is None or kind not in Image.SAVE:
        raise InputError(f"cannot write {path}: {path.suffix!r} is no kind of picture; name a .png")
    try_place(path)
    return kind


def check_film(path: Path) -> None:
    """Raise InputError if no film can be written to such a file here."""
    if path.suffix.lower() not in FILMS:
        raise InputError(f"a film is a .gif, .webp or .mp4 file, not {path.name!r}")
    if path.suffix.lower() == ".mp4":
        _imageio()
    try_place(path)


def save_film(frames: Sequence[Frame], path: Path, frames_per_s: float) -> None:
    """Write frames (height, width, 3) as a film. Raises InputError for another kind of file, StorageError."""
    check_film(path)
    make_folder_of(path)
    with replacing(path) as file:
        save = {".gif": _save_gif, ".webp": _save_webp, ".mp4": _save_mp4}[path.suffix.lower()]
        save(frames, file, frames_per_s)


def _save_gif(frames: Sequence[Frame], file: BinaryIO, frames_per_s: float) -> None:
    palette = _palette(frames)
    plain = Image.Dither.NONE
    pictures = (Image.fromarray(frame).quantize(palette=palette, dither=plain) for frame in frames)
    durations = _durations(frames, frames_per_s)
    next(pictures).save(file, "GIF", append_images=pictures, duration=durations, **_LOOPS, optimize=False)


def _palette(frames: Sequence[Frame]) -> Image.Image:
    """A picture whose palette has the colours of SIGNS, and else those of some frames, the last among them:
    the outcome stands on no other.
    """
    few = np.concatenate([*frames[:: max(len(frames) // 8, 1)], frames[-1]])
    found = Image.fromarray(few).quantize(COLOURS - len(SIGNS)).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([*chain.from_iterable(SIGNS), *found])
    return palette


def _save_webp(frames: Sequence[Frame], file: BinaryIO, frames_per_s: float) -> None:
    """Much smaller than a GIF."""
    durations = _durations(frames, frames_per_s)
    Moving(frames).save(file, "WEBP", duration=durations, **_LOOPS, quality=QUALITY, method=4)


def _durations(frames: Sequence[Frame], frames_per_s: float) -> list[int]:
    """ms that each is shown."""
    return [round(1000 / frames_per_s)] * (len(frames) - 1) + [round(1000 * PAUSE_S)]


def _save_mp4(frames: Sequence[Frame], file: BinaryIO, frames_per_s: float) -> None:
    """Write an MP4; ffmpeg can write to a path only, hence the temporary file."""
    longer = chain(frames, repeat(frames[-1], round(PAUSE_S * frames_per_s)))
    with TemporaryDirectory() as scratch:
        film = Path(scratch) / "film.mp4"
        with _imageio().get_writer(film, mode="I", fps=frames_per_s, macro_block_size=8) as writer:
            for frame in longer:
                writer.append_data(frame)
        file.write(film.read_bytes())


def _imageio() -> Any:
    try:
        importlib.import_module("imageio_ffmpeg")
        return importlib.import_module("imageio.v2")
    except ImportError:
        raise InputError(
            "an .mp4 needs imageio and ffmpeg (the extra `video`): "
            f"{install_command('video')}; a .gif needs nothing"
        ) from None
