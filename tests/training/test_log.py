"""What training writes: going on with files that are there, and none of their rows lost."""

import pytest

from rudc.errors import InputError
from rudc.training.log import EVALUATION, Log, read_log

STATISTICS = ("critic_loss",)


@pytest.fixture
def file(tmp_path):
    """progress.csv of three rows; the third is torn."""
    Log(tmp_path, 0, STATISTICS).close()
    path = tmp_path / "progress.csv"
    (header,) = path.read_text().splitlines()
    rows = [",".join([str(steps), *["1"] * header.count(",")]) for steps in (100, 200, 300)]
    path.write_text("\n".join([header, *rows])[:-3])
    return path


def test_rows_beyond_the_checkpoint_are_taken_out(tmp_path, file):
    Log(tmp_path, 300, STATISTICS).close()
    assert [row["steps"] for row in read_log(file)] == ["100", "200"]
    Log(tmp_path, 100, STATISTICS).close()
    assert [row["steps"] for row in read_log(file)] == ["100"]
    assert (tmp_path / "evaluation.csv").read_text() == ",".join(EVALUATION) + "\n"


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(",", ";"),
        lambda text: text.replace("critic_loss", "loss"),
        lambda text: text.replace(",critic_loss", "").replace(",1\n", "\n"),
        lambda text: text.replace("\n", ",1\n").replace(",1", ",value", 1),
    ],
)
def test_files_with_other_columns_are_refused_and_stay(tmp_path, file, change):
    file.write_text(text := change(file.read_text()))
    with pytest.raises(InputError, match=r"progress\.csv has other columns .* move it elsewhere"):
        Log(tmp_path, 300, STATISTICS)
    assert file.read_text() == text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("\n200,", "\n200.0,"), "3: steps is '200.0', which is no whole number"),
        (lambda text: text.replace("\n200,1,", "\n200,one,"), "3: updates is 'one', which is no number"),
        (lambda text: text.replace("\n200,1", "\n200"), r"3: has \d+ cells"),
    ],
)
def test_damaged_rows_are_named_and_stay(tmp_path, file, change, said):
    file.write_text(text := change(file.read_text()))
    with pytest.raises(InputError, match=rf"progress\.csv:{said}"):
        Log(tmp_path, 300, STATISTICS)
    assert file.read_text() == text
