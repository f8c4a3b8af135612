"""Which road networks a scenario may name; `rudc.network` reads what is in them."""

from __future__ import annotations

import os
from pathlib import Path

from rudc.data import shipped_networks
from rudc.files import names_beside
from rudc.hints import did_you_mean, nearest
from rudc.scenario.base import refuse

NETWORK_SUFFIXES = (".net.xml", ".net.xml.gz")


def is_network_path(value: object) -> bool:
    """Whether a scenario's `network` is a path rather than a shipped name."""
    return isinstance(value, str) and value.endswith(NETWORK_SUFFIXES)


def existing_network(value: str) -> str:
    """The value itself, or the path made absolute; refuses what does not exist."""
    if is_network_path(value):
        path = Path(value)
        if not os.path.isfile(path):  # unlike Path.is_file, no error for a name that is too long
            beside = list(filter(is_network_path, names_beside(path)))
            refuse(f"no such file: {value}{did_you_mean(path.name, beside)}")
        return str(path.absolute())
    known = shipped_networks()
    if value not in known:
        near = nearest(value, known)
        meant = f"did you mean {near!r}?" if near else f"shipped ones: {', '.join(known)}"
        refuse(
            f"no shipped network {value!r} ({meant}); a network of your own is a path that ends in .net.xml"
        )
    return value
