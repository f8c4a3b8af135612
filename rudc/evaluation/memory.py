"""Keeps a long-running process from growing."""

from __future__ import annotations

import contextlib
import ctypes

_MMAP_THRESHOLD = -3
"""glibc's M_MMAP_THRESHOLD"""
_LARGE = 65536
"""bytes"""


def return_large_blocks() -> None:
    """Have the C library give large blocks back to the system as soon as they are freed.

    glibc does so at first, but raises the size that counts as large with every block it frees, up to 32 MB.
    Tables of routes that come and go then leave holes behind: 12 MB in 2,000 episodes. Without glibc nothing
    is changed.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE)
