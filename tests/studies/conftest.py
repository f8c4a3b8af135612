"""What tests of studies share: a small agent with a filter."""

from pathlib import Path

import pytest

from rudc.agents.checkpoint import load_learnt, save_learnt
from rudc.agents.config import AgentConfig
from rudc.agents.route_sigma import ROUTE
from rudc.data import data_folder


@pytest.fixture
def trained(tmp_path) -> Path:
    """A folder with a shipped policy that has a filter behind it, as rudc-t has; sigma by route is not
    measured."""
    shipped = load_learnt(data_folder("results/checkpoints") / "rudc-wo-cbf")
    correction = {"kind": "cbf", "slack": {"gain": 0.4}}
    values = {**shipped.config.model_dump(), "algorithm": "rudc-t", "correction": correction}
    folder = tmp_path / "mine"
    arrays = {name: value for name, value in shipped.arrays.items() if not name.startswith(f"{ROUTE}/")}
    save_learnt(folder, shipped._replace(config=AgentConfig.model_validate(values), arrays=arrays))
    return folder
