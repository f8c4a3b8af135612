"""What `rudc agent list` says, against the paper's tables and the agents themselves."""

import csv
from pathlib import Path

import rudc.evaluation.paper
from rudc.agents import listing
from rudc.agents.checkpoint import load_learnt, save_learnt, shipped_checkpoints
from rudc.agents.drivers import SHIPPED
from rudc.agents.listing import entries
from rudc.learning.algorithms import ALGORITHMS


def test_every_driver_agent_and_algorithm_is_there_once():
    found = entries()
    names = [entry.name for entry in found]
    assert len(names) == len(set(names))
    assert {*SHIPPED, *shipped_checkpoints(), *ALGORITHMS} <= set(names)
    for entry in found:
        assert entry.text, entry.name
        assert (entry.checkpoint is None) == (entry.status != "shipped")


def test_every_row_of_the_papers_tables_has_an_algorithm():
    path = Path(rudc.evaluation.paper.__file__).with_name("paper.csv")
    rows = {row["agent"] for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())}
    assert rows == {algorithm.paper for algorithm in ALGORITHMS.values()}


def test_what_an_agent_has_otherwise_is_read_off_its_settings(tmp_path, monkeypatch):
    shipped = shipped_checkpoints()
    learnt = load_learnt(shipped["rudc-t"])
    tree = learnt.config.model_dump()
    tree["learner"]["beta"] = 0.5
    save_learnt(tmp_path / "bold", learnt._replace(config=type(learnt.config).model_validate(tree)))
    monkeypatch.setattr(listing, "shipped_checkpoints", lambda: {**shipped, "bold": tmp_path / "bold"})
    found = {entry.name: entry for entry in entries()}
    assert found["bold"].text == "as rudc-t, but: learner.beta=0.5"
    assert found["rudc-t-seed1"].differs == ("training seed 1",)
    assert found["rudc-t"].differs == ()
    assert found["rudc-t"].text == ALGORITHMS["rudc-t"].summary
    assert found["rudc-e"].differs == (ALGORITHMS["rudc-e"].differs,)
    assert "more settings" in found["rudc-t-paper"].text
