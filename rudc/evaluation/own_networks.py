"""A sweep's own copies of the road networks it runs on: a file that is replaced meanwhile changes nothing."""

from __future__ import annotations

import glob
import hashlib
import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rudc.errors import InputError, SweepError
from rudc.evaluation.tasks import SweepPlan
from rudc.files import make_folder, write_atomically
from rudc.scenario.model import Scenario
from rudc.scenario.networks import is_network_path

FOLDER = "networks"
TRIES = 1000
"""ways tried to assign copies to networks of one name, where the copies' folders do not say whose they are"""


def keep_networks(plan: SweepPlan, folder: Path) -> dict[str, str]:
    """Copy the networks that do not come with RUDC into a sweep's folder: path, as given and absolute -> path
    of the copy.

    Raises InputError where one cannot be read, SweepError where one is no longer what its scenario's digest
    says.
    """
    copies: dict[str, str] = {}
    for scenario in plan.scenarios:
        named = (scenario.network, *map(str, scenario.sweep.get("network", ())))
        for source in filter(is_network_path, named):
            if source not in copies:
                copies[source] = _copied(source, folder / FOLDER)
                copies[str(Path(source).absolute())] = copies[source]  # how a swept one's episodes name it
        if with_copies(scenario, copies).digest != scenario.digest:
            raise SweepError(f"a network of scenario {scenario.name} was changed just now; start anew")
    return copies


def with_copies(scenario: Scenario, copies: Mapping[str, str]) -> Scenario:
    """The scenario on the copies of its networks."""
    if not copies:
        return scenario
    swept = dict(scenario.sweep)
    if "network" in swept:
        swept["network"] = tuple(copies.get(str(network), network) for network in swept["network"])
    changed = scenario.model_copy(
        update={"network": copies.get(scenario.network, scenario.network), "sweep": swept}
    )
    vars(changed).pop("digest", None)  # cached, and of the files given
    return changed


def kept_scenario(values: Mapping[str, Any], digest: str, folder: Path) -> Scenario:
    """The scenario that a sweep's manifest describes, on the sweep's own copies of its networks: those copies
    with which its digest is the one in the manifest. Where none give that digest (another version of RUDC
    digests otherwise), the copies of their name, where all have the same content; without such copies, the
    networks that it names. Raises pydantic's ValidationError.
    """
    swept = values.get("sweep")
    several = swept.get("network") if isinstance(swept, Mapping) else None
    named = (values.get("network"), *(several if isinstance(several, list) else ()))
    copies = {name: _copies(name, folder / FOLDER) for name in map(str, named) if is_network_path(name)}
    copies = {name: found for name, found in copies.items() if found}
    for chosen in itertools.islice(itertools.product(*copies.values()), TRIES):
        scenario = Scenario.model_validate(_on(values, dict(zip(copies, chosen, strict=True))))
        if scenario.digest == digest:
            return scenario
    only = {name: found[0] for name, found in copies.items() if len(found) == 1}
    return Scenario.model_validate(_on(values, only))


def _copies(name: str, folder: Path) -> list[str]:
    """The paths of what may be the copy of a network: of the one that was made of this path, if it is there,
    else of all that have its name (of an earlier version, or of a folder with other paths in its manifest);
    of several with the same content, the first.
    """
    pattern = glob.escape(Path(name).name)
    found = sorted(folder.absolute().glob(pattern)) + sorted(folder.absolute().glob(f"*/{pattern}"))
    made = [copy for copy in found if copy.parent.name == _tag(name, copy.read_bytes())]
    by_content: dict[bytes, str] = {}
    for copy in made or found:
        by_content.setdefault(copy.read_bytes(), str(copy))
    return list(by_content.values())


def _on(values: Mapping[str, Any], copies: Mapping[str, str]) -> dict[str, Any]:
    """What a manifest says of a scenario, on the copies of its networks."""
    told = dict(values)
    if "network" in told:
        told["network"] = copies.get(str(told["network"]), told["network"])
    swept = told.get("sweep")
    if isinstance(swept, Mapping) and isinstance(swept.get("network"), list):
        told["sweep"] = {**swept, "network": [copies.get(str(name), name) for name in swept["network"]]}
    return told


def _tag(name: str, data: bytes) -> str:
    """Name of the folder of a network's copy: two of the same name can be told apart by their paths."""
    return hashlib.sha256(name.encode() + b"\0" + data).hexdigest()[:16]


def _copied(name: str, folder: Path) -> str:
    """The copy's path: in a folder named by its path and content, under its own name, which messages
    quote."""
    source = Path(name)
    if source.is_relative_to(folder.absolute()):
        return name  # a copy, of a sweep that goes on as its folder says
    try:
        data = source.read_bytes()
    except OSError as error:
        raise InputError(f"{source}: cannot be read: {error.strerror or error}") from error
    copy = folder / _tag(name, data) / source.name
    make_folder(copy.parent)
    write_atomically(copy, data)
    return str(copy.absolute())
