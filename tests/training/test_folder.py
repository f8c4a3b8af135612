"""What a training may go on with."""

import pytest

from rudc.errors import InputError
from rudc.imports import import_first
from rudc.training.config import TrainConfig
from rudc.training.folder import check_folder, keep_inputs, sources_now
from tests.offering import offer


@pytest.mark.parametrize("changed", ["own_of_training.py", "crowd"])
def test_a_training_is_not_resumed_with_other_code(tmp_path, monkeypatch, changed):
    """A file that was imported first, and a package that offers events; where the code was not kept, a
    training that began before goes on.
    """
    monkeypatch.setattr("rudc.imports._asked", {})
    monkeypatch.syspath_prepend(tmp_path)
    file, folder, config = tmp_path / "own_of_training.py", tmp_path / "out", TrainConfig.of("sac", {})
    package = tmp_path / "crowd_of_training.py"
    for one in (file, package):
        one.write_text("MOST = 1\n", encoding="utf-8")
    offer(tmp_path, "[rudc.events]\ncrowd = crowd_of_training\n", name="crowd")
    import_first(str(file))
    folder.mkdir()
    sources = sources_now(config, folder)
    keep_inputs(config, folder, sources)
    check_folder(config, folder, sources, resume=True)
    (file if changed == file.name else package).write_text("MOST = 2\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=rf"not what it was when the training began: {changed}\. To resume it"
    ):
        check_folder(config, folder, sources, resume=True)
    keep_inputs(config, folder, sources)
    with pytest.raises(InputError, match="is not what it was"):
        check_folder(config, folder, sources, resume=True)
    (folder / "code.json").unlink()
    check_folder(config, folder, sources, resume=True)
