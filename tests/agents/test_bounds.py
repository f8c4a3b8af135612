"""Settings and checkpoints are looked at before anything is built of them."""

import json
import re
import shutil

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

import rudc
from rudc.agents.checkpoint import shipped_checkpoints
from rudc.agents.learned import load_learned
from rudc.agents.registry import make_agent
from rudc.errors import AgentError, SweepError
from rudc.evaluation.tasks import SweepPlan
from rudc.learning.parameters import fingerprint
from rudc.safety.residual import heads
from rudc.scenario import load_scenario


@pytest.mark.parametrize(
    "setting",
    [
        "gate_step=1e-9",
        "gate_horizon=1e12",
        "half_length=1e-300",
        "half_width=1e9",
        "max_vehicles=99999999999",
        "d_safe=1e300",
        "dt=1e-300",
        "steering_weight=1e300",
        "ttcbf_gamma=1e300",
        "last_resort_margin=1e9",
    ],
)
def test_settings_have_bounds_with_reasons(setting):
    key = setting.partition("=")[0]
    with pytest.raises(AgentError, match=rf"correction\.{key}: .* is not between .* and .*: \w+"):
        make_agent(f"gap-acceptance+ttcbf:correction.{setting}")


def test_a_sweep_has_bounds():
    scenario = load_scenario("random_destination")
    with pytest.raises(SweepError, match="more than one folder takes"):
        SweepPlan((scenario,), ("sumo",), 10**18, 0)
    with pytest.raises(SweepError, match="beyond 2\\^63"):
        SweepPlan((scenario,), ("sumo",), 1, 10**30)


@pytest.fixture
def damaged(tmp_path):
    """Damages a copy of rudc-t, its digest mended so that only what is damaged is wrong; loads it."""
    folder = tmp_path / "agent"
    shutil.copytree(shipped_checkpoints()["rudc-t"], folder)

    def load(arrays=None, **described):
        weights, description = folder / "agent.safetensors", folder / "agent.json"
        stored, told = load_file(weights), json.loads(description.read_text())
        for name, change in (arrays or {}).items():
            stored[name] = change(stored.get(name))
        stored = {name: value for name, value in stored.items() if value is not None}
        save_file(stored, weights)
        told |= {"weights": fingerprint(stored)} | described
        description.write_text(json.dumps(told))
        make_agent(str(folder))

    return load


def _nan(array):
    array = array.copy()
    array.flat[3] = np.nan
    return array


@pytest.mark.parametrize(
    ("name", "change", "told"),
    [
        ("policy/hidden.bias", lambda a: None, "policy/hidden.bias is missing"),
        ("critic/fuse.bias", lambda a: None, "critic/fuse.bias is missing"),
        ("policy/out.weight", lambda a: a[..., :3].copy(), r"policy/out.weight has the shape \(1, 128, 3\)"),
        ("critic/out.bias", lambda a: a[:2].copy(), r"critic/out.bias has the shape \(2, 1, \d+\)"),
        ("policy/fuse.weight", lambda a: a.astype(np.float64), "policy/fuse.weight is float64, not float32"),
        ("policy/fuse.weight", _nan, "policy/fuse.weight is not finite"),
        ("residual/vehicle/w1", _nan, "residual/vehicle/w1 is not finite"),
        ("residual/vehicle/b2", lambda a: a[:1].copy(), "residual predictor's vehicle/"),
        ("residual/vehicle/scale", lambda a: np.repeat(a, 2), "residual predictor's scales"),
        ("policy/more.weight", lambda a: np.zeros((1, 2, 2), np.float32), "is not of this configuration"),
    ],
)
def test_weights_are_compared_with_what_the_settings_need(damaged, name, change, told):
    with pytest.raises(AgentError, match=told):
        damaged({name: change})


@pytest.mark.parametrize(
    "described",
    [
        {"training": {"seed": -1}}, {"training": {"seed": "x"}}, {"training": []}, {"training": {}},
        {"trained": []}, {"sigma": {"low": 2.0, "high": 1.0}}, {"sigma": {"low": 1e400, "high": 1.0}},
        {"sigma": 3}, {"spaces": {}}, {"learner": {"critic": {"hidden": 10**9}}}, {"learner": []},
        {"prior": ""}, {"algorithm": None}, {"format": [2]}, {"correction": {"kind": []}},
        {"action": {"kind": {}}},
    ],
    ids=str,
)  # fmt: skip
def test_a_description_is_compared_too(damaged, described):
    with pytest.raises(AgentError, match="agent"):
        damaged(**described)


@pytest.mark.parametrize(
    ("code", "which"),
    [
        ("0.0.9", rf": it says '0\.0\.9', and this is {re.escape(rudc.__version__)}$"),
        (rudc.__version__, "$"),
    ],
)
def test_an_unknown_setting_may_be_another_versions(damaged, code, which):
    told = (
        r"agent\.json: there is no setting 'action\.pace'; the checkpoint may be from another version of RUDC"
    )
    with pytest.raises(AgentError, match=told + which):
        damaged(action={"kind": "adjustment", "pace": 2}, code=code)
    with pytest.raises(AgentError, match=r"action\.adjustment: must be [^;]*$"):
        damaged(action={"kind": "adjustment", "adjustment": 9})


def test_the_solver_that_it_names_is_installed(damaged):
    correction = json.loads((shipped_checkpoints()["rudc-t"] / "agent.json").read_text())["correction"]
    with pytest.raises(
        AgentError, match=r"agent\.json: correction.*: QP solver 'batch_size' is not installed"
    ):
        damaged(correction=correction | {"solver": "batch_size"})


def test_a_description_nested_without_end_is_refused(damaged, tmp_path):
    (tmp_path / "agent" / "agent.json").write_text("[" * 100_000)
    with pytest.raises(AgentError, match="cannot be read"):
        make_agent(str(tmp_path / "agent"))


def test_what_is_not_damaged_is_loaded(damaged):
    damaged()


def test_a_scale_in_brackets_is_a_scale(damaged, tmp_path):
    """An array of one number where the predictor writes a number."""
    damaged({"residual/vehicle/scale": lambda a: np.reshape(a, 1)})
    predictor = load_learned("agent", tmp_path / "agent", {}).correction._predictor
    assert predictor.of("vehicle", np.zeros((2, len(heads()["vehicle"])))).shape == (2,)
