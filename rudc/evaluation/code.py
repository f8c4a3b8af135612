"""Which code this is, by its content."""

from __future__ import annotations

import hashlib
from pathlib import Path

import rudc
from rudc.data import data_folder


def code_digest() -> str:
    """12 hexadecimal digits that change with any Python file of RUDC, and any shipped network; hidden
    files, such as editors keep beside those that they edit, are left out.
    """
    found = hashlib.sha256()
    code = Path(rudc.__file__).resolve().parent
    for folder, pattern in ((code, "**/[!.]*.py"), (data_folder("sumo_networks"), "*/[!.]*.net.xml")):
        for path in filter(Path.is_file, sorted(folder.glob(pattern))):
            found.update(f"{path.relative_to(folder)}".encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()[:12]
