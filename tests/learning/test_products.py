"""Products in the widest registers: the same numbers, and nothing stays changed."""

import pytest
import torch

from rudc.learning.products import widest_products
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
