"""Which data files an agent that is not RUDC's reads, and their digests: they decide what it does, as its
source does.

They are those that it opens while it is made and while its modules are imported (rudc/reading.py), and those
that its class names, relative to its own file, for libraries that open files by themselves:

    class Mine:
        reads = ("weights.safetensors",)
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from rudc.beside import code_beside, folders_of
from rudc.errors import AgentError
from rudc.imports import shortened
from rudc.reading import Opened, data_files, read_at_import


class _Read(NamedTuple):
    make: Callable[..., Any]
    """what made the agent"""
    sources: Sequence[Path]
    """the files of its code that say where its data files may lie"""
    files: Mapping[str, Path]
    digests: Mapping[str, str]


_read: dict[str, _Read] = {}
"""name of an agent -> what it read when it was last made in this process"""
read_late: dict[str, str] = {}
"""name of an agent -> why sweeps refuse it: it has opened a data file too late. A module may keep what was
read, so that nobody would see it the next time.
"""


def remember(
    name: str, make: Callable[..., Any], agent: object, opened: Opened, named_in: ModuleType | None = None
) -> None:
    """Remember the data files of an `agent` of that name, which `make` made; `opened`: what that opened;
    `named_in`: the module that `make` was found in. Raises AgentError where the agent's `reads` is wrong, or
    names a file that is not there.
    """
    sources = sources_of(make, type(agent), named_in)
    files = {**_opened_by(sources, opened), **_declared(name, agent)}
    _read[name] = _Read(make, sources, files, _digests(files))


def files_of(name: str, make: Callable[..., Any], again: Callable[[], object]) -> dict[str, str]:
    """Name -> digest of each data file of the agent of that name, which `make` makes. `again` makes it, if
    it was not made in this process yet, or a file has changed since.
    """
    known = _read.get(name)
    if known is None or known.make is not make or _digests(known.files) != known.digests:
        again()
    return dict(_read[name].digests)


def not_remembered(name: str, opened: Opened) -> list[str]:
    """Names of the data files among those that the agent of that name has `opened`, without those that were
    remembered when it was made.
    """
    known = _read[name]
    return sorted(_opened_by(known.sources, opened).keys() - known.files.keys())


def changed_files(name: str, recorded: Mapping[str, str]) -> list[str]:
    """Which data files of the agent of that name, which was made here, are not what was `recorded` elsewhere
    (name -> digest). Files that it did not open here count, too: what another agent has loaded may be kept.
    """
    known = _read[name]
    roots = [folders_of(source)[0] for source in known.sources]
    changed = []
    for file, then in recorded.items():
        places = (
            [known.files[file]] if file in known.files else [*(root / file for root in roots), Path(file)]
        )
        if then not in {_digests({file: place})[file] for place in places}:
            changed.append(file)
    return changed


def sources_of(*things: object) -> list[Path]:
    """The files (resolved) in which classes, functions or modules are written; none of RUDC's or Python's."""
    found: dict[Path, None] = {}
    for thing in things:
        module = getattr(thing, "__module__", None) or getattr(thing, "__name__", "")
        if module.partition(".")[0] not in {"rudc", *sys.stdlib_module_names} - {"__main__"}:
            with contextlib.suppress(TypeError, OSError):  # of C, or typed in
                found[Path(inspect.getfile(thing)).resolve()] = None  # pyright: ignore[reportArgumentType]
    return [path for path in found if path.is_file()]


def digest(file: Path) -> str:
    """First 16 hexadecimal digits of the SHA-256 digest of a file's content."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()[:16]


def _opened_by(sources: Sequence[Path], opened: Opened) -> dict[str, Path]:
    """Name -> data file among those `opened`, and those that `sources` and what they import read as they were
    imported.
    """
    for source in sources:
        root, _ = folders_of(source)
        for module in code_beside(source):
            opened = {**opened, **read_at_import(root / module)}
    return data_files(opened, sources)


def _digests(files: Mapping[str, Path]) -> dict[str, str]:
    found = {}
    for name in sorted(files):
        try:
            found[name] = digest(files[name])
        except OSError as error:
            found[name] = f"cannot be read: {error.strerror}"
    return found


def _declared(name: str, agent: object) -> dict[str, Path]:
    """Name -> file of each that the agent's class (or the agent) names in `reads`."""
    reads: Any = getattr(agent, "reads", ())
    listed = isinstance(reads, Collection) and not isinstance(reads, str)
    if not listed or not all(isinstance(file, str | PathLike) for file in reads):
        raise AgentError(
            f"agent {name}: `reads` names the files that it reads, relative to its own, as in "
            f'reads = ("weights.safetensors",); it is {shortened(reads)}'
        )
    owner = next((kind for kind in type(agent).__mro__ if "reads" in vars(kind)), type(agent))
    folder = next((path.parent for path in sources_of(owner)), Path.cwd())
    found = {str(file): folder / file for file in reads}
    for text, path in found.items():
        if not path.is_file():
            raise AgentError(f"agent {name}: `reads` names {text}, and there is no such file in {folder}")
    return found
