"""Networks: what they must not depend on (order, padding, other members), and what they must."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from rudc.learning.attention import attend
from rudc.learning.config import NetworkConfig, ObservationLayout
from rudc.learning.networks import Stack
from rudc.learning.parameters import critic_arrays, initial, prior_arrays, shapes
from tests.learning.helpers import SMALL, observations, small_case

LAYOUT = ObservationLayout(conflict=4)
MEMBERS, ACTIONS, OUTPUTS = 3, 2, 5


def make(
    network: NetworkConfig = SMALL, layout: ObservationLayout = LAYOUT
) -> tuple[Stack, dict[str, torch.Tensor]]:
    arrays = initial(shapes(layout, network, ACTIONS, OUTPUTS), MEMBERS, (7,), gain=1.5)
    return Stack(layout, network), {name: torch.from_numpy(value) for name, value in arrays.items()}


def outputs(stack: Stack, weights: dict[str, torch.Tensor], observation: np.ndarray) -> np.ndarray:
    flat = torch.from_numpy(observation.astype(np.float32))
    action = torch.linspace(-1, 1, ACTIONS).expand(len(flat), ACTIONS)
    return stack.decode(weights, stack.encode(weights, flat), action).numpy()


def rows_of(observation: np.ndarray) -> np.ndarray:
    """(B, 12, 6) SV rows, a view."""
    return observation[:, LAYOUT.vehicles_at].reshape(len(observation), LAYOUT.vehicles, LAYOUT.vehicle)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2]))
def test_order_and_padding_do_not_matter(seed: int, layers: int) -> None:
    """Rows shuffled, absent ones among them and filled with anything: the same outputs."""
    rng = np.random.default_rng(seed)
    stack, weights = make(SMALL.model_copy(update={"vehicle_layers": layers}))
    one = observations(LAYOUT, 4, rng)
    other = one.copy()
    rows = rows_of(other)
    rows[rows[..., 0] == 0, 1:] = 50.0
    other[:, LAYOUT.vehicles_at] = rows[:, rng.permutation(LAYOUT.vehicles)].reshape(4, -1)
    assert outputs(stack, weights, other) == pytest.approx(outputs(stack, weights, one), abs=2e-5, rel=1e-4)


def test_layout_with_fewer_rows_sees_the_same() -> None:
    """Three SVs in a layout of twelve rows, and in one of three."""
    rng = np.random.default_rng(3)
    few = replace(LAYOUT, vehicles=3)
    observation = observations(few, 2, rng)
    wide = np.zeros((2, LAYOUT.size), np.float32)
    wide[:, : few.vehicles_at.stop] = observation[:, : few.vehicles_at.stop]
    wide[:, LAYOUT.waypoints_at.start :] = observation[:, few.waypoints_at.start :]
    stack, weights = make()
    narrow, _ = make(layout=few)
    assert outputs(stack, weights, wide) == pytest.approx(outputs(narrow, weights, observation), abs=1e-5)


def test_nobody_there() -> None:
    stack, weights = make()
    weights = {name: value.requires_grad_() for name, value in weights.items()}
    empty = torch.zeros(2, LAYOUT.size)
    z = stack.decode(weights, stack.encode(weights, empty), torch.zeros(2, ACTIONS))
    assert torch.isfinite(z).all()
    for gradient in torch.autograd.grad(z.sum(), list(weights.values())):
        assert torch.isfinite(gradient).all()


def test_every_part_of_the_observation_is_seen() -> None:
    stack, weights = make()
    base = np.abs(observations(LAYOUT, 1, np.random.default_rng(4)))
    rows_of(base)[..., 0] = 1
    expected = outputs(stack, weights, base)
    for i in range(LAYOUT.size):
        changed = base.copy()
        changed[0, i] = 0.0 if changed[0, i] else 1.0
        assert np.abs(outputs(stack, weights, changed) - expected).max() > 1e-6, f"number {i} is not seen"


def test_who_is_dangerous_can_be_picked_out() -> None:
    """The hops see more than the mean of the SVs: with the same mean, outputs differ."""
    stack, weights = make()
    base = np.zeros((1, LAYOUT.size), np.float32)
    rows = rows_of(base)
    rows[0, :2, 0] = 1
    rows[0, 0, 1], rows[0, 1, 1] = 1.0, -1.0
    other = base.copy()
    rows_of(other)[0, :2, 1] = 0.0
    assert np.abs(outputs(stack, weights, base) - outputs(stack, weights, other)).max() > 1e-3


def test_a_row_does_not_depend_on_the_batch_it_comes_in() -> None:
    stack, weights = make()
    observation = observations(LAYOUT, 67, np.random.default_rng(5))
    together = outputs(stack, weights, observation)
    assert together[:, -2:] == pytest.approx(outputs(stack, weights, observation[-2:]), abs=1e-5)


@pytest.mark.parametrize("encoder", ["attention", "mlp"])
def test_a_member_is_a_network_of_its_own(encoder: str) -> None:
    stack, weights = make(SMALL.model_copy(update={"encoder": encoder}))
    observation = observations(LAYOUT, 3, np.random.default_rng(6))
    together = outputs(stack, weights, observation)
    for n in range(MEMBERS):
        alone = {name: value[n : n + 1] for name, value in weights.items()}
        assert together[n] == pytest.approx(outputs(stack, alone, observation)[0], abs=1e-5)


def test_gradient_of_a_look() -> None:
    generator = torch.Generator().manual_seed(0)
    query, x = (
        torch.randn(4, rows, 3, generator=generator, dtype=torch.float64, requires_grad=True)
        for rows in (2, 5)
    )
    valid = (torch.rand(4, 1, 5, generator=generator) < 0.6).double()
    valid[0] = 0
    assert torch.autograd.gradcheck(lambda q, x: attend(q, x, valid), [query, x])


def test_a_look_by_hand() -> None:
    """Scores 0 and log 2 beside the empty slot's 0: shares 1/4 and 2/4."""
    x = torch.tensor([[[0.0, 4.0], [1.0, 8.0], [9.0, 9.0]]])
    query = torch.tensor([[[float(np.log(2)), 0.0]]])
    taken = attend(query, x, torch.tensor([[[1.0, 1.0, 0.0]]]))
    assert taken.numpy() == pytest.approx(np.array([[[0.5, 5.0]]]))


def test_members_do_not_depend_on_how_many_there_are() -> None:
    few, many = critic_arrays(*small_case(members=2)), critic_arrays(*small_case(members=4))
    for name, value in few.items():
        assert np.array_equal(value, many[name][:2])
        if not name.startswith("importance"):
            assert not np.array_equal(value[0], value[1])


def test_priors_are_other_networks_of_the_same_architecture() -> None:
    case = small_case()
    trained, prior = critic_arrays(*case), prior_arrays(*case)
    assert {k: v.shape for k, v in trained.items()} == {k: v.shape for k, v in prior.items()}
    scale = np.sqrt(3) * 1.5
    assert not np.allclose(trained["hidden.weight"] * scale, prior["hidden.weight"])


def test_attention_needs_someone_to_look_at() -> None:
    with pytest.raises(ValueError, match="needs vehicles and waypoints"):
        critic_arrays(*small_case(layout=ObservationLayout(vehicles=0)))
