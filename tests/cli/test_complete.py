"""What a shell is offered: names of scenarios, agents, columns and metrics."""

import pytest
import typer
from typer.core import TyperCommand

from rudc.cli.complete import complete_agents, complete_columns, complete_metrics, complete_scenarios


@pytest.fixture(autouse=True)
def _files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blocked_mine.yaml").write_text("name: mine\n")
    (tmp_path / "blocked.txt").write_text("")
    (tmp_path / ".hidden").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "episodes.csv").write_text("scenario,agent,traffic.density\n")


def test_scenarios_are_shipped_names_and_files():
    assert complete_scenarios("blocked") == ["blocked_left_turn", "blocked_mine.yaml"]
    assert "out/" in complete_scenarios("")
    assert ".hidden/" not in complete_scenarios("")
    assert complete_scenarios("./bl") == ["./blocked_mine.yaml"]
    assert complete_scenarios("nowhere/") == complete_scenarios("~no-such-user/") == []


def test_agents_are_names_and_folders():
    assert {"gap-acceptance", "gap-acceptance+ttcbf"} <= set(complete_agents("gap"))
    assert complete_agents("ou") == ["out/"]


def test_columns_are_completed_one_after_the_other():
    context = typer.Context(TyperCommand("table"))
    context.params = {"folder": "out"}
    assert complete_columns(context, "prio") == ["priority"]
    assert complete_columns(context, "agent,tr") == ["agent,traffic.density"]
    assert "agent,agent" not in complete_columns(context, "agent,")
    assert complete_metrics("SR,interv") == ["SR,interventions"]


def test_the_shell_gets_them(rudc, monkeypatch):
    for words, offered in (
        ("rudc sweep dense", "dense_left_turn"),
        ("rudc run fog --agent follower+e", "follower+ecbf"),
        ("rudc table out --by agent,out", "agent,outcome"),
        ("rudc agent show gap-acceptance+t", "gap-acceptance+ttcbf"),
    ):
        monkeypatch.setenv("_RUDC_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
        answer = rudc()
        assert offered in answer.out.split()
