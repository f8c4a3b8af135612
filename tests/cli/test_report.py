"""`rudc report`, of a sweep and with replays of its worst episodes; live; tables as JSON; quiet."""

import csv
import json

from rudc.reporting.replay.again import Replayed
from rudc.reporting.report import episodes
from tests.reporting.browser import parsed
from tests.reporting.report.made_up import made_up_sweep


def test_a_report_and_replays_of_the_worst(rudc, tmp_path, monkeypatch):
    """Also when the sweep sorts its rows just after they were read."""
    agents = ("-a", "follower", "-a", "follower+ttcbf")
    answer = rudc("sweep", "random_destination", *agents, "-n", 2, "-w", 1, "-o", "swept")
    assert answer.status == 0, answer.err
    answer = rudc("report", "swept")
    assert answer.status == 0, answer.err
    assert answer.err == "swept/report.html written\n"
    assert "4 episodes: 1 scenario × 2 agents × 2 seeds." in (tmp_path / "swept" / "report.html").read_text()
    worst, rows = episodes.worst, tmp_path / "swept" / "episodes.csv"

    def then_others_come_first(known):
        header, *lines = rows.read_text().splitlines(keepends=True)
        rows.write_text("".join([header, *reversed(lines)]))
        return worst(known)

    with monkeypatch.context() as patched:
        patched.setattr(episodes, "worst", then_others_come_first)
        answer = rudc("report", "swept", "--out", "there/page.html", "--replays", 1)
    assert answer.status == 0, answer.err
    assert "came out the same as row" in answer.err
    (page,) = (tmp_path / "there" / "replays").iterdir()
    assert page.name in (tmp_path / "there" / "page.html").read_text()
    (run,) = json.loads(parsed(page.read_text()).data["data"])["runs"]
    assert page.name.startswith(f"random_destination-{run['agent']}-{run['seed']}-")
    assert (
        rudc("sweep", "random_destination", *agents, "-n", 2, "-w", 1, "-o", "swept", "--resume").status == 0
    )


def test_quiet_leaves_in_that_a_replay_came_out_differently(rudc, tmp_path, monkeypatch):
    made_up_sweep(tmp_path / "swept", 16, scenarios=1, agents=2)
    for same, said in ((True, ""), (False, "told\n")):
        done = Replayed({}, "", same, "told")
        monkeypatch.setattr("rudc.reporting.replay.again.replayed", lambda *_, done=done: done)
        monkeypatch.setattr("rudc.reporting.replay.page.save_replay", lambda *_: None)
        assert rudc("report", "swept", "--replays", 1, "--quiet").err == said


def test_what_is_no_folder_of_results_is_refused(rudc, tmp_path):
    answer = rudc("report", ".")
    assert answer.status == 2
    assert "no episodes.csv in" in answer.err
    assert rudc("report", ".", "--out", "page.pdf").status == 2
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_keeps_its_report_fresh(rudc, tmp_path, monkeypatch):
    from rudc.reporting.report import live

    monkeypatch.setattr(live, "EVERY_S", 0.0)
    monkeypatch.setattr(live, "SHARE", 1e9)
    written = []
    save = live.save_report

    def saved(folder, path, *, live):
        save(folder, path, live=live)
        written.append(
            (live, path.read_text().count('id="fresh"'), " of 3 episodes so far" in path.read_text())
        )

    monkeypatch.setattr(live, "save_report", saved)
    answer = rudc(
        "sweep", "random_destination", "-a", "follower", "-n", 3, "-w", 1, "-o", "swept", "--report", "-q"
    )
    assert answer.status == 0, answer.err
    assert answer.err == ""  # quiet
    assert written == [(True, 1, True), (True, 1, True), (True, 1, False), (False, 0, False)]


def test_a_report_that_cannot_be_written_stops_no_sweep(rudc, tmp_path):
    sweep = ("sweep", "random_destination", "-a", "follower", "-n", 1, "-w", 1, "-o", "swept")
    assert rudc(*sweep).status == 0
    (tmp_path / "swept" / "report.html").mkdir()
    answer = rudc(*sweep, "--report", "--resume")
    assert answer.status == 0, answer.err
    assert "warning: no report: cannot write swept/report.html" in answer.err


def test_a_table_as_json_has_the_numbers_of_csv(rudc):
    rudc("sweep", "random_destination", "-a", "follower", "-a", "sumo", "-n", 2, "-w", 1, "-o", "swept")
    table = json.loads(rudc("table", "swept", "--json").out)
    lines = list(csv.DictReader(rudc("table", "swept", "--format", "csv").out.splitlines()))
    assert [[g["scenario"], g["agent"], g["episodes"]] for g in table] == [
        [line["scenario"], line["agent"], int(line["episodes"])] for line in lines
    ]
    for group, line in zip(table, lines, strict=True):
        for name in ("SR", "AES", "min_DTC"):
            cells = [line[f"{name}_{k}"] for k in group[name]]
            theirs = [float(cell) if cell else None for cell in cells]
            assert list(group[name].values()) == theirs
    assert rudc("table", "swept", "--json", "--format", "csv").status == 2


def test_a_folder_that_is_not_there_is_named_and_not_made(rudc, tmp_path):
    answer = rudc("report", "nowhere")
    assert (answer.status, answer.out) == (2, "")
    assert "nowhere is no folder; give that of a sweep, a training or a study" in answer.err
    assert not (tmp_path / "nowhere").exists()
