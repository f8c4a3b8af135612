"""An update on a GPU: recorded, it gives the same numbers as launched kernel by kernel, and as on a CPU."""

import pytest
import torch

from rudc.learning import recorded
from rudc.learning.recorded import Recorded
from rudc.learning.rudc import RudcLearner
from tests.learning.helpers import random_batch, small_case

on_a_gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")


def statistics(learner, batches):
    return [tuple(vars(learner.update(batch)).values()) for batch in batches]


def test_a_cpu_calls_it():
    twice = Recorded(lambda x: 2.0 * x, torch.device("cpu"))
    for value in (1.0, 3.0):
        assert twice(torch.tensor([value])).item() == 2.0 * value


@on_a_gpu
def test_recorded_updates_give_the_same_numbers(monkeypatch):
    case = small_case(updates=20, max_gradient=0.05)
    batches = [random_batch(case, 24, seed) for seed in range(12)]
    quick = RudcLearner(*case, "cuda")
    found = statistics(quick, batches)
    assert quick._recorded._graph is not None
    monkeypatch.setattr(recorded, "WARM_UPS", 100)
    slow = RudcLearner(*case, "cuda")
    assert found == [pytest.approx(row, rel=1e-3, abs=1e-4) for row in statistics(slow, batches)]
    assert slow._recorded._graph is None
    on_cpu = statistics(RudcLearner(*case), batches)
    assert found == [pytest.approx(row, rel=1e-2, abs=1e-3) for row in on_cpu]
    assert quick.critic_descent.rate == pytest.approx(slow.critic_descent.rate)


@on_a_gpu
def test_stopped_and_resumed_on_a_gpu():
    case = small_case(updates=20)
    batches = [random_batch(case, 24, seed) for seed in range(16)]
    through, first, second = (RudcLearner(*case, "cuda") for _ in range(3))
    expected = statistics(through, batches)
    statistics(first, batches[:8])
    statistics(second, batches[3:9])  # whatever it did before
    assert second._recorded._graph is not None
    second.load(first.state())
    assert second._recorded._graph is None
    found = statistics(second, batches[8:])
    assert found == [pytest.approx(row, rel=1e-3, abs=1e-4) for row in expected[8:]]
