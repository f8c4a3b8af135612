"""Which code this is, by its content."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import rudc
from rudc.data import data_folder

SETTLED_NS = 2_000_000_000
"""ns; if a file was written longer ago than this, writing it again changes its times"""


class _File(NamedTuple):
    """A file, and what changes with what is in it."""

    folder: str
    names: tuple[str, ...]
    """from there to the file"""
    size: int
    """bytes"""
    written_ns: int
    """ns, when its content was written last"""
    changed_ns: int
    """ns, when anything of it was changed last, its times included"""
    inode: int


_known: tuple[list[_File], str] | None = None
"""the files that were read last, and their digest; None where they had been written just before"""


def code_digest() -> str:
    """12 hexadecimal digits that change with any Python file of RUDC, and any shipped network; hidden
    files, such as editors keep beside those that they edit, are left out. Files are read again only once one
    was written.
    """
    global _known
    files = _files()
    if _known is not None and _known[0] == files:
        return _known[1]
    now_ns, found = time.time_ns(), hashlib.sha256()
    for file in files:
        text = Path(file.folder, *file.names).read_bytes()
        found.update("/".join(file.names).encode() + b"\0" + text + b"\0")
    digest = found.hexdigest()[:12]
    settled = all(max(file.written_ns, file.changed_ns) < now_ns - SETTLED_NS for file in files)
    _known = (files, digest) if settled else None
    return digest


def _files() -> list[_File]:
    code = str(Path(rudc.__file__).resolve().parent)
    networks = str(data_folder("sumo_networks"))
    return [*sorted(_below(code, ".py")), *sorted(_below(networks, ".net.xml", links=True))]


def _below(folder: str, ending: str, names: tuple[str, ...] = (), *, links: bool = False) -> Iterator[_File]:
    """The files below a folder whose names end so, and are not hidden; pathlib takes thrice as long. `links`:
    also those in folders that are links there.
    """
    with os.scandir(os.path.join(folder, *names)) as entries:
        for entry in entries:
            here = (*names, entry.name)
            if entry.is_dir(follow_symlinks=links):
                yield from _below(folder, ending, here)
            elif entry.name.endswith(ending) and not entry.name.startswith(".") and entry.is_file():
                about = entry.stat()
                yield _File(folder, here, about.st_size, about.st_mtime_ns, about.st_ctime_ns, about.st_ino)
