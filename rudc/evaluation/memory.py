"""What a long-running process does with freed memory. Without glibc nothing is changed."""

from __future__ import annotations

import contextlib
import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""glibc's M_TRIM_THRESHOLD and M_MMAP_THRESHOLD"""


def return_large_blocks() -> None:
    """Have the C library give blocks of 64 kB and more back to the system as soon as they are freed.

    glibc does so at first, but raises the size that counts as large with every block it frees, up to 32 MB.
    Tables of routes that come and go then leave holes behind: 12 MB in 2,000 episodes.
    """
    _set(_MMAP_THRESHOLD, 2**16)


def keep_freed_blocks() -> None:
    """Have the C library keep what is freed, up to blocks of 32 MB, for the next that asks for as much.

    A gradient update frees and asks for the same few MB a hundred times; each time it gets them anew from the
    system, every page of them has to be cleared first.
    """
    _set(_MMAP_THRESHOLD, 2**25)
    _set(_TRIM_THRESHOLD, 2**30)


def _set(option: int, size: int) -> None:
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).mallopt(option, size)
