"""`rudc search`: what it says, and that what it says can be done."""

import shlex
import sys

import pytest

from rudc.evaluation.store import read_table

BLIND = '''
from rudc.env.tracking import steering


class Blind:
    """Follows its path at the speed it has."""

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return 0.0, steering(scene)
'''
COMMAND = (
    "search",
    "dense_left_turn",
    "-a",
    "blind.py:Blind",
    "--over",
    "traffic.density=[25, 40]",
    "-n",
    8,
    "-w",
    1,
)


@pytest.mark.slow
def test_what_is_found_is_said_and_runs_again(rudc, tmp_path):
    (tmp_path / "blind.py").write_text(BLIND)
    first = rudc(*COMMAND, "-o", "out put")
    rows = read_table(tmp_path / "out put" / "failures.csv")
    assert first.status == 0
    assert f"violations: {len(rows)} of 8 episodes: " in first.out
    assert "violation rate of dense_left_turn as declared: " in first.out
    assert "likeliest where: " in first.out
    assert "over ego.speed, ego.distance, traffic.density" in first.err
    told = next(line for line in first.err.splitlines() if line.startswith("the first again: rudc "))
    again = rudc(*shlex.split(told.partition(": rudc ")[2]))
    assert rows[0]["outcome"] in again.out
    assert rudc(*COMMAND, "-o", "out put", "--resume").out == first.out
    assert "add --resume to go on with the search" in rudc(*COMMAND, "-o", "out put").err


def test_without_cma_the_command_that_installs_it_is_said(rudc, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "cma", None)
    answer = rudc("search", "random_destination", "-a", "follower", "-o", "out")
    assert answer.status == 2
    assert "searching needs cma (the extra `search`): " in answer.err
    assert "pip install" in answer.err
    assert not (tmp_path / "out").exists()
