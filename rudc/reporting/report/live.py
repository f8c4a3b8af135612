"""A report that is kept fresh while its folder grows."""

from __future__ import annotations

import time
from pathlib import Path

from rudc.errors import RudcError
from rudc.reporting.report.page import NAME, save_report

EVERY_S = 3.0
"""s between two writings at least"""
SHARE = 0.05
"""share of the time that writing may take: pages of large sweeps are written less often"""


class LivePage:
    """`report.html` in a folder. What goes wrong in writing it stops nobody: `problem` says what it was."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.problem = ""
        self._folder = folder
        self._next_s = 0.0

    def refresh(self) -> None:
        """Write it, if it was not written lately."""
        begun = time.monotonic()
        if begun >= self._next_s:
            self._write(live=True)
            self._next_s = time.monotonic() + max(EVERY_S, (time.monotonic() - begun) / SHARE)

    def finish(self) -> None:
        """Write it for the last time."""
        self._write(live=False)

    def _write(self, *, live: bool) -> None:
        self.problem = ""
        try:
            save_report(self._folder, self.path, live=live)
        except RudcError as error:
            self.problem = str(error)
