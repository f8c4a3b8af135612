"""Hints that go with messages: what a misspelt word probably means, and how to install what is missing."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

LIKENESS = 0.6
"""how like two words must be, 0 to 1, for one to be offered for the other (difflib's ratio)"""


def nearest(word: object, known: Iterable[str]) -> str | None:
    """The known word that is most likely meant; None if none is like it."""
    return next(iter(get_close_matches(str(word), list(known), n=1, cutoff=LIKENESS)), None)


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """` (did you mean 'x'?)`, or nothing."""
    near = nearest(word, known)
    return f" (did you mean {near!r}?)" if near else ""


def there_are(word: object, known: Iterable[str]) -> str:
    """` (did you mean 'x'?); there are: x, y, z`: the end of a message that says that `word` is unknown."""
    names = list(known)
    return f"{did_you_mean(word, names)}; there are: {', '.join(names)}"


def listed(names: Sequence[str], most: int = 12) -> str:
    """`x, y, z`; of more than `most` names only the first `most`, and how many there are in all."""
    return ", ".join(names[:most]) + (f", ... ({len(names)} in all)" if len(names) > most else "")


def install_command(extra: str) -> str:
    """The command that installs an extra, for a checkout (it works in any folder) or an installed package."""
    root = Path(__file__).resolve().parent.parent
    if not (root / "pyproject.toml").is_file():
        return f'{_near(Path(sys.executable))} -m pip install "rudc[{extra}]"'
    constraints, python = _near(root / "constraints.txt"), _near(Path(sys.executable))
    editable = "." if constraints == "constraints.txt" else str(root)
    return f'{python} -m pip install --constraint {constraints} --editable "{editable}[{extra}]"'


def _near(path: Path) -> str:
    """A path as one would type it here: relative if it lies in the working folder."""
    try:
        text = os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path)
    except OSError:  # the working folder is gone
        text = str(path)
    return f'"{text}"' if " " in text else text
