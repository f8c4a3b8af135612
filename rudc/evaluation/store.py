"""A sweep's rows on disk: appended as episodes end, readable at any moment, sorted when all are there.

Only the sweep's own process writes. A row goes out in a single write, so that a kill costs none that was
written; what a full disk leaves of a row is cut off. The file is flushed to the disk with the first row, and
then with the first that comes `FLUSH_S` later: a power cut may cost the rows since, and `--resume` drives
their episodes again. A row never spans lines, so a file is whole up to its last line
break. Rewriting (dropping rows, sorting) goes to a file beside it that then replaces it. A byte order mark,
which spreadsheets put before the first name, is no part of it.
"""

from __future__ import annotations

import codecs
import contextlib
import csv
import errno
import io
import itertools
import math
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rudc.errors import SweepError
from rudc.files import explain, replacing

Cells = list[list[str]]
"""of some rows, a list for each column"""
MENDED = "mend or delete the line"
"""what to do about one that is no row"""
FLUSH_S = 0.2
"""s: flushing takes a hundred times as long as writing a row"""
_BLOCK = 1_000_000
"""bytes, about, that are read at once"""


def one_line(text: str) -> str:
    """A text as it reads back from a row: each line break in it is a blank; what UTF-8 has no sign for (parts
    of file names that are no text) is spelt out, `\\udcff`; all else stays.
    """
    line = " ".join(text.splitlines())
    return line if line.isascii() else line.encode("utf-8", "backslashreplace").decode("utf-8")


def format_row(cells: Sequence[str]) -> str:
    """One line of CSV, its line break included."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(map(one_line, cells))
    return text.getvalue()


class RowFile:
    """A CSV file that grows by whole rows."""

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        self.path = path
        self.header = list(header)
        self._descriptor: int | None = None
        self._flushed_s = -math.inf

    def rows(self) -> Iterator[tuple[str, ...]]:
        """The whole rows of the file, in its order; none if there is no file. A torn last line is left out.

        Raises SweepError when it is the file of another sweep, or damaged.
        """
        return itertools.chain.from_iterable(zip(*block, strict=True) for block in self.blocks())

    def blocks(self) -> Iterator[Cells]:
        """The same by column, some thousands of rows at a time."""
        if not self.path.exists():
            return
        header, blocks = table_blocks(self.path)
        if header and header != self.header:
            raise SweepError(f"{self.path} has other columns than this sweep writes; give another --out")
        yield from blocks

    def rewrite(self, lines: Iterable[str]) -> None:
        """Replace the content by the header and these rows, each as `format_row` has it."""
        self.close()
        with replacing(self.path) as file:
            file.writelines(line.encode() for line in itertools.chain([format_row(self.header)], lines))

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
        now = time.monotonic()
        if now - self._flushed_s > FLUSH_S:
            os.fsync(self._descriptor)
            self._flushed_s = now

    def close(self) -> None:
        """Flush the file to the disk and close it; `append` opens it again."""
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                os.fsync(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = None


def read_header(path: Path) -> list[str]:
    """The names of a CSV file's columns; none if there is no file, or no whole line in it."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        line = file.readline()
    return next(csv.reader([line]), []) if line.endswith("\n") else []


def read_table(path: Path) -> list[dict[str, str]]:
    """The whole rows of a CSV file as dictionaries. Raises SweepError if none, or damaged."""
    header, blocks = table_blocks(path)
    return [dict(zip(header, row, strict=True)) for block in blocks for row in zip(*block, strict=True)]


def table_blocks(path: Path) -> tuple[list[str], Iterator[Cells]]:
    """The names of a CSV file's columns, and the cells of its whole lines, a list for each column, some
    thousands of lines at a time and at least one. What follows the last line break is left out. Raises
    SweepError if there is no file, and, with its number, where a line is no row.
    """
    if not path.is_file():
        folder = path.parent
        if folder.is_file():
            raise SweepError(f"{folder} is a file; give the folder of a sweep, such as {folder.parent}")
        if (folder / "evaluations.csv").is_file():
            raise SweepError(f"{folder} is the folder of a search, not of a sweep; read its failures.csv")
        raise SweepError(f"no {path.name} in {folder}; is it the folder of a sweep?")
    header: list[str] = []
    with path.open("rb") as file:
        first = file.readline()
    if first.endswith(b"\n"):
        (header,) = _rows_one_by_one([first.removeprefix(codecs.BOM_UTF8)], 0, path)
        if len(set(header)) != len(header):
            raise SweepError(f"{path}:1: names a column twice; {MENDED}")
    return header, _blocks(path, len(first), len(header))


def _blocks(path: Path, start: int, width: int) -> Iterator[Cells]:
    """The cells of the whole lines that begin at a byte, `width` in each, as `table_blocks` says."""
    begun, torn = 1, False
    with path.open("rb") as file:
        file.seek(start)
        while not torn and (lines := file.readlines(_BLOCK)):
            if torn := not lines[-1].endswith(b"\n"):  # a sweep may be about to finish the line
                lines.pop()
            if lines:
                yield _plain_cells(lines, width) or _cells(lines, width, begun, path)
            begun += len(lines)


def _plain_cells(lines: Sequence[bytes], width: int) -> Cells:
    """The cells of lines without quotes, which the comma alone divides; nothing for any others."""
    data = b"".join(lines)
    if b'"' in data or b"\r" in data or width < 2 or {line.count(b",") for line in lines} != {width - 1}:
        return []
    try:
        flat = data.decode("utf-8").replace("\n", ",").split(",")
    except UnicodeDecodeError:
        return []
    return [flat[k:-1:width] for k in range(width)]


def _cells(lines: Sequence[bytes], width: int, begun: int, path: Path) -> Cells:
    """The cells of any lines; raises SweepError for the first that is no row, or has others than `width`."""
    try:
        texts = b"".join(lines).decode("utf-8").split("\n")[:-1]
        rows = list(csv.reader(texts, strict=True))
    except (UnicodeDecodeError, csv.Error):
        rows = []
    if len(rows) != len(lines):  # a quote that is not closed in its line takes in the next
        rows = _rows_one_by_one(lines, begun, path)
    for number, row in enumerate(rows, begun + 1):
        if len(row) != width:
            raise SweepError(f"{path}:{number}: has {len(row)} cells, not {width}; {MENDED}")
    return list(map(list, zip(*rows, strict=True)))


def _rows_one_by_one(lines: Sequence[bytes], begun: int, path: Path) -> list[list[str]]:
    """The cells of lines of which some may be no row; it is named by its number, after `begun` others."""
    found = []
    for number, line in enumerate(lines, begun + 1):
        try:
            found.append(next(csv.reader([line[:-1].decode("utf-8")], strict=True), []))
        except UnicodeDecodeError:
            raise SweepError(f"{path}:{number}: not valid UTF-8 text; {MENDED}") from None
        except csv.Error as error:
            raise SweepError(f"{path}:{number}: not a row of a CSV file ({error}); {MENDED}") from None
    return found
