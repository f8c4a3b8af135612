"""What is learnt from where training is driven with the outlook."""

import numpy as np
import pytest

from rudc.agents.outlook import Outlook
from rudc.errors import InputError
from rudc.learning.parameters import grouped, policy_arrays
from rudc.training.collect import Collector
from rudc.training.config import TrainConfig

CHANGES = {"learner.n_step": 1, "training.outlook": True}


def _driven(algorithm: str, changes: dict) -> list:
    """Transitions of 300 decisions with a policy that drives on."""
    config = TrainConfig.of(algorithm, changes)
    collector = Collector(config, 0)
    arrays = policy_arrays(config.learner, config.given)
    arrays["out.bias"][..., 0] = 1.0
    collector.load(grouped(policy=arrays), None)
    new = collector.collect(0, 300, "policy", drop=True).transitions
    collector.close()
    return list(new)


def _bounded(new: list) -> int:
    return sum(not np.array_equal(transition.executed, transition.proposed) for transition in new)


def test_the_replay_gets_what_the_outlook_let_be_done():
    assert _bounded(_driven("sac", {**CHANGES, "training.filtered_share": 1.0})) > 5
    assert _bounded(_driven("sac", {**CHANGES, "training.filtered_share": 0.0})) == 0
    assert _bounded(_driven("sac", {"learner.n_step": 1})) == 0


def test_what_is_learnt_from_is_what_the_outlook_shows(monkeypatch):
    see = Outlook.see
    shown = []

    def watched(self, scene):
        shown.append(scene.time_s)
        return see(self, scene)

    monkeypatch.setattr(Outlook, "see", watched)
    new = _driven("sac", CHANGES)
    starts = shown.count(min(shown))
    assert len(shown) == len(new) + starts, "once a decision, and once at each start"


def test_without_an_outlook_it_does_nothing():
    off = {"outlook.course": False, "outlook.plant": "off"}
    with pytest.raises(InputError, match=r"training\.outlook: has no effect"):
        TrainConfig.of("sac", {"training.outlook": True, **off})
    assert TrainConfig.of("sac", {"training.outlook": True, "training.filtered_share": 0.3})
