"""The frames of a film on their way to its file, in little memory."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import overload

import numpy as np
from PIL import Image

from rudc.drawing.frames import Frame

MOST = 1500
"""frames of a film, an even number: at ten a second two and a half minutes. While a GIF is written, each of
them takes a byte of memory a pixel"""


class Reel(Sequence[Frame]):
    """Frames (height, width, 3) of one size, packed: some 20 kB each instead of 1 MB."""

    def __init__(self) -> None:
        self._packed: list[bytes] = []
        self._shape = (0, 0, 3)

    def append(self, frame: Frame) -> None:
        """Add a frame."""
        self._shape = frame.shape
        self._packed.append(zlib.compress(frame.tobytes(), level=1))

    def thin(self) -> None:
        """Keep every other frame, the first among them."""
        del self._packed[1::2]

    def __len__(self) -> int:
        return len(self._packed)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(len(self))[index]]
        return np.frombuffer(zlib.decompress(self._packed[index]), np.uint8).reshape(self._shape)


class Moving(Image.Image):
    """Frames (height, width, 3) as one picture that Pillow turns from one to the next; as a list of pictures
    they would all be in memory.
    """

    def __init__(self, frames: Sequence[Frame]) -> None:
        super().__init__()
        self._frames = frames
        self.n_frames = len(frames)
        """as Pillow asks for it"""
        self.seek(0)

    def seek(self, frame: int) -> None:
        """Show another frame, by its number from 0."""
        picture = Image.fromarray(self._frames[frame])
        self.im, self._mode, self._size, self._shown = picture.im, picture.mode, picture.size, frame

    def tell(self) -> int:
        """The number of the frame that is shown."""
        return self._shown
