"""Files of every decision: read as they were written, refused where their columns are others."""

import numpy as np
import pytest

from rudc.errors import StorageError
from rudc.studies.step_files import _named, read_steps, steps_file

ROW = {"agent": "mine", "scenario": "fog", "seed": "4", "error": ""}
COLUMNS = ("time_s", "by the wall's clock")
STEPS = np.array([[0.0, 1.5], [0.1, np.nan], [0.2, 3.0]])


@pytest.fixture
def file(tmp_path):
    path = steps_file(tmp_path, "mine", "fog", 4)
    path.parent.mkdir(parents=True)
    return path


@pytest.mark.parametrize("steps", [STEPS, STEPS[:0]])
@pytest.mark.parametrize("named", [True, False])
def test_read_as_written_also_where_columns_have_no_names_yet(tmp_path, file, steps, named):
    np.save(file, _named(steps, COLUMNS) if named else steps.astype(np.float32))
    ((row, found),) = read_steps(tmp_path, [ROW, {**ROW, "error": "no"}], COLUMNS)
    assert row == ROW
    np.testing.assert_array_equal(found, steps.astype(np.float32))


@pytest.mark.parametrize("columns", [COLUMNS[::-1], ("time_s", "sigma"), COLUMNS[:1], (*COLUMNS, "sigma")])
def test_other_columns_are_refused(tmp_path, file, columns):
    np.save(file, _named(STEPS, COLUMNS))
    with pytest.raises(StorageError, match=r"4\.npy has other columns .* drive anew: give another --out"):
        list(read_steps(tmp_path, [ROW], columns))
    if len(columns) != len(COLUMNS):
        np.save(file, STEPS.astype(np.float32))
        with pytest.raises(StorageError, match="has other columns"):
            list(read_steps(tmp_path, [ROW], columns))


@pytest.mark.parametrize("content", [b"", b"no array"])
def test_what_is_no_array_is_refused(tmp_path, file, content):
    file.write_bytes(content)
    with pytest.raises(StorageError, match=r"4\.npy cannot be read \(.+\); .* give another --out"):
        list(read_steps(tmp_path, [ROW], COLUMNS))
