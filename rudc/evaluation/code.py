"""Which code this is, by its content."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import NamedTuple

import rudc
from rudc.data import data_folder

SETTLED_NS = 2_000_000_000
"""ns; what was written longer ago would show by its times that it was written again"""


class _File(NamedTuple):
    """A file, and what changes with what is in it."""

    path: Path
    below: Path
    size: int
    written_ns: int
    changed_ns: int
    number: int


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
        name = file.path.relative_to(file.below)
        found.update(f"{name}".encode() + b"\0" + file.path.read_bytes() + b"\0")
    digest = found.hexdigest()[:12]
    settled = all(max(file.written_ns, file.changed_ns) < now_ns - SETTLED_NS for file in files)
    _known = (files, digest) if settled else None
    return digest


def _files() -> list[_File]:
    code, found = Path(rudc.__file__).resolve().parent, []
    for folder, pattern in ((code, "**/[!.]*.py"), (data_folder("sumo_networks"), "*/[!.]*.net.xml")):
        for path in filter(Path.is_file, sorted(folder.glob(pattern), key=lambda path: path.parts)):
            about = path.stat()
            times = about.st_mtime_ns, about.st_ctime_ns
            found.append(_File(path, folder, about.st_size, *times, about.st_ino))
    return found
