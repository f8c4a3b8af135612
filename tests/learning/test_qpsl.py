"""QPSL's learner: SAC unchanged beside it, a linear model recovered, costs of single decisions, saving."""

from dataclasses import replace

import numpy as np
import pytest

from rudc.learning.algorithms import QpslConfig
from rudc.learning.batch import Batch
from rudc.learning.inference import Decider
from rudc.learning.nstep import NStep
from rudc.learning.qpsl import QpslLearner
from rudc.learning.sac import SacLearner
from tests.learning.test_sac import CONFIG as SAC_CONFIG
from tests.learning.test_sac import PROBLEM, batch

CONFIG = QpslConfig(**SAC_CONFIG.model_dump())


def told(seed: int) -> Batch:
    """Costs change by g . a of the executed action, g = (0.5, -0.2) where the first observation is positive
    and (0.1, 0.3) elsewhere.
    """
    b = batch(seed, 64)
    g = np.where(b.observation[:, :1] > 0, [0.5, -0.2], [0.1, 0.3])
    return b._replace(cost_change=(g * b.executed).sum(axis=1).astype(np.float32))


def test_the_model_is_recovered_and_sac_is_as_without() -> None:
    learner, sac = QpslLearner(CONFIG, PROBLEM), SacLearner(SAC_CONFIG, PROBLEM)
    errors = []
    for seed in range(400):
        said = learner.update(told(seed))
        errors.append(said.change_error)
        if seed < 3:
            assert said.policy_loss == sac.update(told(seed)).policy_loss
    assert np.mean(errors[-20:]) < 0.3 * errors[0]
    decider = Decider(CONFIG, PROBLEM.layout, learner.weights())
    states = np.random.default_rng(9).normal(size=(100, 5)).astype(np.float32)
    for sign, g in ((1, [0.5, -0.2]), (-1, [0.1, 0.3])):
        found = [decider.seen("change", seen) for seen in states if sign * seen[0] > 0.3]
        assert np.mean(found, axis=0) == pytest.approx(g, abs=0.06)


def test_costs_of_single_decisions_whatever_the_steps_are() -> None:
    steps, seen = NStep(3, 0.9), np.zeros(1, np.float32)
    new = []
    for before, cost in ((0.1, 0.3), (0.3, 0.2), (0.2, 5.2)):
        last = cost == 5.2
        new += steps.add(seen, seen, seen, 1.0, cost, seen, terminal=last, cost_before=before)
    assert [t.cost_change for t in new] == pytest.approx([0.2, -0.1, 5.0])
    assert new[0].cost == pytest.approx(0.3 + 0.9 * 0.2 + 0.81 * 5.2)


def test_stopped_and_resumed_same_numbers() -> None:
    through, first, second = (QpslLearner(CONFIG, replace(PROBLEM, updates=5)) for _ in range(3))
    expected = [through.update(told(seed)) for seed in range(6)]
    for seed in range(3):
        first.update(told(seed))
    second.load(first.state())
    assert [second.update(told(seed)) for seed in range(3, 6)] == expected[3:]
