"""What is learnt from where the filter is at work, and where it is not."""

import numpy as np

from rudc.learning.parameters import policy_arrays
from rudc.training.collect import Collector
from rudc.training.config import TrainConfig


def _driven_on(**changes) -> list:
    """Transitions of 300 decisions of RUDC-T with a policy that drives on, the filter fixed."""
    config = TrainConfig.default("rudc-t", learner={"n_step": 1}, slack_gain=0.0, **changes)
    collector = Collector(config, 0)
    arrays = policy_arrays(config.driver.learner)
    arrays["out.bias"][..., 0] = 1.0
    collector.load({f"policy/{name}": value for name, value in arrays.items()}, None)
    new = collector.collect(0, 300, "policy", drop=True).transitions
    collector.close()
    return list(new)


def _corrected(new: list) -> list[bool]:
    return [not np.array_equal(transition.action, transition.nominal) for transition in new]


def test_the_replay_gets_what_was_executed_or_what_was_proposed():
    executed, nominal = (_driven_on(replayed=name, filtered_share=1.0) for name in ("executed", "nominal"))
    assert sum(_corrected(executed)) > 5
    assert not any(_corrected(nominal))
    for one, other in zip(executed, nominal, strict=True):
        np.testing.assert_array_equal(one.nominal, other.nominal)
        assert one.reward == other.reward


def test_a_share_of_the_episodes_is_driven_without_the_filter():
    assert not any(_corrected(_driven_on(filtered_share=0.0)))
