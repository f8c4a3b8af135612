"""Kernels: functions of plain numbers and arrays that are compiled to machine code once; and rectangles.

What decides ten times a second calls numpy on arrays of ten numbers, and pays for the call. A kernel is
written out as loops, in one call. Each floor has its kernels in one module `kernels.py`, which is imported
only where somebody drives: importing it compiles what was never compiled on this machine (half a minute for
all), or loads it.

Compiled code lies beside the module, or where that cannot be written to in the user's cache folder or a
temporary one; NUMBA_CACHE_DIR says otherwise. It is kept by the content of all kernels, since one may call
another's. There is no fast-math and no parallel loop: the same numbers on any number of workers.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numba
from numba import types

from rudc.arrays import Array, Complex, Flags, Index

Result = TypeVar("Result")


def _read(dtype: Any, dimensions: int) -> types.Array:
    return types.Array(dtype, dimensions, "A", readonly=True)


def _made(dtype: Any, dimensions: int) -> types.Array:
    return types.Array(dtype, dimensions, "C")


Vector = Annotated[Array, _read(types.float64, 1)]
"""(n,), read whatever its strides; the others likewise"""
Table = Annotated[Array, _read(types.float64, 2)]
Cube = Annotated[Array, _read(types.float64, 3)]
Places = Annotated[Complex, _read(types.complex128, 1)]
PlaceTable = Annotated[Complex, _read(types.complex128, 2)]
Rows = Annotated[Index, _read(types.int64, 1)]
Marks = Annotated[Flags, _read(types.boolean, 1)]
NewVector = Annotated[Array, _made(types.float64, 1)]
"""(n,), made by a kernel or written to; the others likewise"""
NewTable = Annotated[Array, _made(types.float64, 2)]
NewCube = Annotated[Array, _made(types.float64, 3)]
NewColumns = Annotated[Array, types.Array(types.float64, 2, "F")]
"""a table, one column after the other"""
NewPlaces = Annotated[Complex, _made(types.complex128, 1)]
NewPlaceTable = Annotated[Complex, _made(types.complex128, 2)]
NewRows = Annotated[Index, _made(types.int64, 1)]
NewRowTable = Annotated[Index, _made(types.int64, 2)]
NewFlags = Annotated[Flags, _made(types.boolean, 1)]

_PLAIN = {float: types.float64, int: types.int64, bool: types.boolean, complex: types.complex128}


def _type_of(hint: Any) -> Any:
    if get_origin(hint) is tuple:
        return types.Tuple([_type_of(part) for part in get_args(hint)])
    return _PLAIN[hint] if hint in _PLAIN else get_args(hint)[1]


def kernel(function: Callable[..., Result]) -> Callable[..., Result]:
    """Compile a function when it is defined, for the types that it states, or load it. Divisions by 0 are as
    numpy's.
    """
    hints = get_type_hints(function, include_extras=True)
    result = _type_of(hints.pop("return"))
    signature = result(*[_type_of(hint) for hint in hints.values()])
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _folder()  # type: ignore[attr-defined]
    try:
        with _alone():
            return numba.njit(signature, cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """No other process compiles meanwhile: what two want at once one compiles, and the other loads."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(ImportError, OSError):  # no such locks on Windows
            import fcntl

            file = held.enter_context(open(Path(_folder()) / "lock", "a", encoding="utf-8"))
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


@cache
def _folder() -> str:
    """Where compiled kernels of this content lie."""
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for module in sorted(package.rglob("*kernels.py")):
        digest.update(module.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    places = (
        os.environ.get("NUMBA_CACHE_DIR"), package / "__pycache__", Path(home) / "rudc",
        Path(tempfile.gettempdir()) / f"rudc-{os.getuid() if hasattr(os, 'getuid') else ''}",
    )  # fmt: skip
    for place in filter(None, places):
        folder = Path(place) / f"kernels-{digest.hexdigest()[:12]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK | os.X_OK):
            return str(folder)
    return tempfile.mkdtemp(prefix="rudc-kernels-")


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

    `r` m from the one's centre to the other's, `facing` and `other` their directions, then half sizes m.
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
    """m2, least squared distance from a corner of a rectangle at z, turned, to a box about the origin."""
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
