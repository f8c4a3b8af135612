"""Imports Python code that is not RUDC's: files and modules that a user names, and what installed packages
offer.

A named file can import from its own folder, as when Python runs it (rudc/beside.py); a named module may lie
in the working folder. What is printed while it is imported goes to stderr: stdout is for results.

An installed package offers agents, events, algorithms and barriers by entry points of the groups
`rudc.agents`, `rudc.events`, `rudc.algorithms` and `rudc.barriers`. An agent's entry point is a class or
function; it is imported when the agent's name is given. The entry points of the other groups are modules that
register their parts; all modules of a group are imported when the parts of that kind are first looked up:

    [project.entry-points."rudc.agents"]
    careful = "my_package.agents:Careful"

    [project.entry-points."rudc.barriers"]
    mine = "my_package.barriers"
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import os
import pickle
import re
import shlex
import sys
from collections import Counter
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from functools import lru_cache
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, TypeVar

from rudc.beside import code_beside, folders_of, refuse_taken
from rudc.errors import InputError, PartFailedError, RudcError
from rudc.hints import did_you_mean
from rudc.reading import watched
from rudc.tracebacks import place_of

PREFIX = "rudc_own_"
"""beginning of the names of modules that are made from files"""
PLUGINS = ("rudc.events", "rudc.algorithms", "rudc.barriers")
"""groups of entry points whose modules are all imported when the parts of their kind are first looked up"""

T = TypeVar("T")

_asked: dict[str, None] = {}
_groups: set[str] = set()
_broken: set[str] = set()
"""groups of which an entry point was left out"""
_tell: Callable[[str], None] | None = None
"""gets a line for each entry point that is left out; None: one that cannot be imported raises an error"""


def import_source(source: str) -> ModuleType:
    """The module of a file (`my_agents.py`) or of a dotted name (`my_package.agents`). Raises InputError."""
    return _file(source) if source.endswith(".py") else _module(source)


def import_first(source: str) -> None:
    """As `import_source`; also remembers the source, which a sweep's workers import before anything else."""
    import_source(source)
    _asked[str(Path(os.path.expanduser(source)).resolve()) if source.endswith(".py") else source] = None


def own_file(part: Any) -> str | None:
    """The file of a class or function, if that file was given by its path (`--agent FILE.py:Class`)."""
    module = getattr(part, "__module__", None) or ""
    return str(sys.modules[module].__file__) if module.startswith(PREFIX) else None


def import_first_elsewhere(part: type) -> None:
    """If a class is of a file that was named by its path, have other processes import that file first, as if
    `import_first` had been asked for it here.
    """
    if file := own_file(part):
        _asked[file] = None


def imported_first() -> tuple[str, ...]:
    """What `import_first` was asked for, in order."""
    return tuple(_asked)


def rudc_command(*arguments: str) -> str:
    """A command for a shell, which knows what this one does: `rudc`, all that was given by `--import`, and
    these arguments.
    """
    imports = [part for first in imported_first() for part in ("--import", first)]
    return shlex.join(["rudc", *imports, *arguments])


def sources_digests() -> dict[str, dict[str, str]]:
    """File or module name -> digests of its code (`code_beside`), for each source that `import_first` was
    asked for. Where several have the same name, the later ones get a number behind it.
    """
    found: dict[str, dict[str, str]] = {}
    alike: Counter[str] = Counter()
    for source in _asked:
        path = Path(getattr(import_source(source), "__file__", None) or source)
        name = path.name if source.endswith(".py") else source
        alike[name] += 1
        found[name if alike[name] == 1 else f"{name} ({alike[name]})"] = code_beside(path)
    return found


def plugins() -> dict[str, dict[str, str]]:
    """Name of each installed package that offers events, algorithms or barriers -> its `version`, and digests
    of the modules that it offers (`code_beside`). Imports none of them, so the result does not depend on what
    was imported before.
    """
    found: dict[str, dict[str, str]] = {}
    offered = entry_points()  # of all groups: each look takes milliseconds
    for group in PLUGINS:
        for entry in offered.select(group=group):
            name, version = (entry.dist.name, entry.dist.version) if entry.dist else ("?", "?")
            path = _place(entry.module)
            code = {entry.module: "not found"} if path is None else code_beside(path)
            found.setdefault(name, {"version": version}).update(code)
    return {name: dict(sorted(found[name].items())) for name in sorted(found)}


def _place(module: str) -> Path | None:
    """The file of a module, found without importing it; None where there is none."""
    parts = module.split(".")
    try:
        spec = importlib.util.find_spec(parts[0])
        for k in range(2, len(parts) + 1):
            inside = None if spec is None else spec.submodule_search_locations
            spec = None if inside is None else PathFinder.find_spec(".".join(parts[:k]), inside)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None


def found_at(place: str, what: str = "") -> Any:
    """The object at a place `package.module:Class`, in RUDC or in a package; its module is imported. Raises
    InputError if a place that is not RUDC's is not there; messages call it `what`, or else by its place.
    """
    module, _, name = place.partition(":")
    what = what or place
    if not (module and name):
        raise InputError(f"{what}: {place!r} is no place `module:Class`")
    try:
        with contextlib.redirect_stdout(sys.stderr):
            loaded = importlib.import_module(module)
    except (Exception, SystemExit) as error:
        if module.startswith("rudc."):
            raise
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise InputError(f"{what}: there is no module {error.name!r}") from None
        raise InputError(f"{what}: {module} cannot be imported: {in_words(error)}") from error
    if not hasattr(loaded, name):
        raise InputError(f"{what}: the module {module} has no {name!r}{did_you_mean(name, vars(loaded))}")
    return getattr(loaded, name)


def load_entry(entry: EntryPoint, error: type[InputError] = InputError) -> Any:
    """The object that an installed package's entry point names. Raises `error` if the import fails."""
    try:
        with contextlib.redirect_stdout(sys.stderr), watched():
            return entry.load()
    except (Exception, SystemExit) as failed:
        package = entry.dist.name if entry.dist else "?"
        raise error(
            f"the installed package {package}: its entry point `{entry.name} = {entry.value}` of "
            f"{entry.group} cannot be imported: {in_words(failed)}"
        ) from failed


@contextmanager
def leaving_out(tell: Callable[[str], None]) -> Iterator[None]:
    """Within the block, an entry point of an installed package that cannot be imported is left out, and
    `tell` gets a line that says why. This is for listings. After the block it raises an error again.
    """
    global _tell
    before, _tell = _tell, tell
    try:
        yield
    finally:
        _tell = before
        _groups.difference_update(_broken)
        _broken.clear()


def leave_out(error: InputError) -> None:
    """In a block of `leaving_out`, tell that something is left out, and why; elsewhere raise the error."""
    if _tell is None:
        raise error
    _tell(" ".join(str(error).split()))


def import_offered(group: str) -> None:
    """Import, once, all that installed packages offer in a group of entry points. Raises InputError."""
    if group in _groups:
        return
    _groups.add(group)  # before, as what is imported may ask for the same
    try:
        for entry in entry_points(group=group):
            try:
                load_entry(entry)
            except InputError as error:
                leave_out(error)
                _broken.add(group)
    except BaseException:
        _groups.remove(group)
        raise


class Registry(MutableMapping[str, T], Generic[T]):
    """Registered parts by name. Before they are first read, what installed packages offer is imported."""

    def __init__(self, group: str) -> None:
        """`group`: group of the entry points whose modules register their parts here."""
        self.so_far: dict[str, T] = {}
        """what is registered so far; reading it imports nothing"""
        self._group = group

    def _all(self) -> dict[str, T]:
        import_offered(self._group)
        return self.so_far

    def __getitem__(self, name: str) -> T:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def __setitem__(self, name: str, value: T) -> None:
        self.so_far[name] = value

    def __delitem__(self, name: str) -> None:
        del self.so_far[name]


class Carried:
    """A value to be sent to another process, which first imports what `import_first` was asked for here.

    The other process receives the value itself, not a `Carried`.
    """

    def __init__(self, value: Any) -> None:
        self.value = value

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """The value is pickled inside the pickle, so that the imports are done before it is unpickled."""
        return _arrived, (imported_first(), pickle.dumps(self.value))


def _arrived(sources: tuple[str, ...], pickled: bytes) -> Any:
    for source in sources:
        import_first(source)
    return pickle.loads(pickled)


def in_words(error: BaseException) -> str:
    """`ValueError: its message (file.py:12)`, with its place (`place_of`) or, for a SyntaxError, the line
    that does not parse.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}:{error.lineno})"
    place = place_of(error)
    return f"{type(error).__name__}: {error}{f' ({place})' if place else ''}"


def is_own(thing: Any) -> bool:
    """Whether a function, or the class of a thing, is not RUDC's, so that its answers must be checked."""
    module = getattr(thing, "__module__", None)  # instances of built-in classes have none
    return not (module or "").startswith("rudc.")


def ask_own(who: str, time_s: float | None, method: str, call: Callable[[], T]) -> T:
    """The answer of code that is not RUDC's. If that raises anything but a RudcError, raises PartFailedError,
    which names the part (`who`), the time in the episode (None: outside episodes) and the `method`.
    """
    try:
        return call()
    except RudcError:
        raise
    except (Exception, SystemExit) as error:
        raise PartFailedError(f"{_at(who, time_s)}: {method} raised {in_words(error)}") from error


def refused(who: str, time_s: float | None, method: str, told: str, wanted: str) -> PartFailedError:
    """The error for a wrong answer of code that is not RUDC's; `told` describes the answer, `wanted` what was
    expected.
    """
    return PartFailedError(f"{_at(who, time_s)}: {method} answered {told}; expected {wanted}")


def shortened(answer: Any) -> str:
    """An answer as text for a message: one line of at most 80 characters."""
    text = " ".join(repr(answer).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def _at(who: str, time_s: float | None) -> str:
    return who if time_s is None else f"{who} at {time_s:.1f} s"


def _file(source: str) -> ModuleType:
    path = Path(os.path.expanduser(source))
    if not path.is_file():
        beside = [other.name for other in path.parent.glob("*.py")]
        raise InputError(f"{source}: there is no such file{did_you_mean(path.name, beside)}")
    path = path.resolve()
    return _load(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _load(path: Path, _modified: int) -> ModuleType:
    """The file as a module; it runs again only after the file has changed."""
    _importable(path.parent)
    stem = re.sub(r"\W", "_", path.stem)  # a dot would make it a part of a package
    name = f"{PREFIX}{stem}_{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    refuse_taken(path)
    sys.modules[name] = module  # so that its dataclasses and pickles find it
    try:
        with contextlib.redirect_stdout(sys.stderr), watched():
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise InputError(f"{path} cannot be imported: {in_words(error)}{_by_module(path, error)}") from error
    return module


def _by_module(path: Path, error: BaseException) -> str:
    """What to do where a file's relative import failed; empty for other errors."""
    if not isinstance(error, ImportError) or "attempted relative import" not in str(error):
        return ""
    root, home = folders_of(path)
    if root == home:
        return "; without an __init__.py beside it the file is in no package: import without the dots"
    module = ".".join(path.relative_to(root).with_suffix("").parts)
    return f"; the file is part of a package: name it as {module} (an agent: {module}:Class), in {root}"


def _module(source: str) -> ModuleType:
    _importable(Path.cwd())
    try:
        with contextlib.redirect_stdout(sys.stderr), watched():
            return importlib.import_module(source)
    except ModuleNotFoundError as error:
        if error.name and (source == error.name or source.startswith(f"{error.name}.")):
            raise InputError(
                f"there is no module {error.name!r}; a file is given by its path, with .py at its end"
            ) from None
        raise InputError(f"{source} cannot be imported: {in_words(error)}") from error
    except (Exception, SystemExit) as error:
        raise InputError(f"{source} cannot be imported: {in_words(error)}") from error


def _importable(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
