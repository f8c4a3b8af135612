"""Where in code that is not RUDC's an error arose.

The first file of a traceback that is neither RUDC's nor Python's is that of the code which RUDC called. The
place of the error is the last line in the folder or package of that file: not where in PyTorch it came out.
"""

from __future__ import annotations

import sysconfig
import traceback
from functools import cache
from pathlib import Path
from types import TracebackType

from rudc.beside import INSTALLED, folders_of

_RUDC = Path(__file__).resolve().parent


def place_of(error: BaseException) -> str:
    """`file.py:12`, the place of an error as above; where RUDC called no other code, the line that raised it.
    Empty without a traceback.
    """
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return ""
    called = next((frame.filename for frame in frames if _is_own(frame.filename)), None)
    place = frames[-1]
    if called is not None:
        _, home = folders_of(Path(called))
        place = next(frame for frame in reversed(frames) if _lies_in(frame.filename, home))
    return f"{Path(place.filename).name}:{place.lineno}"


def own_traceback(error: BaseException) -> str:
    """The traceback of an error as Python prints it, without the calls in RUDC that led to the other code.
    Empty if there is no other code in it.
    """
    rest: TracebackType | None = error.__traceback__
    while rest is not None and not _is_own(rest.tb_frame.f_code.co_filename):
        rest = rest.tb_next
    return "".join(traceback.TracebackException(type(error), error, rest).format()) if rest else ""


@cache
def _is_own(file: str) -> bool:
    path = Path(file).resolve()
    if file.startswith("<") or path.is_relative_to(_RUDC):
        return False
    libraries = {Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")}
    return not any(_lies_in(file, library) for library in libraries)


def _lies_in(file: str, home: Path) -> bool:
    """Whether a file lies in a folder (or is it), and not among the packages that are installed there."""
    path = Path(file).resolve()
    return path.is_relative_to(home) and not set(INSTALLED) & set(path.relative_to(home).parts)
