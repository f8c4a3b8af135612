"""What a Python file that is not RUDC's imports from its own folder."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import re
import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from rudc.errors import InputError

_PLACE = re.compile(r"(?P<module>[A-Za-z_][\w.]*):[A-Za-z_]\w*")
"""text `package.module:Class`, as an algorithm names a class"""

INSTALLED = ("site-packages", "dist-packages")
"""names of folders of installed packages"""


def code_beside(path: Path) -> dict[str, str]:
    """Path -> first 16 hexadecimal digits of the SHA-256 digest, for a Python file and for each file that it
    imports from its own folder or, if that folder belongs to a package, from that package. RUDC's own code is
    left out, and so are other packages that pip has installed.

    Imports are read from the text of a file. A name that stands in a call of `import_module` counts as one,
    and so does a string such as `"package.module:Class"`, by which an algorithm names a class. A name that is
    worked out is not found.
    """
    root, home = folders_of(path)
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
        waiting += _imported_by(file, text, root)
        waiting += [package / "__init__.py" for package in file.parents if root in package.parents]
    return found


def folders_of(path: Path) -> tuple[Path, Path]:
    """For a Python file: the folder from which it is imported, and the place whose files belong to it: that
    folder, or its package if it has one, or only the file itself if it lies alone among installed packages.
    """
    root = home = path.resolve().parent
    while (root / "__init__.py").is_file():
        root, home = root.parent, root
    if root == home and root.name in INSTALLED:
        home = path.resolve()
    return root, home


def _belongs(file: Path, root: Path, home: Path) -> bool:
    """Whether an imported file lies under `home` and is not RUDC's own."""
    return file.is_relative_to(home) and file.relative_to(root).parts[0] != "rudc"


def _imported_by(file: Path, text: bytes, root: Path) -> Iterator[Path]:
    """The files that a Python file imports from under `root`, or names in a string `module:Class` or in a
    call of `import_module`.
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
        elif isinstance(node, ast.Constant) and (place := _PLACE.fullmatch(str(node.value))):
            names = [(root, place["module"])]
        elif isinstance(node, ast.Call) and (dotted := _imported_in_call(node)):
            level = len(dotted) - len(dotted.lstrip("."))
            names = [
                (file.parents[level - 1] if 0 < level <= len(file.parents) else root, dotted.lstrip("."))
            ]
        else:
            continue
        for base, dotted in names:
            parts = [part[:200] for part in dotted.split(".")]  # a name of a file can be no longer than 255
            for k in range(1, len(parts) + 1):
                place = base.joinpath(*parts[:k])
                yield from (one for one in (place.with_suffix(".py"), place / "__init__.py") if one.is_file())


def _imported_in_call(call: ast.Call) -> str | None:
    """NAME of a call `import_module("NAME", ...)` or `__import__("NAME")`, with its leading dots, or None."""
    called = getattr(call.func, "attr", None) or getattr(call.func, "id", None)
    named = [keyword.value for keyword in call.keywords if keyword.arg == "name"]
    first = next(iter([*call.args[:1], *named]), None)
    if called not in ("import_module", "__import__") or not isinstance(first, ast.Constant):
        return None
    return first.value if isinstance(first.value, str) else None


def refuse_taken(path: Path) -> None:
    """Raises InputError if an import of what lies beside a Python file would give another module: one that is
    installed, or was loaded from the folder of another file. Names of Python's own library mean that library.
    """
    folder = path.resolve().parent
    waiting, names = [path.resolve()], set[str]()
    looked_at = {*waiting}
    while waiting:
        file = waiting.pop()
        for other in _imported_by(file, file.read_bytes(), folder):
            if other.is_relative_to(folder) and other not in looked_at:
                looked_at.add(other)
                waiting.append(other)
                names.add(other.relative_to(folder).parts[0].removesuffix(".py"))
    for name in sorted(names - sys.stdlib_module_names):
        beside, there = PathFinder.find_spec(name, [str(folder)]), _there(name)
        if beside is not None and there not in (None, _file(beside)):
            raise InputError(
                f"{path}: it imports {name!r} and would get {there}, not {_file(beside)}; give one of them "
                "another name, or make a package of each folder and name PACKAGE.MODULE:CLASS"
            )


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
