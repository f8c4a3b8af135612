"""What tests of sweeps share: small plans, and runners that worker processes can import."""

import importlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from rudc.evaluation.tasks import SweepPlan
from rudc.scenario import find_scenarios

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def fakes() -> Iterator[ModuleType]:
    """The module `sweep_fakes`, under a name that worker processes can import too."""
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(str(HERE))
        patched.setenv(
            "PYTHONPATH", os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
        )
        yield importlib.import_module("sweep_fakes")


@pytest.fixture(scope="session")
def make_plan() -> Callable[..., SweepPlan]:
    """A plan over shipped scenarios."""

    def make(
        names: tuple[str, ...] = ("random_destination",),
        agents: tuple[str, ...] = ("sumo", "follower"),
        episodes: int = 3,
        seed: int = 0,
    ) -> SweepPlan:
        return SweepPlan(tuple(find_scenarios(names)), agents, episodes, seed)

    return make
