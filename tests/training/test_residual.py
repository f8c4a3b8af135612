"""The residual predictor: its samples, what it learns, and how it comes back from a file."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file

from rudc.arrays import Array
from rudc.env.action import Adjustment
from rudc.env.episode import Episode
from rudc.errors import AgentError, InputError, SimulationError
from rudc.safety.barriers import BARRIERS
from rudc.safety.residual import ResidualPredictor, heads, load_predictor, shipped_predictor, trust
from rudc.scenario import load_scenario
from rudc.training import residual_data
from rudc.training.curriculum import Mixture
from rudc.training.residual_data import Samples, collect, load_dataset, save_dataset
from rudc.training.residual_fit import _initial, _predict, evaluate, fit, standing
from rudc.vehicle import EgoVehicle
from tests.safety.test_barriers import SpeedBarrier

VEHICLE, ROAD = heads().values()


@pytest.fixture(scope="module")
def dataset():
    return collect(1500, 3, Adjustment(), lambda *_: None)


def test_samples_are_the_same_with_the_same_seed_and_survive_a_file(dataset, tmp_path):
    save_dataset(tmp_path / "data.safetensors", dataset)
    kept, again = load_dataset(tmp_path / "data.safetensors"), collect(600, 3, Adjustment(), lambda *_: None)
    for head in heads():
        for whole, same, first in zip(dataset[head], kept[head], again[head], strict=True):
            np.testing.assert_array_equal(same, whole)
            np.testing.assert_array_equal(first, whole[:600])


def test_samples_have_what_is_named_and_the_model_predicts_most_of_the_change(dataset):
    for head, names in heads().items():
        samples = dataset[head]
        assert samples.xi.shape == (1500, len(names))
        assert all(np.isfinite(part).all() for part in samples)
        assert np.abs(samples.xi).max() < 20
        assert np.median(np.abs(samples.w)) < 0.5 * np.median(np.abs(samples.change))
        assert len(np.unique(samples.episode)) > 3


def test_an_episode_that_fails_is_left_out(monkeypatch):
    tried = []

    class Failing(Episode):
        def reset(self, plan, **more):
            tried.append(plan)
            if len(tried) == 1 or len(tried) > 30:
                raise SimulationError("no safe start")
            return super().reset(plan, **more)

    monkeypatch.setattr(residual_data, "Episode", Failing)
    told = []
    found = collect(100, 3, Adjustment(), lambda *count: told.append(count))
    assert {count for _, count in told} == {1}
    assert set(found["vehicle"].episode) == set(range(1, len(tried)))
    tried += [None] * 30
    with pytest.raises(SimulationError, match="20 episodes in a row cannot be driven: no safe start"):
        collect(100, 3, Adjustment(), lambda *_: None)


def test_nothing_is_kept_of_an_episode_that_fails_later(monkeypatch):
    steps = []

    class Failing(Episode):
        def step(self, u):
            steps.append(u)
            if len(steps) == 10:
                raise SimulationError("two in one place")
            return super().step(u)

    monkeypatch.setattr(residual_data, "Episode", Failing)
    found = collect(100, 3, Adjustment(), lambda *_: None)
    assert len(steps) > 10
    assert 0 not in found["vehicle"].episode
    assert 0 not in found["road"].episode


def test_random_actions_stand_still_now_and_then(dataset):
    speed = 10 * dataset["vehicle"].xi[:, 2]
    assert 0.03 < np.mean(speed < 0.1) < 0.5


def test_barriers_of_others_are_no_part_of_samples(monkeypatch):
    class Eager(SpeedBarrier):
        at_work = True

    monkeypatch.setitem(BARRIERS, "speed", Eager)
    assert set(collect(20, 3, Adjustment(), lambda *_: None)) == {"vehicle", "road"}


def _known(rng: np.random.Generator, features_: int, rows: int = 2000) -> Samples:
    """Samples whose w is a smooth function of the features."""
    xi = rng.normal(size=(rows, features_)).astype(np.float32)
    xi[:, 2] = 0.1 + np.abs(xi[:, 2])  # the ego's speed: what stands still is faded out
    w = (0.5 * xi[:, 0] * xi[:, 1] + np.sin(xi[:, 2])).astype(np.float32)
    change = (w + 3 * xi[:, 3]).astype(np.float32)
    return Samples(xi, change, w, (np.arange(rows) // 20).astype(np.int32))


def test_a_known_residual_is_learnt_and_the_fit_is_deterministic():
    rng = np.random.default_rng(0)
    known = {head: _known(rng, len(names)) for head, names in heads().items()}
    predictor = fit(known, seed=0, epochs=400)
    for found in evaluate(known, predictor, only_held_out=True):
        assert found.samples == 200
        assert found.explained > 0.8
        assert found.predictor.r2 > 0.97 > found.model.r2
        assert found.predictor.rmse < found.model.rmse
    threads = torch.get_num_threads()
    torch.set_num_threads(3)
    short, again = fit(known, 1, epochs=2), fit(known, 1, epochs=2)
    after = torch.get_num_threads()
    torch.set_num_threads(threads)
    assert after == 3  # who learns next has as many
    for name, value in short.arrays.items():
        np.testing.assert_array_equal(value, again.arrays[name])


def test_jumps_that_nobody_can_foresee_do_not_move_what_is_predicted():
    rng = np.random.default_rng(1)
    known = {head: _known(rng, len(names)) for head, names in heads().items()}
    calm = known["vehicle"]
    jumps = np.where(rng.random(len(calm.w)) < 0.01, 100.0, 0.0).astype(np.float32)
    jumpy = fit(known | {"vehicle": calm._replace(w=calm.w + jumps)}, seed=0, epochs=300)
    xi = calm.xi.astype(np.float64)
    error = jumpy.of("vehicle", xi) - calm.w
    assert abs(np.median(error)) < 0.02
    assert np.median(np.abs(error)) < 0.2


@pytest.mark.parametrize(
    ("episodes", "said"),
    [(0, "0 are of episodes that are learnt from"), (11, "0 are of episodes that are held out")],
)
def test_samples_of_too_few_episodes_are_refused(episodes, said):
    rng = np.random.default_rng(0)
    known = {head: _known(rng, len(names), rows=100) for head, names in heads().items()}
    few = {head: samples._replace(episode=np.full(100, episodes)) for head, samples in known.items()}
    with pytest.raises(InputError, match=f"of the 100 of head 'vehicle', {said} .* residual collect"):
        fit(few, 0, epochs=1)
    if episodes:
        with pytest.raises(InputError, match="are held out"):
            evaluate(few, shipped_predictor(), only_held_out=True)


def test_where_nothing_changes_there_is_nothing_to_explain():
    rng = np.random.default_rng(0)
    still = {head: _known(rng, len(names), rows=100) for head, names in heads().items()}
    still = {
        k: v._replace(change=np.zeros(100, np.float32), w=np.zeros(100, np.float32)) for k, v in still.items()
    }
    found = evaluate(still, shipped_predictor(), only_held_out=False)
    assert all(np.isnan([part.explained, part.model.r2, part.predictor.r2]).all() for part in found)


def test_samples_that_stand_beside_what_stands():
    rng = np.random.default_rng(2)
    samples = _known(rng, len(VEHICLE), rows=200)
    names = ("speed / 10", "its speed ahead / 10", "its speed to the left / 10", "distance / 20")
    columns = [VEHICLE.index(name) for name in names]
    samples.xi[:, columns] = [0.04, 0.0, 0.04, 0.49]
    samples.xi[:4, columns] += 0.02 * np.eye(4)
    still = standing(samples)
    np.testing.assert_array_equal(still.w, np.concatenate([samples.w[1:2], samples.w[4:]]))


def test_inference_without_torch_agrees_with_torch():
    rng = np.random.default_rng(0)
    weights = _initial(len(ROAD), rng)
    mean, spread = rng.normal(size=len(ROAD)), rng.uniform(0.5, 2.0, len(ROAD))
    head = {name: w.detach().numpy() for name, w in weights.items()} | {"mean": mean, "spread": spread}
    head |= {"low": np.full(len(ROAD), -1.5), "high": np.full(len(ROAD), 1.0)}
    arrays: dict[str, Array] = {f"road/{k}": v for k, v in head.items()} | {"road/scale": np.array(2.5)}
    arrays |= {f"vehicle/{k}": v.detach().numpy() for k, v in _initial(len(VEHICLE), rng).items()}
    zeros, ones = np.zeros(len(VEHICLE)), np.ones(len(VEHICLE))
    arrays |= {"vehicle/mean": zeros, "vehicle/spread": ones, "vehicle/low": -ones, "vehicle/high": ones}
    predictor = ResidualPredictor(arrays | {"vehicle/scale": np.array(1.0)})
    xi = rng.normal(size=(7, len(ROAD)))
    xi[:, ROAD.index("speed / 10")] = 0.1  # no fading
    inside = np.clip(xi, -1.5, 1.0)
    assert (inside != xi).any()
    with torch.no_grad():
        x = torch.tensor((inside - mean) / spread, dtype=torch.float32)
        expected = 2.5 * _predict(weights, x).numpy()
    np.testing.assert_allclose(predictor.of("road", xi), expected, rtol=1e-4, atol=1e-5)


def test_what_is_no_predictor_and_no_samples_is_refused(tmp_path):
    with pytest.raises(AgentError, match="rudc residual fit"):
        load_predictor(tmp_path / "none.safetensors")
    with pytest.raises(InputError, match="rudc residual collect"):
        load_dataset(tmp_path / "none.safetensors")
    (tmp_path / "text").write_text("no")
    with pytest.raises(AgentError, match="is no residual predictor"):
        load_predictor(tmp_path / "text")
    with pytest.raises(InputError, match="holds no samples"):
        load_dataset(tmp_path / "text")
    save_file({"vehicle/mean": np.zeros(3, np.float32)}, tmp_path / "part")
    with pytest.raises(AgentError, match="lacks 'vehicle/spread'"):
        load_predictor(tmp_path / "part")


def test_on_ice_the_faded_predictor_is_better_than_none(monkeypatch):
    """Random actions ask for far more than the road gives; unfaded, it is worse than none. Compared by the
    mean of the errors' sizes: a few errors make up most of the mean of their squares."""
    ice = {"events": [{"kind": "low_friction", "friction": 0.2}]}
    mixture = Mixture((load_scenario("random_destination", ice),), (1.0,))
    monkeypatch.setattr(residual_data, "make_mixture", lambda source, curriculum: mixture)
    samples = residual_data.collect(1500, 3, Adjustment(), lambda *_: None)["road"]
    known = replace(EgoVehicle(), a_min=-0.2 * 9.81)
    counts = [
        trust(known, 10 * v, np.array([6 * a, np.arctan(tan)]), EgoVehicle())
        for a, tan, v in samples.xi[:, :3].astype(float)
    ]
    w = shipped_predictor().of("road", samples.xi.astype(float))
    alone, unfaded, faded = (np.abs(samples.w - f * w).mean() for f in (0.0, 1.0, np.array(counts)))
    assert faded < alone < unfaded
    assert faded < 0.9 * alone
