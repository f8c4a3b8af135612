"""Networks and scenarios by chance: valid, what validation refuses left out, the same for the same number."""

from pathlib import Path

from rudc.evaluation.preflight import validated
from tests.benchmarks.by_chance import EACH, write


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.*"))}


def test_what_is_written_can_be_driven_and_comes_from_the_number_alone(tmp_path: Path):
    made = list(write(tmp_path / "several", range(2)))
    assert len(made) == 2 * EACH
    assert all(path.is_file() is not bool(wrong) for path, wrong in made)
    kept = [path for path, wrong in made if not wrong]
    assert kept
    assert any(wrong for _, wrong in made), "network 0 has a box on its road"
    assert validated(kept[-1])[1] == []
    list(write(tmp_path / "second", range(1, 2)))
    second = contents(tmp_path / "second")
    several = contents(tmp_path / "several")
    assert second == {name: several[name] for name in second}
    assert set(several) - set(second)
