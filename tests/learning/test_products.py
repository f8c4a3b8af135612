"""Products in the widest registers and in bfloat16: nearly the same numbers, and nothing stays changed."""

import pytest
import torch

from rudc.learning.products import products_in, widest_products
from rudc.learning.rudc import RudcLearner
from tests.learning.helpers import random_batch, small_case


def test_nothing_stays_changed() -> None:
    before = torch.backends.mkldnn.matmul.fp32_precision  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ZeroDivisionError), widest_products():
        raise ZeroDivisionError
    assert torch.backends.mkldnn.matmul.fp32_precision == before  # pyright: ignore[reportAttributeAccessIssue]


def test_an_update_gives_the_same_numbers() -> None:
    """To single precision, or bfloat16's where the processor has matrix units for it."""
    case = small_case()
    usual, wide = RudcLearner(*case), RudcLearner(*case)
    for seed in range(3):
        batch = random_batch(case, 24, seed)
        expected = usual.update(batch)
        with widest_products():
            assert wide.update(batch).critic_loss == pytest.approx(expected.critic_loss, rel=2e-2)


def _gradients(learner: RudcLearner) -> torch.Tensor:
    """Of critics and policy in the last update, in one vector."""
    weights = [*learner.critics.trained.values(), *learner.policy.trained.values()]
    return torch.cat([torch.zeros(0) if w.grad is None else w.grad.flatten() for w in weights]).double()


def test_bfloat16_changes_gradients_far_less_than_another_batch_does() -> None:
    case = small_case()
    first, second = random_batch(case, 96, 0), random_batch(case, 96, 1)
    gradients = {}
    for name, precision, batch in (
        ("single", "single", first),
        ("rounded", "bfloat16", first),
        ("other", "single", second),
    ):
        learner = RudcLearner(*case)
        with products_in(precision, "cpu"):
            learner.update(batch)
        gradients[name] = _gradients(learner)
    away = {name: float((g - gradients["single"]).norm()) for name, g in gradients.items()}
    assert 0.0 < away["rounded"] < 0.1 * away["other"]
    assert all(w.dtype == torch.float32 for w in learner.critics.trained.values())
