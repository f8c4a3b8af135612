"""What tests of studies share: a small agent with a filter, and the command line."""

from pathlib import Path

import pytest

from rudc.agents.algorithms import DriverConfig
from rudc.agents.checkpoint import Learnt, load_learnt, save_learnt
from rudc.data import data_folder


@pytest.fixture
def trained(tmp_path) -> Path:
    """A folder with a shipped policy that has a filter behind it, as rudc-t has."""
    shipped = load_learnt(data_folder("results/checkpoints") / "rudc-wo-cbf")
    values = {**shipped.config.model_dump(), "algorithm": "rudc-t", "slack_gain": 0.04}
    folder = tmp_path / "mine"
    config = DriverConfig.model_validate(values)
    save_learnt(folder, Learnt(config, shipped.arrays, shipped.percentiles, shipped.training))
    return folder
