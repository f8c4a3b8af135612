"""Training curves: means and bands over trainings, and folders that do not fit."""

import math
from pathlib import Path

import pytest
from PIL import Image

from rudc.errors import InputError
from rudc.evaluation.statistics import wilson
from rudc.evaluation.store import read_table
from rudc.evaluation.sweep import Silent
from rudc.studies.base import Order
from rudc.studies.curves import band_of, names_of, run
from rudc.training.log import BEFORE, EVALUATION
from rudc.training.log_curves import Measured, read_training


def training(folder: Path, rate: float, last: int = 20_000) -> Path:
    """A training's folder whose success is `rate` throughout."""
    folder.mkdir()
    own = {"episodes": 10, "success": rate, "collision": 1 - rate, "episode_reward": 100 * rate}
    for name, columns, every in (("progress", BEFORE, 1000), ("evaluation", EVALUATION, 10_000)):
        lines = [",".join(columns)]
        for steps in range(every, last + 1, every):
            values = {
                **dict.fromkeys(columns, 0),
                **own,
                "steps": steps,
                "scenario": "fog",
                "priority": "all",
            }
            lines.append(",".join(str(values[c]) for c in columns))
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_band_is_students_and_a_rates_at_least_wilsons():
    band = band_of([Measured(value, 1000) for value in (90.0, 92.0, 94.0)], rate=True)
    assert band.mean == 92.0
    assert band.high - band.mean == pytest.approx(4.302653 * 2.0 / math.sqrt(3), rel=1e-6)
    apart = [Measured(90.0, 1000), Measured(100.0, 1000)]
    assert band_of(apart, rate=True).high == 100.0
    assert band_of(apart, rate=False).high > 100.0
    all_succeed = band_of([Measured(100.0, 20)] * 3, rate=True)
    assert all_succeed == (100.0, pytest.approx(100 * wilson(60, 60)[0]), 100.0)
    alone = band_of([Measured(90.0, 10)], rate=True)
    assert alone[1:] == pytest.approx([100 * end for end in wilson(9, 10)])
    assert math.isnan(band_of([Measured(90.0, 10)], rate=False).low)


def test_trainings_are_put_together(tmp_path):
    folders = [training(tmp_path / "mine", 0.8), training(tmp_path / "mine-seed1", 0.9, last=10_000)]
    other = training(tmp_path / "other", 0.5)
    report = run(Order(tmp_path / "out", folders=(*folders, other)), lambda _: Silent())
    lines = read_table(tmp_path / "out" / "curves.csv")
    mine = [m for m in lines if m["agent"] == "mine" and m["source"] == "training" and m["metric"] == "SR"]
    assert [(m["steps"], m["trainings"]) for m in mine] == [("5000", "2"), ("10000", "2")]
    assert float(mine[0]["mean"]) == pytest.approx(85.0)
    (tested,) = [m for m in lines if m["agent"] == "mine" and m["scenario"] == "fog" and m["metric"] == "VR"]
    assert float(tested["mean"]) == pytest.approx(15.0)
    assert tested["episodes"] == "20"
    assert "SR (%) [trainings, episodes]" in report.table
    assert "least as wide as Wilson's of all their episodes" in report.table
    assert "mine: trainings end at 20000, 10000 steps" in report.notes[0]
    assert "| mine  | fog      | all  |" in report.table
    with Image.open(tmp_path / "out" / "curves.png") as picture:
        assert picture.size[0] > 600


def test_folders_of_the_same_name_are_curves_of_their_own(tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "other").mkdir()
    one = training(tmp_path / "one" / "mine", 0.8)
    seed = training(tmp_path / "one" / "mine-seed1", 0.8)
    other = training(tmp_path / "other" / "mine", 0.4)
    (tmp_path / "link").symlink_to(one)
    run(Order(tmp_path / "out", folders=(one, tmp_path / "link", seed, other)), lambda _: Silent())
    lines = [m for m in read_table(tmp_path / "out" / "curves.csv") if m["metric"] == "SR"]
    found = {(m["agent"], m["trainings"], float(m["mean"])) for m in lines}
    assert found == {("one/mine", "2", 80.0), ("other/mine", "1", 40.0)}
    assert set(names_of((seed, other)).values()) == {"mine"}


def test_a_bin_that_is_not_full_is_left_out(tmp_path):
    curves = read_training(training(tmp_path / "mine", 0.8, last=12_000))
    assert sorted(curves["training", "", "all", "SR"]) == [5000, 10_000]


def test_other_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match="is it the folder of a training"):
        run(Order(tmp_path / "out", folders=(tmp_path,)), lambda _: Silent())
    with pytest.raises(InputError, match="which trainings"):
        run(Order(tmp_path / "out"), lambda _: Silent())


@pytest.mark.parametrize(
    ("cell", "what"), [("3000.0", "whole number"), ("three", "whole number"), ("", "whole")]
)
def test_a_damaged_log_is_named_with_its_line(tmp_path, cell, what):
    file = training(tmp_path / "mine", 0.8) / "progress.csv"
    file.write_text(file.read_text().replace("\n3000,", f"\n{cell},"))
    with pytest.raises(InputError, match=rf"progress\.csv:4: steps is '{cell}', which is no {what}"):
        read_training(tmp_path / "mine")


def test_a_training_without_a_curve_is_named(tmp_path):
    """No 5,000 decisions and no evaluation: it is not for want of a common step."""
    short = training(tmp_path / "short", 0.8, last=4000)
    with pytest.raises(InputError, match="short has no curve yet: fewer than 5,000 decisions"):
        run(Order(tmp_path / "out", folders=(short,)), lambda _: Silent())
    whole = training(tmp_path / "whole", 0.8)
    report = run(Order(tmp_path / "out", folders=(short, whole)), lambda _: Silent())
    assert "short has no curve yet" in report.notes[0]
    assert "short" not in {m["agent"] for m in read_table(tmp_path / "out" / "curves.csv")}
