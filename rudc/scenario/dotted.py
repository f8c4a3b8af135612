"""Values named by dotted keys, as in `traffic.density` or `events.0.deceleration`."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import yaml

from rudc.hints import there_are

Path = tuple[str | int, ...]
"""keys and list indices from the top of a file down to a value"""


class DottedKeyError(Exception):
    """A dotted key leads nowhere; caught before it leaves the package."""


def with_value(data: dict[str, Any], key: str, value: Any) -> tuple[dict[str, Any], Path]:
    """The same data with another value at a dotted key, and the path to it. Parts that the key does not lead
    through are shared with the data, not copied.

    Missing sections are made. Raises DottedKeyError.
    """
    parts = key.split(".")
    if not all(parts):
        raise DottedKeyError("expected a dotted key, such as traffic.density")
    if parts[0] == "shared" and len(parts) > 1 and parts[1] not in (data.get("shared") or {}):
        raise DottedKeyError(f"no shared number is called {parts[1]!r}{_shared_names(data, parts[1])}")
    changed = data.copy()
    here: Any = changed
    path: Path = ()
    for i, part in enumerate(parts):
        step = _step(here, part, ".".join(parts[:i]))
        path = (*path, step)
        if i == len(parts) - 1:
            here[step] = deepcopy(value)
        else:
            missing: Any = [] if path == ("events",) else {}
            inner = here.get(step, missing) if isinstance(step, str) else here[step]
            if path == ("ego", "route") and inner == "random":  # which is to say nothing of it
                inner = missing
            here[step] = inner.copy() if isinstance(inner, dict | list) else inner
            here = here[step]
    return changed, path


def _shared_names(data: dict[str, Any], word: str) -> str:
    names = [str(name) for name in data.get("shared") or ()]
    return there_are(word, names) if names else "; the scenario has no section `shared`"


def _step(here: Any, part: str, before: str) -> str | int:
    if isinstance(here, dict):
        return part
    if not isinstance(here, list):
        raise DottedKeyError(f"{before} is {here!r}, which has no part {part!r}")
    if not part.isdecimal() or int(part) >= len(here):
        if before == "events" and not here:
            raise DottedKeyError(f"there is no event {part}; the file has none")
        numbers = f"0 to {len(here) - 1}" if here else "none, it is empty"
        raise DottedKeyError(
            f"{before} is a list whose entries are numbered ({numbers}); there is no {part!r}"
        )
    return int(part)


def value_at(data: dict[str, Any], key: str) -> Any:
    """What stands at a dotted key of data; None where nothing does."""
    here: Any = data
    try:
        for part in key.split("."):
            here = here[_step(here, part, key)]
    except (DottedKeyError, KeyError):
        return None
    return here


def value_text(value: object) -> str:
    """A value as a file writes it, in one line."""
    if isinstance(value, dict | list):
        return yaml.safe_dump(value, default_flow_style=True, width=1000, allow_unicode=True).strip()
    return str(value).lower() if isinstance(value, bool) else str(value)


def dotted(path: Path) -> str:
    """The dotted key of a path."""
    return ".".join(part if isinstance(part, str) and part.isprintable() else repr(part) for part in path)
