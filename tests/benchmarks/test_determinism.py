"""The small share of the comparison: rows depend on nothing but their inputs."""

from tests.benchmarks import determinism
from tests.benchmarks.determinism import PLAIN, order, rows_of, swept
from tests.blocks import run_here


def test_a_few_rows_come_out_the_same_with_everything_else_changed(tmp_path, monkeypatch, capsys):
    """The plain sweep runs in this process."""

    def here(way, out, *asked):
        if way != PLAIN:
            return swept(way, out, *asked)
        run_here(["rudc", *order(way, out, *asked)], tmp_path)
        return rows_of(out)

    monkeypatch.setattr(determinism, "swept", here)
    for name, value in PLAIN.environment.items():
        monkeypatch.setenv(name, value)
    agents = ("--agent", "rudc-t", "--agent", "gap-acceptance+ttcbf")
    monkeypatch.setattr("sys.argv", ["determinism", "--rows", "10", "--timeout", "3", *agents])
    assert determinism.main() == 0
    assert "everything else: 0 of 10 rows differ" in capsys.readouterr().out
