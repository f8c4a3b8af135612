"""What a Python file that is not RUDC's imports from its own folder.

Such imports find the files of that folder, as when Python runs the file. A module of the same name may be
there already: installed, or loaded from the folder of another file. It is then set aside while the file is
imported, and afterwards the name means that module again. So two versions of one agent can stand side by
side, each with its own helpers. Names of Python's own library always mean that library.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

from rudc.errors import InputError

_PLACE = re.compile(r"(?P<module>[A-Za-z_][\w.]*):[A-Za-z_]\w*")
"""text `package.module:Class`, as an algorithm names a class"""


def code_beside(path: Path, *, named: bool = False) -> dict[str, str]:
    """Path -> first 16 hexadecimal digits of the SHA-256 digest, for a Python file and for each file that it
    imports from its own folder or, if that folder belongs to a package, from that package. RUDC's own code is
    left out, and so are other packages that pip has installed.

    Imports are read from the text of a file; names that are passed to `importlib.import_module` are not
    found. `named`: a string such as `"package.module:Class"`, by which an algorithm names a class, counts as
    an import too.
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
    """Whether an imported file lies under `home` and is not RUDC's own."""
    return file.is_relative_to(home) and file.relative_to(root).parts[0] != "rudc"


def _imported_by(file: Path, text: bytes, root: Path, named: bool = False) -> Iterator[Path]:
    """The files that a Python file imports from under `root`; if `named`, also those that it names in a
    string `module:Class`.
    """
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


@contextmanager
def importing_beside(path: Path) -> Iterator[None]:
    """Within the block, a Python file's imports from its own folder find what lies there. Raises InputError
    if a function of it would import later what means another module by then.
    """
    folder = path.resolve().parent
    files = [] if (folder / "__init__.py").is_file() else [folder / name for name in code_beside(path)]
    imported = ((file, other) for file in files for other in _imported_by(file, file.read_bytes(), folder))
    names = {_top(other, folder) for file, other in imported if other in files and other != file}
    names -= sys.stdlib_module_names
    own = {name: spec for name in sorted(names) if (spec := PathFinder.find_spec(name, [str(folder)]))}
    taken = {name: there for name, spec in own.items() if (there := _there(name)) not in (None, _file(spec))}
    for file in files:
        if late := next((name for name in _imported_late(file, folder) if name in taken), None):
            raise InputError(
                f"{file}: a function imports {late!r}, and would get {taken[late]}, not what lies beside it; "
                "import it at the top of the file, or give it another name"
            )
    aside = _take_out(taken)
    finder = _Finder({name: own[name] for name in taken})
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        _take_out(taken)
        sys.modules.update(aside)


class _Finder:
    """Finds some modules where it is told, before anybody else is asked."""

    def __init__(self, specs: Mapping[str, ModuleSpec]) -> None:
        self._specs = specs

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        return self._specs.get(name)


def _top(file: Path, folder: Path) -> str:
    """The first part of the name by which a file under a folder is imported."""
    return file.relative_to(folder).parts[0].removesuffix(".py")


def _there(name: str) -> Path | None:
    """The file or folder of the module that an import of that name would give now; None without one."""
    try:
        spec = importlib.util.find_spec(name)
    except ValueError:  # a module that was not imported, such as __main__
        return Path(getattr(sys.modules[name], "__file__", None) or "?")
    return None if spec is None else _file(spec)


def _file(spec: ModuleSpec) -> Path:
    folders = spec.submodule_search_locations
    return Path(next(iter(folders)) if folders and not spec.has_location else spec.origin or "?").resolve()


def _take_out(names: Iterable[str]) -> dict[str, ModuleType]:
    """Modules of these names, and those within them, which are loaded no longer."""
    inside = [name for name in sys.modules if name.partition(".")[0] in names]
    return {name: sys.modules.pop(name) for name in inside}


def _imported_late(file: Path, folder: Path) -> Iterator[str]:
    """First parts of the names that functions in a file import."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return
    functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    for node in (inner for function in functions for inner in ast.walk(function)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield _top(file, folder) if node.level else (node.module or "").partition(".")[0]
