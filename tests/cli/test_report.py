"""`rudc report`, of a sweep and with replays of its worst episodes."""


def test_a_report_and_replays_of_the_worst(rudc, tmp_path):
    agents = ("-a", "follower", "-a", "follower+ttcbf")
    answer = rudc("sweep", "random_destination", *agents, "-n", 2, "-w", 1, "-o", "swept")
    assert answer.status == 0, answer.err
    answer = rudc("report", "swept")
    assert answer.status == 0, answer.err
    assert answer.err == "swept/report.html written\n"
    assert "4 episodes: 1 scenario × 2 agents × 2 seeds." in (tmp_path / "swept" / "report.html").read_text()
    answer = rudc("report", "swept", "--out", "there/page.html", "--replays", 1)
    assert answer.status == 0, answer.err
    assert "came out the same as row" in answer.err
    (page,) = (tmp_path / "there" / "replays").iterdir()
    assert page.name in (tmp_path / "there" / "page.html").read_text()
    assert (
        rudc("sweep", "random_destination", *agents, "-n", 2, "-w", 1, "-o", "swept", "--resume").status == 0
    )


def test_what_is_no_folder_of_results_is_refused(rudc, tmp_path):
    answer = rudc("report", ".")
    assert answer.status == 2
    assert "no episodes.csv in" in answer.err
    assert rudc("report", ".", "--out", "page.pdf").status == 2
    assert list(tmp_path.iterdir()) == []
