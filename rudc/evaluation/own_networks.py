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
                copies[source] = _copied(Path(source), folder / FOLDER)
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
    with which its digest is the one in the manifest. Without such copies, on the networks that it names.
    Raises pydantic's ValidationError.
    """
    swept = values.get("sweep")
    several = swept.get("network") if isinstance(swept, Mapping) else None
    several = several if isinstance(several, list) else []
    one = str(values.get("network"))
    own = sorted(filter(is_network_path, {one, *map(str, several)}))
    copies = [sorted((folder / FOLDER).absolute().glob(f"*/{glob.escape(Path(n).name)}")) for n in own]
    for chosen in itertools.product(*copies) if own else ():
        kept = dict(zip(own, map(str, chosen), strict=True))
        told = {**values, "network": kept.get(one, one)}
        if several:
            told["sweep"] = {**values["sweep"], "network": [kept.get(str(name), name) for name in several]}
        scenario = Scenario.model_validate(told)
        if scenario.digest == digest:
            return scenario
    return Scenario.model_validate(values)


def _copied(source: Path, folder: Path) -> str:
    """The copy's path: in a folder named by its content, under its own name, which messages quote."""
    try:
        data = source.read_bytes()
    except OSError as error:
        raise InputError(f"{source}: cannot be read: {error.strerror or error}") from error
    copy = folder / hashlib.sha256(data).hexdigest()[:16] / source.name
    make_folder(copy.parent)
    write_atomically(copy, data)
    return str(copy.absolute())
