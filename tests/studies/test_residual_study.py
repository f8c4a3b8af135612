"""The residual study: it collects, measures and draws for real, and takes its samples again."""

import pytest
from PIL import Image

from rudc.errors import InputError
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.safety.residual import shipped_predictor
from rudc.studies import residual_study
from rudc.studies.base import Order
from rudc.training.residual_data import load_dataset
from rudc.training.residual_fit import evaluate


def test_it_runs_and_resumes(tmp_path, monkeypatch):
    monkeypatch.setattr(residual_study, "SAMPLES", {"quick": 300})
    monkeypatch.setattr(residual_study, "KINDS", ("direct",))
    order = Order(tmp_path, budget="quick")
    report = residual_study.run(order, lambda _: Silent())
    lines = read_table(tmp_path / "residual.csv")
    assert [line["by"] for line in lines[:2]] == ["model alone", "with predictor"]
    dataset = load_dataset(tmp_path / "samples-direct-0.safetensors")
    first = evaluate(dataset, shipped_predictor("direct"), only_held_out=False)[0]
    assert float(lines[1]["r2"]) == pytest.approx(first.predictor.r2, abs=1e-6)
    assert float(lines[0]["share_of_w"]) == 0.0
    assert {line["constraints"] for line in lines} >= {"vehicle", "road", "road, within grip"}
    kept = residual_study.within_grip(dataset)["road"]
    assert 0 < len(kept.w) <= 300
    slow = dataset["road"].xi[:, 2] < 0.1  # 1 m/s
    assert len(kept.w) >= slow.sum()
    with Image.open(tmp_path / "residual.png") as picture:
        assert picture.size[0] > 600
    with pytest.raises(InputError, match="--resume"):
        residual_study.run(order, lambda _: Silent())
    monkeypatch.setattr(residual_study, "collect", None)
    again = residual_study.run(Order(tmp_path, budget="quick", resume=True), lambda _: Silent())
    assert again.table == report.table
