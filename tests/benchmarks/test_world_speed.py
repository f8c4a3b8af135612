"""The environment's benchmark checks what it plays back; here that check runs."""

from tests.benchmarks.world_speed import against_sumo


def test_what_is_played_back_is_the_same_traffic(capsys):
    assert against_sumo("paper", 1) > 0.0
    assert "SUMO alone, the very same traffic: " in capsys.readouterr().out
