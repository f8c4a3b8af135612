"""What is learnt from where the filter is at work, and where it is not."""

import numpy as np

from rudc.learning.parameters import grouped, policy_arrays
from rudc.training.collect import Collector
from rudc.training.config import TrainConfig


def driven(algorithm: str, changes: dict) -> list:
    """Transitions of 300 decisions with a policy that drives on."""
    config = TrainConfig.of(algorithm, {"learner.n_step": 1, **changes})
    collector = Collector(config, 0)
    arrays = policy_arrays(config.learner, config.given)
    arrays["out.bias"][..., 0] = 1.0
    collector.load(grouped(policy=arrays), None)
    new = collector.collect(0, 300, "policy", drop=True).transitions
    collector.close()
    return list(new)


def changed(new: list) -> int:
    """How many of them did not execute what was proposed."""
    return sum(not np.array_equal(transition.executed, transition.proposed) for transition in new)


def _driven_on(filtered_share: float) -> list:
    """RUDC-T's, the filter fixed."""
    return driven("rudc-t", {"correction.slack.gain": 0.0, "training.filtered_share": filtered_share})


def test_the_replay_gets_what_was_executed_and_what_was_proposed():
    assert changed(_driven_on(1.0)) > 5


def test_a_share_of_the_episodes_is_driven_without_the_filter():
    assert changed(_driven_on(0.0)) == 0
