"""A sweep's rows on disk: appended as episodes end, readable at any moment, sorted when all are there.

Only the sweep's own process writes. A row goes out in a single write and is flushed to the disk; what a kill
or a full disk leaves of a row is cut off. A row never spans lines, so a file is whole up to its last line
break. Rewriting (dropping rows, sorting) goes to a file beside it that then replaces it.
"""

from __future__ import annotations

import csv
import errno
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from rudc.errors import SweepError
from rudc.files import explain, write_atomically

Rows = list[list[str]]
MENDED = "mend or delete the line"
"""what to do about one that is no row"""


def format_row(cells: Sequence[str]) -> str:
    """One line of CSV, its line break included."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([" ".join(cell.split()) for cell in cells])
    return text.getvalue()


class RowFile:
    """A CSV file that grows by whole rows."""

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        self.path = path
        self.header = list(header)
        self._descriptor: int | None = None

    def read(self) -> Rows:
        """The whole rows of the file, in its order; none if there is no file. A torn last line is left out.

        Raises SweepError when it is the file of another sweep, or damaged.
        """
        if not self.path.exists():
            return []
        lines = whole_lines(self.path)
        if lines and lines[0] != self.header:
            raise SweepError(
                f"{self.path} has other columns than this sweep writes; use another folder, or delete it"
            )
        return lines[1:]

    def rewrite(self, rows: Iterable[Sequence[str]]) -> None:
        """Replace the content by the header and these rows."""
        self.close()
        write_atomically(self.path, format_row(self.header) + "".join(map(format_row, rows)))

    def append(self, row: Sequence[str]) -> None:
        """Add a row; raises StorageError, the file as it was before, when it cannot be written."""
        try:
            if self._descriptor is None:
                self._descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND)
            size = os.fstat(self._descriptor).st_size
            try:
                self._write(format_row(row).encode())
            except OSError:
                os.ftruncate(self._descriptor, size)
                raise
        except OSError as error:
            explain(self.path, error)

    def _write(self, data: bytes) -> None:
        assert self._descriptor is not None
        written = os.write(self._descriptor, data)
        if written < len(data):  # a full disk takes a part and says so at the next write
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Close the file; `append` opens it again."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def read_header(path: Path) -> list[str]:
    """The names of a CSV file's columns; none if there is no file, or no whole line in it."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        line = file.readline()
    return next(csv.reader([line]), []) if line.endswith("\n") else []


def read_table(path: Path) -> list[dict[str, str]]:
    """The whole rows of a CSV file as dictionaries. Raises SweepError if none, or damaged."""
    if not path.is_file():
        raise SweepError(f"no {path.name} in {path.parent}; is it the folder of a sweep?")
    lines = whole_lines(path)
    return [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]


def whole_lines(path: Path) -> Rows:
    """The cells of each whole line of a CSV file, as many in each as in the first: line k is row k + 1 of
    them. What follows the last line break is left out. Raises SweepError, with the line's number, where a
    line is no row.
    """
    data = path.read_bytes()
    found: Rows = []
    for number, line in enumerate(data[: data.rfind(b"\n") + 1].split(b"\n")[:-1], 1):
        try:
            cells = next(csv.reader([line.decode("utf-8")], strict=True), [])
        except UnicodeDecodeError:
            raise SweepError(f"{path}:{number}: not valid UTF-8 text; {MENDED}") from None
        except csv.Error as error:
            raise SweepError(f"{path}:{number}: not a row of a CSV file ({error}); {MENDED}") from None
        if found and len(cells) != len(found[0]):
            raise SweepError(f"{path}:{number}: has {len(cells)} cells, not {len(found[0])}; {MENDED}")
        if not found and len(set(cells)) != len(cells):
            raise SweepError(f"{path}:1: names a column twice; {MENDED}")
        found.append(cells)
    return found
