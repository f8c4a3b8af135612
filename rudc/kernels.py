"""Kernels: functions of plain numbers and arrays that numba compiles to machine code; kernels of rectangles.

On arrays of ten numbers, numpy spends most of its time on the call itself, and each decision would make many
such calls. A kernel does the same work in loops, in one call. Kernels are in modules whose names end in
`kernels.py`. The first call of any kernel imports numba, and compiles (half a minute if this machine has no
kernels yet) or loads (most of a second) each kernel that another module of RUDC has imported. A kernel that
only kernels call is part of their machine code, and is not loaded by itself. So a command that never drives
waits for nothing. Within `as_written`, kernels run uncompiled, which is faster for a few calls.

Compiled code is kept in the folder NUMBA_CACHE_DIR or, if that is not set, beside this module; if neither can
be written to, in the user's cache folder or a temporary one. The folder's name is a digest of the source of
all kernels, since a kernel may call one of another module, and of the modules that they import, since a
kernel holds the constants that it uses. When a new folder is made beside this module, folders of other
versions of the source are removed if nobody has used them for a day. There is no fast-math and no parallel
loop, so the numbers are the same with any number of workers.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
import shutil
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache, update_wrapper
from pathlib import Path
from types import CodeType
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from rudc.arrays import Array, Complex, Flags, Floats, Index
from rudc.files import user_cache

Result = TypeVar("Result")
UNUSED_S = 86_400.0
"""s after which kernels of another version of the source, which no process has begun to use since, may go"""


class Layout(NamedTuple):
    """Layout of an array in numba's terms; a number has 0 dimensions."""

    dtype: str
    dimensions: int = 0
    order: str = "C"
    readonly: bool = False


def _read(dtype: str, dimensions: int) -> Layout:
    return Layout(dtype, dimensions, "A", readonly=True)


Vector = Annotated[Array, _read("float64", 1)]
"""(n,), only read, with any strides; so are the next six"""
Table = Annotated[Array, _read("float64", 2)]
Cube = Annotated[Array, _read("float64", 3)]
Places = Annotated[Complex, _read("complex128", 1)]
PlaceTable = Annotated[Complex, _read("complex128", 2)]
Rows = Annotated[Index, _read("int64", 1)]
Marks = Annotated[Flags, _read("boolean", 1)]
NewVector = Annotated[Array, Layout("float64", 1)]
"""(n,), made by a kernel or written to; so are the others below"""
NewTable = Annotated[Array, Layout("float64", 2)]
WrittenTable = Annotated[Array, Layout("float64", 2, "A")]
"""a table that is written to, with any strides"""
NewCube = Annotated[Array, Layout("float64", 3)]
NewColumns = Annotated[Array, Layout("float64", 2, "F")]
"""a table that is stored column by column"""
NewPlaces = Annotated[Complex, Layout("complex128", 1)]
NewPlaceTable = Annotated[Complex, Layout("complex128", 2)]
NewRows = Annotated[Index, Layout("int64", 1)]
NewRowTable = Annotated[Index, Layout("int64", 2)]
NewFlags = Annotated[Flags, Layout("boolean", 1)]
NewSingle = Annotated[Floats, Layout("float32", 1)]
"""(n,), single precision"""

_PLAIN = {float: "float64", int: "int64", bool: "boolean", complex: "complex128"}


def _type_of(hint: Any) -> Any:
    from numba import types

    if get_origin(hint) is tuple:
        return types.Tuple([_type_of(part) for part in get_args(hint)])
    layout: Layout = Layout(_PLAIN[hint]) if hint in _PLAIN else get_args(hint)[1]
    number = getattr(types, layout.dtype)
    if layout.dimensions == 0:
        return number
    return types.Array(number, layout.dimensions, layout.order, readonly=layout.readonly)


class _StandIn:
    """Takes a kernel's place until kernels are loaded. Code that still holds it then calls the kernel through
    it.
    """

    def __init__(self, written: Callable[..., Any]) -> None:
        update_wrapper(self, written)
        self.written = written
        self.compiled: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        if self.compiled is None:
            if _uncompiled:
                return self.written(*arguments)
            load_kernels(self)
        assert self.compiled is not None
        return self.compiled(*arguments)


Place = tuple[dict[str, Any], str]
"""a module's namespace, and a name in it"""
_loading = threading.RLock()
"""held by the thread that loads kernels"""
_waiting: list[_StandIn] = []
"""kernels that are defined but not yet compiled, callees first"""
_uncompiled = False


def kernel(function: Callable[..., Result]) -> Callable[..., Result]:
    """Make a function a kernel for its annotated types. Division by 0 gives inf or nan, as in numpy."""
    _waiting.append(_StandIn(function))
    return _waiting[-1]


def load_kernels(
    called: Callable[..., Any] | None = None, *, everything: bool = False, last_first: bool = False
) -> None:
    """Compile or load kernels, and put them in the places of their stand-ins. Which: `called`, and those that
    RUDC's modules have imported so far; with `everything`, all that are defined. The order is that in which
    they were defined or, with `last_first`, the reverse. After an interruption, the next call goes on with
    the rest.
    """
    with _loading:
        ours = {name: vars(module) for name, module in [*sys.modules.items()] if name.split(".")[0] == "rudc"}
        spaces = {id(space): space for space in (*ours.values(), *(k.written.__globals__ for k in _waiting))}
        callers = {id(space) for name, space in ours.items() if not name.endswith("kernels")}
        places, imported = dict[int, list[Place]](), set[int]()
        for key, space in spaces.items():
            for name, value in space.items():
                if isinstance(value, _StandIn):
                    places.setdefault(id(value), []).append((space, name))
                    imported |= {id(value)} if key in callers else set()
        wanted = [k for k in _waiting if everything or k is called or id(k) in imported]
        for stand_in in reversed(wanted) if last_first else wanted:
            _load(stand_in, places)


def _load(stand_in: _StandIn, places: Mapping[int, list[Place]]) -> None:
    """Load one kernel, and put it in its `places`, which are those of all stand-ins by id."""
    if stand_in.compiled is not None:
        return
    from numba.core.errors import TypingError

    try:
        compiled = _compiled(stand_in.written)
    except TypingError:  # it was never compiled here, and kernels that it calls are not loaded
        used = map(stand_in.written.__globals__.get, _names(stand_in.written.__code__))
        callees = [value for value in used if isinstance(value, _StandIn)]
        if not callees:
            raise
        for callee in callees:
            _load(callee, places)
        compiled = _compiled(stand_in.written)
    stand_in.compiled = compiled
    _waiting.remove(stand_in)
    for space, name in places.get(id(stand_in), ()):
        space[name] = compiled


def _names(code: CodeType) -> set[str]:
    """Names of what a function uses of its module."""
    inner = [part for part in code.co_consts if isinstance(part, CodeType)]
    return {*code.co_names}.union(*map(_names, inner))


@contextlib.contextmanager
def as_written() -> Iterator[None]:
    """Within the block, kernels that are not loaded run as plain Python, which is faster for a few calls.

    The last bits of results may differ, so nothing whose numbers are kept may run in it.
    """
    global _uncompiled
    before, _uncompiled = _uncompiled, True
    try:
        yield
    finally:
        _uncompiled = before


def _compiled(function: Callable[..., Result]) -> Callable[..., Result]:
    import numba

    hints = get_type_hints(function, include_extras=True)
    result = _type_of(hints.pop("return"))
    signature = result(*[_type_of(hint) for hint in hints.values()])
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _folder()  # type: ignore[attr-defined]
    try:
        with _alone(function):
            return numba.njit(signature, cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


@contextlib.contextmanager
def _alone(function: Callable[..., Any]) -> Iterator[None]:
    """Within the block no other process compiles this kernel. If two need it at once, one compiles it and the
    other loads it.
    """
    with contextlib.ExitStack() as held:
        with contextlib.suppress(ImportError, OSError):  # no such locks on Windows
            import fcntl

            file = held.enter_context(open(Path(_folder()) / "lock", "a", encoding="utf-8"))
            place = zlib.crc32(f"{function.__module__}.{function.__qualname__}".encode())
            fcntl.lockf(file, fcntl.LOCK_EX, 1, place)  # a byte of the file, also beyond its end
        yield


@cache
def _folder() -> str:
    """Folder of the kernels that were compiled from the present source."""
    package = Path(__file__).parent
    temporary = Path(tempfile.gettempdir()) / f"rudc-{os.getuid() if hasattr(os, 'getuid') else ''}"
    places = (os.environ.get("NUMBA_CACHE_DIR"), package / "__pycache__", user_cache(), temporary)
    name = f"kernels-{_source_digest(package)}"
    for place in filter(None, places):
        folder = Path(place).absolute() / name
        try:
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK | os.X_OK) and (place != temporary or _is_mine(temporary)):
            with contextlib.suppress(OSError):
                (folder / "lock").touch()  # says when it was last used
            if is_new and place == package / "__pycache__":  # elsewhere, other copies of RUDC have theirs
                _remove_unused(folder)
            return str(folder)
    return tempfile.mkdtemp(prefix="rudc-kernels-")


def _source_digest(package: Path) -> str:
    """12 hexadecimal digits that change with any module of kernels, and any of RUDC's that these import."""
    modules = [*filter(Path.is_file, package.rglob("*kernels.py"))]  # no locks of editors
    for module in [*modules]:
        for name in re.findall(r"^from rudc\.([\w.]+) import", module.read_text("utf-8"), re.MULTILINE):
            modules.append(package.joinpath(*name.split(".")).with_suffix(".py"))
    digest = hashlib.sha256()
    for module in sorted({*filter(Path.is_file, modules)}):
        digest.update(module.read_bytes())
    return digest.hexdigest()[:12]


def _is_mine(place: Path) -> bool:
    """Whether nobody else has made a folder in this user's name: the code in it is run."""
    return not hasattr(os, "getuid") or place.stat().st_uid == os.getuid()


def _remove_unused(folder: Path) -> None:
    """Remove the folders beside it that no process has begun to use for UNUSED_S. One that still needs its
    folder then compiles anew.
    """
    for other in folder.parent.glob("kernels-*"):
        if other == folder or not re.fullmatch(r"kernels-[0-9a-f]{12}", other.name):
            continue
        with contextlib.suppress(OSError):
            lock = other / "lock"
            if time.time() - (lock if lock.exists() else other).stat().st_mtime > UNUSED_S:
                shutil.rmtree(other)


@kernel
def half_turn(angle: float) -> float:
    """rad, the same angle within [-pi, pi]."""
    return angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi))


@kernel
def separation(
    r: complex,
    facing: complex,
    other: complex,
    length: float,
    width: float,
    its_length: float,
    its_width: float,
) -> float:
    """m, largest separation of two rectangles along their side directions (see rudc/geometry.py).

    `r`: m, from the first one's centre to the second one's; `facing`, `other`: direction of the first and of
    the second; `length`, `width`, `its_length`, `its_width`: their half sizes, m.
    """
    z, turn, back = r * facing.conjugate(), other * facing.conjugate(), r * other.conjugate()
    cos, sin = abs(turn.real), abs(turn.imag)
    ahead = abs(z.real) - (length + its_length * cos + its_width * sin)
    beside = abs(z.imag) - (width + its_length * sin + its_width * cos)
    ahead_back = abs(back.real) - (its_length + length * cos + width * sin)
    beside_back = abs(back.imag) - (its_width + length * sin + width * cos)
    return max(max(ahead, beside), max(ahead_back, beside_back))


@kernel
def _corners_away(
    z: complex, turn: complex, length: float, width: float, box_length: float, box_width: float
) -> float:
    """m2, least squared distance from a corner of a rectangle at z m, turned by `turn`, to a box about the
    origin; all lengths and widths are half sizes, m.
    """
    least = 1e300
    for along in (length, -length):
        for across in (width, -width):
            corner = z + turn * complex(along, across)
            ahead, beside = max(abs(corner.real) - box_length, 0.0), max(abs(corner.imag) - box_width, 0.0)
            least = min(least, ahead * ahead + beside * beside)
    return least


@kernel
def rectangle_gap(
    r: complex,
    facing: complex,
    other: complex,
    length: float,
    width: float,
    its_length: float,
    its_width: float,
) -> float:
    """m, gap between two rectangles, 0 where they overlap; arguments as of `separation`."""
    if separation(r, facing, other, length, width, its_length, its_width) <= 0.0:
        return 0.0
    z, back, turn = r * facing.conjugate(), -r * other.conjugate(), other * facing.conjugate()
    least = _corners_away(z, turn, its_length, its_width, length, width)
    return min(least, _corners_away(back, turn.conjugate(), length, width, its_length, its_width)) ** 0.5
