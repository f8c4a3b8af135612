"""`rudc study`; each study is driven in tests/studies/test_quick.py."""

import pytest

from rudc.agents.checkpoint import find_checkpoint
from rudc.studies.catalogue import STUDIES


def test_list(rudc):
    status, out, _ = rudc("study", "list")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == ["study", *STUDIES]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["filtr", "-o", "x"], "did you mean 'filter'?"),
        (["filter", "-a", "gap-acceptance+ttcbf"], "--out DIR"),
        (["filter", "-a", "gap-acceptance", "-o", "x"], "no safety filter"),
        (["filter", "here", "-o", "x"], "takes no folders of trainings; it takes --agent, --episodes,"),
        (["sigma", "-a", "sumo", "-o", "x"], "states no uncertainty"),
        (["filter", "--seeds", "1", "-o", "x"], "takes no --seeds"),
        (["filter", "--seeds", "1;2", "-o", "x"], "such as 0,1,2"),
        (["comparison", "--seeds", " ", "-o", "x"], "such as 0,1,2"),
        (["filter", "--seeds", "9" * 5000, "-o", "x"], "such as 0,1,2"),
        (["sigma", "--budget", "paper", "-o", "x"], "no budget 'paper'"),
        (["comparison", "-a", "sak", "-o", "x"], "has no row 'sak'"),
        (["ablation", "--trainings", "nowhere", "-o", "x"], "no folder nowhere"),
        (
            ["comparison", "-a", "usl", "--seeds", "7", "--trainings", ".", "-o", "x"],
            "no agent to drive in .: usl-seed7: no training there",
        ),
        (["curves", "-o", "x"], "which trainings?"),
        (["curves", "here", "-a", "sumo", "-o", "x"], "takes no --agent; it takes folders"),
        (["curves", "here", "--seed", "3", "-o", "x"], "takes no --seed"),
        (["curves", "here", "--resume", "-o", "x"], "takes no --resume"),
        (["curves", "here", "--budget", "quick", "-o", "x"], "takes no --budget"),
        (["curves", "here", "-w", "1", "-o", "x"], "takes no --workers"),
        (["latency", "-w", "1", "-o", "x"], "takes no --workers"),
        (["residual", "-w", "1", "-o", "x"], "takes no --workers; it takes --seed, --resume, --budget"),
    ],
)
def test_wrong_input_is_one_message(rudc, arguments, said, tmp_path):
    status, out, err = rudc("study", *arguments)
    assert status == 2
    assert said in err
    assert "Traceback" not in err
    assert not out
    assert not (tmp_path / "x").exists()


def test_curves(rudc, tmp_path):
    status, out, err = rudc("study", "curves", find_checkpoint("rudc-wo-cbf"), "--out", "out")
    assert status == 0
    assert "dense_left_turn" in out
    assert err == "in out: curves.csv, curves.md, curves.png\n"
    assert (tmp_path / "out" / "curves.md").read_text() == out
