"""Python files and modules of other people, imported by what a user names them.

A file's folder may be imported from, as when Python runs the file, and so may the working folder for modules.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import pickle
import sys
import traceback
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from rudc.errors import InputError
from rudc.hints import did_you_mean

PREFIX = "rudc_own_"
"""what the names of modules made of files begin with"""

_asked: dict[str, None] = {}


def import_source(source: str) -> ModuleType:
    """The module of a file (`my_agents.py`) or of a dotted name (`my_package.agents`). Raises InputError."""
    return _file(source) if source.endswith(".py") else _module(source)


def import_first(source: str) -> None:
    """As `import_source`, and remember it: a sweep's workers import it before anything else."""
    import_source(source)
    _asked[str(Path(source).resolve()) if source.endswith(".py") else source] = None


def imported_first() -> tuple[str, ...]:
    """What `import_first` was asked for, in order."""
    return tuple(_asked)


def found_at(place: str) -> Any:
    """What a module of ours, or of a package, has under a name: `package.module:Class`."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


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
    """`ValueError: what it says (file.py:12)`, the place being where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _file(source: str) -> ModuleType:
    path = Path(source).expanduser()
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
