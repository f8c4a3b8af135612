"""Where shipped networks, scenarios and trained agents lie, in a checkout and in an installed wheel alike."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

_PACKAGE = Path(__file__).resolve().parent


def data_folder(name: str) -> Path:
    """Folder of shipped data: `sumo_networks`, `scenarios`, `results/checkpoints` or `results/residual`."""
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


@cache
def shipped_networks() -> Mapping[str, Path]:
    """Name -> .net.xml of the networks that come with RUDC, sorted by name; looked for once."""
    found = sorted(data_folder("sumo_networks").glob("*/*.net.xml"))
    return MappingProxyType({path.name.removesuffix(".net.xml"): path for path in found})
