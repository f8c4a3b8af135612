"""Which files code that is not RUDC's opens for reading, and which of them count: its data files.

An audit hook sees what Python opens, by `open`, `torch.load`, `numpy.load` and the like. It does not see what
native code opens by itself (safetensors, h5py). What a module reads while it is imported is kept by module,
since it is read once, whoever imports the module first.

Of what code of a file opens, a file counts that lies in the folder of that file or below it (if the folder
belongs to a package: in that package), or that is named relative to the working folder. Python sources and
libraries, what lies in hidden folders, `__pycache__` and installed packages, and what is written meanwhile do
not count.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePath
from types import FrameType
from typing import Any

from rudc.beside import INSTALLED, folders_of

CODE = (".py", ".pyc", ".pyi", ".so", ".pyd", ".dll", ".dylib")
"""ends of the names of files that are code"""
APART = ("__pycache__", *INSTALLED)
"""folders whose files do not count"""
_WRITES = os.O_WRONLY | os.O_RDWR

_at_import: dict[str, dict[str, str]] = {}
"""module's file -> what it opened while it was imported, as `Opened`"""
_watching: list[_Watch] = []
_hooked = False

Opened = dict[str, str]
"""absolute path -> path by which it was opened"""


@contextmanager
def watched() -> Iterator[Opened]:
    """Yields a mapping, which holds after the block what its code opened for reading and not for writing;
    what modules opened while they were imported goes to `read_at_import` instead.
    """
    global _hooked
    if not _hooked:
        _hooked = True
        sys.addaudithook(_hook)
    watch = _Watch(sys._getframe(2), threading.get_ident())  # past this generator and its context manager
    _watching.append(watch)
    try:
        yield watch.opened
    finally:
        _watching.remove(watch)
        for path in watch.written:
            watch.opened.pop(path, None)
        for module, opened in watch.by_module.items():
            kept = {path: name for path, name in opened.items() if path not in watch.written}
            _at_import.setdefault(module, {}).update(kept)


def read_at_import(module: Path) -> Opened:
    """What a module's file (resolved) opened while it was imported in a block of `watched`."""
    return dict(_at_import.get(str(module), {}))


def data_files(opened: Mapping[str, str], sources: Iterable[Path]) -> dict[str, Path]:
    """Name -> file, for each file that counts of what code of the files `sources` opened. Its name is its
    path from the folder of the source, or from that of its package; else the path by which it was opened.
    """
    folders = [folders_of(source) for source in sources]
    found: dict[str, Path] = {}
    for path, name in opened.items():
        for place in (Path(path), Path(os.path.realpath(path))):
            inside = [root for root, home in folders if place.is_relative_to(home)]
            if inside:
                name = place.relative_to(inside[0]).as_posix()
                break
        if (inside or not os.path.isabs(name)) and _is_data(PurePath(name)) and os.path.isfile(path):
            found[name] = Path(path)
    return found


def _is_data(name: PurePath) -> bool:
    hidden = any(part[0] == "." and part != ".." for part in name.parts[:-1])
    return name.suffix not in CODE and not hidden and not set(APART) & set(name.parts)


class _Watch:
    def __init__(self, frame: FrameType, thread: int) -> None:
        self.frame, self.thread = frame, thread
        self.opened: Opened = {}
        self.by_module: dict[str, Opened] = {}
        self.written: set[str] = set()


def _hook(event: str, args: tuple[Any, ...]) -> None:
    if not _watching or event != "open":
        return
    path, _, flags = args
    if not isinstance(path, (str, bytes, os.PathLike)) or not isinstance(flags, int):
        return
    name = os.fsdecode(path)
    if name.endswith(CODE):
        return
    try:
        thread, place = threading.get_ident(), os.path.abspath(name)
    except OSError:  # the working folder is gone; what is raised here would be raised by `open`
        return
    for watch in [watch for watch in _watching if watch.thread == thread]:
        if flags & _WRITES:
            watch.written.add(place)
            continue
        module = _importing(watch.frame)
        opened = watch.opened if module is None else watch.by_module.setdefault(module, {})
        opened.setdefault(place, os.path.normpath(name))


def _importing(outer: FrameType) -> str | None:
    """The file of the module that is being imported; None if none is, within the frame `outer`."""
    frame = sys._getframe(2)
    while frame is not None and frame is not outer:
        if frame.f_code.co_name == "<module>":
            return os.path.realpath(frame.f_code.co_filename)
        frame = frame.f_back
    return None
