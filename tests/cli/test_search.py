"""`rudc search`: what it says, and that what it says can be done."""

import math
import shlex
import sys

import pytest

from rudc.cli import search
from rudc.evaluation.search.rate import Rate
from rudc.evaluation.search.region import Region
from rudc.evaluation.search.search import Findings
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
    every = read_table(tmp_path / "out put" / "evaluations.csv")
    violations = {row["seed"] for row in rows}
    rate = sum(float(row["weight"]) for row in every if row["seed"] in violations) / len(every)
    assert f"as declared: {100 * rate:.3g} % [" in first.out, "anybody can reckon it again"
    assert f"reckoned from evaluations.csv, from seed {every[0]['seed']} on: the sum of" in first.out
    assert "likeliest where: " in first.out
    assert "over ego.speed, ego.distance, traffic.density" in first.err
    told = next(line for line in first.err.splitlines() if line.startswith("the first again: rudc "))
    again = rudc(*shlex.split(told.partition(": rudc ")[2]))
    assert rows[0]["outcome"] in again.out
    assert rudc(*COMMAND, "-o", "out put", "--resume").out == first.out
    assert "add --resume to go on with the search" in rudc(*COMMAND, "-o", "out put").err


def told(capsys, tmp_path, rate, region=None):
    search._tell(Findings(9, (4,) if region else (), {}, (), rate, 3, region), tmp_path, "mine", "follower")
    return capsys.readouterr().out


def test_a_rate_that_nothing_counts_for_is_not_given_as_a_number(capsys, tmp_path):
    out = told(capsys, tmp_path, Rate(*[math.nan] * 4))
    assert "violation rate of mine as declared: cannot be told yet, as no episode" in out
    assert "nan" not in out


@pytest.mark.parametrize(
    ("violations", "of", "said"),
    [
        (10, 11, "10 of the 11 violations lie there; of the 12 episodes there, 10 violate"),
        (11, 11, "all 11 violations lie there; of the 12 episodes there, 11 violate"),
        (1, 1, "the only violation lies there; of the 12 episodes there, 1 violate"),
    ],
)
def test_how_many_violations_lie_where_they_are_likeliest(capsys, tmp_path, violations, of, said):
    region = Region({"ego.speed": (9.0, math.inf)}, violations, 12, of)
    assert f"likeliest where: ego.speed >= 9\n  {said}\n" in told(
        capsys, tmp_path, Rate(0.1, 0.05, 0.2, 0.2), region
    )


def test_files_that_were_imported_first_are_in_the_command_for_the_first_again(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {"/my files/oil.py": None, "mine.events": None})
    findings = Findings(9, (4,), {}, (), Rate(0.1, 0.05, 0.2, 0.2), 0, Region({}, 1, 9, 1))
    search._tell(findings, tmp_path, "mine", "follower")
    command = shlex.split(capsys.readouterr().err.partition("the first again: ")[2].partition("\n")[0])
    assert command[:6] == ["rudc", "--import", "/my files/oil.py", "--import", "mine.events", "run"]


def test_without_cma_the_command_that_installs_it_is_said(rudc, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "cma", None)
    answer = rudc("search", "random_destination", "-a", "follower", "-o", "out")
    assert answer.status == 2
    assert "searching needs cma (the extra `search`): " in answer.err
    assert "pip install" in answer.err
    assert not (tmp_path / "out").exists()
