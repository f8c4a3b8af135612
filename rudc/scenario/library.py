"""Finding scenario files: shipped ones by name, others by path or pattern."""

from __future__ import annotations

import glob
import os
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from rudc.data import data_folder
from rudc.errors import ScenarioError
from rudc.files import names_beside
from rudc.hints import did_you_mean

SUFFIXES = (".yaml", ".yml")


def shipped_scenarios() -> dict[str, Path]:
    """Name -> file of every scenario that comes with the package, sorted by name; hidden files are left
    out."""
    found = sorted(data_folder("scenarios").glob("[!.]*.yaml"))
    return {path.stem: path for path in found if path.is_file()}


def find_file(source: str | Path) -> Path:
    """The file of a scenario that is given by its shipped name or by a path. Raises ScenarioError."""
    shipped = shipped_scenarios()
    if isinstance(source, str) and source in shipped:
        return shipped[source]
    path = Path(os.path.expanduser(source))
    if os.path.isfile(path):  # unlike Path.is_file, no error for a name that is too long
        return path
    if os.path.isdir(path):
        raise ScenarioError(
            f"{source}: is a folder; a scenario is a file ({path / '*.yaml'} would take all of them)"
        )
    beside = [name for name in names_beside(path) if Path(name).suffix in SUFFIXES]
    if _is_path(source):
        near = did_you_mean(path.name, beside) or did_you_mean(path.stem, list(shipped))
        raise ScenarioError(f"{source}: no such file{near}")
    near = did_you_mean(source, [*shipped, *beside]) or f"; shipped ones: {', '.join(shipped)}"
    raise ScenarioError(f"{source}: no shipped scenario of this name, and no such file{near}")


def text_of(path: Path) -> str:
    """What a file says. Raises ScenarioError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{shown(path)}: not valid UTF-8 text") from None
    except OSError as error:
        raise ScenarioError(f"{shown(path)}: cannot be read: {error.strerror}") from None


def find_files(patterns: Sequence[str]) -> list[Path]:
    """Files of the scenarios that names, paths and globs stand for, each once, in the order given.

    A pattern without a suffix or folder (`*left*`) is one of shipped names. Raises ScenarioError with a line
    for each that fits nothing. A text that is the path of a file is not taken for a pattern.
    """
    found, missing = existing_files(patterns)
    if missing:
        raise ScenarioError("\n".join(missing))
    return found


def existing_files(patterns: Sequence[str]) -> tuple[list[Path], list[str]]:
    """As `find_files`: the files that there are, and a line for each pattern that fits nothing."""
    found: dict[Path, Path] = {}
    missing: list[str] = []
    for pattern in patterns:
        try:
            paths = _meant(pattern)
        except ScenarioError as error:
            missing.append(str(error))
            continue
        if not paths:
            files = "" if _is_path(pattern) else f"{pattern}.yaml"
            hint = f"; {files} would take files" if files and _matching(files) else ""
            missing.append(f"{pattern}: no scenario fits this pattern{hint}")
        for path in paths:
            found.setdefault(path.resolve(), path)
    return list(found.values()), missing


def given_twice(patterns: Sequence[str]) -> list[str]:
    """A line for each file that `find_files` leaves out since it is the same as another, by a link. Raises
    ScenarioError.
    """
    first: dict[Path, Path] = {}
    paths = dict.fromkeys(path for pattern in patterns for path in _meant(pattern))
    pairs = [(path, first.setdefault(path.resolve(), path)) for path in paths]
    return [
        f"{shown(path)} and {shown(other)} are the same file, which counts once"
        for path, other in pairs
        if path.absolute() != other.absolute()
    ]


def overlooked(sources: Sequence[str]) -> list[str]:
    """A line for each name that means a shipped scenario although a file of that name lies here."""
    names = [source for source in dict.fromkeys(sources) if source in shipped_scenarios()]
    found = [(name, f"{name}{suffix}") for name in names for suffix in SUFFIXES]
    return [
        f"{name} is the scenario that comes with RUDC; write ./{file} for the file of that name here"
        for name, file in found
        if os.path.isfile(file)
    ]


def find_parent(name: str, child: Path) -> Path | None:
    """The file that a scenario's `extends` means: a file beside it, or else a shipped one; never itself."""
    beside = [child.parent / name, *(child.parent / f"{name}{suffix}" for suffix in SUFFIXES)]
    shipped = shipped_scenarios().get(name)
    options = [path for path in (*beside, shipped) if path is not None and os.path.isfile(path)]
    return next((path for path in options if path.resolve() != child.resolve()), None)


def parents_known(child: Path) -> list[str]:
    """Names that a scenario's `extends` could have."""
    beside = [
        path.stem for path in sorted(child.parent.glob("*")) if path.suffix in SUFFIXES and path != child
    ]
    return list(dict.fromkeys([*beside, *shipped_scenarios()]))


def shown(path: Path) -> str:
    """A path as a message gives it: relative where it lies in the working folder."""
    try:
        return str(path.absolute().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _is_path(source: str | Path) -> bool:
    return isinstance(source, Path) or "/" in source or "\\" in source or source.endswith(SUFFIXES)


def _meant(pattern: str) -> list[Path]:
    """The files that a name, a path or a glob stands for."""
    several = glob.has_magic(pattern) and not os.path.isfile(os.path.expanduser(pattern))
    return _matching(pattern) if several else [find_file(pattern)]


def _matching(pattern: str) -> list[Path]:
    if not _is_path(pattern):
        return [path for name, path in shipped_scenarios().items() if fnmatchcase(name, pattern)]
    paths = [Path(path) for path in sorted(glob.glob(os.path.expanduser(pattern), recursive=True))]
    return [path for path in paths if path.is_file()]
