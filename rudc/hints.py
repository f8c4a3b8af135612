"""What a misspelt word probably means: "did you mean", everywhere with one measure."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

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
    """` (did you mean 'x'?); there are: x, y, z`, to stand behind the words that say what there is not."""
    names = list(known)
    return f"{did_you_mean(word, names)}; there are: {', '.join(names)}"
