"""`rudc sweep --verify`: what it says, and its exit status."""


def test_rows_that_come_out_the_same_and_rows_that_do_not(rudc, tmp_path):
    sweep = ("sweep", "random_destination", "--agent", "follower", "--episodes", "4", "--workers", "1")
    assert rudc(*sweep, "--set", "episode.timeout=1", "--out", "swept").status == 0
    same = rudc("sweep", "--verify", "swept", "--share", "0.5", "--workers", "1")
    assert same.status == 0
    assert (
        same.out == "2 of 4 episodes of swept run again: every row came out the same (timing columns apart)\n"
    )
    rows = tmp_path / "swept" / "episodes.csv"
    rows.write_text(rows.read_text().replace(",frozen,10,", ",frozen,7,"))
    other = rudc("sweep", "--verify", "swept", "--workers", "1")
    assert other.status == 1
    assert "1 of 4 episodes of swept run again: 1 came out differently" in other.out
    assert "steps: 7 then, 10 now" in other.out
    assert "Nothing that manifest.json names differs here" in other.out
    assert "finished" not in same.err + other.err
    rows.write_text(rows.read_text().rstrip("\n").rpartition("\n")[0] + "\n")
    fewer = rudc("sweep", "--verify", "swept", "--workers", "1")
    assert "warning: swept is not finished: 3 of 4 episodes are there; `rudc sweep --resume" in fewer.err


def test_what_does_not_go_with_it_is_refused(rudc):
    wrong = rudc("sweep", "fog", "--verify", "swept", "--resume")
    assert (wrong.status, "leave out SCENARIO, --resume" in wrong.err) == (2, True)
    ignored = rudc("sweep", "--verify", "swept", "--engine", "ray", "--episodes", "3")
    assert (ignored.status, "leave out --episodes, --engine" in ignored.err) == (2, True)
    alone = rudc("sweep", "fog", "--agent", "sumo", "--out", "x", "--share", "0.2")
    assert (alone.status, "there is no --verify" in alone.err) == (2, True)
    nowhere = rudc("sweep", "--verify", "nowhere")
    assert (nowhere.status, "nowhere is not the folder of a sweep" in nowhere.err) == (2, True)
