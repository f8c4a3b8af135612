"""Python files and modules of other people: what a user names, and what installed packages offer.

A file's folder may be imported from, as when Python runs the file, and so may the working folder for modules.

An installed package offers agents, events, algorithms and barriers by entry points of the groups
`rudc.agents`, `rudc.events`, `rudc.algorithms` and `rudc.barriers`. Those of agents are classes or functions,
each imported when its name is given. The others are modules that register what they have, imported when
somebody asks what there is of their kind:

    [project.entry-points."rudc.agents"]
    careful = "my_package.agents:Careful"

    [project.entry-points."rudc.barriers"]
    mine = "my_package.barriers"
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import os
import pickle
import re
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from functools import lru_cache
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, TypeVar

from rudc.errors import InputError, PartFailedError, RudcError
from rudc.hints import did_you_mean

PREFIX = "rudc_own_"
"""what the names of modules made of files begin with"""
PLUGINS = ("rudc.events", "rudc.algorithms", "rudc.barriers")
"""groups of entry points whose modules are all imported as soon as one of their kind is asked for"""

_PLACE = re.compile(r"(?P<module>[A-Za-z_][\w.]*):[A-Za-z_]\w*")
"""as `found_at` takes it"""

T = TypeVar("T")

_asked: dict[str, None] = {}
_groups: set[str] = set()
_broken: set[str] = set()
"""groups of which something was left out"""
_tell: Callable[[str], None] | None = None
"""is told of what is left out; None where it is refused"""


def import_source(source: str) -> ModuleType:
    """The module of a file (`my_agents.py`) or of a dotted name (`my_package.agents`). Raises InputError."""
    return _file(source) if source.endswith(".py") else _module(source)


def import_first(source: str) -> None:
    """As `import_source`, and remember it: a sweep's workers import it before anything else."""
    import_source(source)
    _asked[str(Path(os.path.expanduser(source)).resolve()) if source.endswith(".py") else source] = None


def imported_first() -> tuple[str, ...]:
    """What `import_first` was asked for, in order."""
    return tuple(_asked)


def sources_digests() -> dict[str, dict[str, str]]:
    """Of each that `import_first` was asked for, by the name of its file, with a number where another has
    the same: see `code_beside`.
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
    """Of each installed package that offers events, algorithms or barriers, by its name: its `version`, and
    digests of the modules that it offers, see `code_beside`. Imports none of them, so that it does not depend
    on what somebody has asked for already.
    """
    found: dict[str, dict[str, str]] = {}
    for group in PLUGINS:
        for entry in entry_points(group=group):
            name, version = (entry.dist.name, entry.dist.version) if entry.dist else ("?", "?")
            path = _place(entry.module)
            code = {entry.module: "not found"} if path is None else code_beside(path, named=True)
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


def code_beside(path: Path, *, named: bool = False) -> dict[str, str]:
    """16 hexadecimal digits of a Python file and of each that it imports from its own folder or, if that is a
    package, from that package; by path. RUDC's own code is left out, and what pip installs.

    What is imported is told from the text: what is only named to `importlib.import_module` is not found.
    `named`: modules of texts such as `"package.module:Class"` count as imported, as an algorithm names them.
    """
    root = home = path.resolve().parent
    while (root / "__init__.py").is_file():
        root, home = root.parent, root
    if root == home and root.name in ("site-packages", "dist-packages"):
        home = path.resolve()
    found: dict[str, str] = {}
    waiting = [path.resolve()]
    while waiting:
        file = waiting.pop()
        if not file.is_file() or not (file == path.resolve() or _belongs(file, root, home)):
            continue
        if (name := file.relative_to(root).as_posix()) in found:
            continue
        text = file.read_bytes()
        found[name] = hashlib.sha256(text).hexdigest()[:16]
        waiting += _imported_by(file, text, root, named)
        waiting += [package / "__init__.py" for package in file.parents if root in package.parents]
    return found


def _belongs(file: Path, root: Path, home: Path) -> bool:
    """Whether a file that is imported lies under `home`, and is not RUDC's own."""
    return file.is_relative_to(home) and file.relative_to(root).parts[0] != "rudc"


def _imported_by(file: Path, text: bytes, root: Path, named: bool) -> Iterator[Path]:
    """The files under `root` that a Python file imports, or if `named` names as `module:Class`."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [(root, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level <= len(file.parents):
            base = file.parents[node.level - 1] if node.level else root
            module = f"{node.module}." if node.module else ""
            names = [(base, module.rstrip("."))] if module else []
            names += [(base, f"{module}{alias.name}") for alias in node.names]
        elif named and isinstance(node, ast.Constant) and (place := _PLACE.fullmatch(str(node.value))):
            names = [(root, place["module"])]
        else:
            continue
        for base, dotted in names:
            parts = dotted.split(".")
            for k in range(1, len(parts) + 1):
                place = base.joinpath(*parts[:k])
                yield from (one for one in (place.with_suffix(".py"), place / "__init__.py") if one.is_file())


def found_at(place: str) -> Any:
    """What a module of ours, or of a package, has under a name: `package.module:Class`."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def load_entry(entry: EntryPoint, error: type[InputError] = InputError) -> Any:
    """What an installed package offers there. Raises `error`."""
    try:
        return entry.load()
    except (Exception, SystemExit) as failed:
        package = entry.dist.name if entry.dist else "?"
        raise error(
            f"the installed package {package}: its entry point `{entry.name} = {entry.value}` of "
            f"{entry.group} cannot be imported: {in_words(failed)}"
        ) from failed


@contextmanager
def leaving_out(tell: Callable[[str], None]) -> Iterator[None]:
    """In the block, what installed packages offer and cannot be imported is left out, and `tell` is told why
    in a line: for lists of what there is. Afterwards it is refused, as before.
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
    """Say that something is left out, and why, in a block of `leaving_out`; anywhere else raise the error."""
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
    """What is registered, by name; before it is first read, what installed packages offer is imported."""

    def __init__(self, group: str) -> None:
        """`group`: of the entry points of modules that register theirs here."""
        self.so_far: dict[str, T] = {}
        """what is registered by now, to be read without importing anything"""
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
    """A value on its way to another process, which first imports what this one was asked to import first.

    What arrives there is the value.
    """

    def __init__(self, value: Any) -> None:
        self.value = value

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """Pickled twice, so that imports come before the value is looked at."""
        return _arrived, (imported_first(), pickle.dumps(self.value))


def _arrived(sources: tuple[str, ...], pickled: bytes) -> Any:
    for source in sources:
        import_first(source)
    return pickle.loads(pickled)


def in_words(error: BaseException) -> str:
    """`ValueError: what it says (file.py:12)`, where it was raised, or what does not parse."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{type(error).__name__}: {error.msg} ({Path(error.filename).name}:{error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def is_own(thing: Any) -> bool:
    """Whether a function, or the class of a thing, is not RUDC's, so that what it answers is looked at."""
    module = getattr(thing, "__module__", None)  # instances of built-in classes have none
    return not (module or "").startswith("rudc.")


def ask_own(who: str, time_s: float | None, method: str, call: Callable[[], T]) -> T:
    """What code of other people answers. Raises PartFailedError, with `who` it is and the time in the episode
    (None: in none), where that raises anything but an error of ours.
    """
    try:
        return call()
    except RudcError:
        raise
    except (Exception, SystemExit) as error:
        raise PartFailedError(f"{_at(who, time_s)}: {method} raised {in_words(error)}") from error


def refused(who: str, time_s: float | None, method: str, told: str, wanted: str) -> PartFailedError:
    """The error for an answer of other people's code: what is `told` of it, and what was `wanted`."""
    return PartFailedError(f"{_at(who, time_s)}: {method} answered {told}; expected {wanted}")


def shortened(answer: Any) -> str:
    """What somebody's code answered, in one line of a message."""
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
    """The file as a module, run once for as long as it stays as it is."""
    _importable(path.parent)
    name = f"rudc_own_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # so that its dataclasses and pickles find it
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise InputError(f"{path} cannot be imported: {in_words(error)}") from error
    return module


def _module(source: str) -> ModuleType:
    _importable(Path.cwd())
    try:
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
