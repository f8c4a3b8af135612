"""Frames of films take little memory."""

import gc
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from rudc.drawing import picture_file
from rudc.drawing.picture_file import save_film
from rudc.drawing.reel import Reel


def frame(row):
    picture = np.zeros((90, 60, 3), dtype=np.uint8)
    picture[row:, 20:, 1] = 200
    return picture


def _row(picture):
    """Where the green begins."""
    return int(np.argmax(picture[:, -1, 1] > 100))


@pytest.fixture
def reel():
    made = Reel()
    for row in range(50):
        made.append(frame(row))
    return made


def test_frames_come_out_as_they_were_put_in(reel):
    assert len(reel) == 50
    assert np.array_equal(reel[3], frame(3))
    assert np.array_equal(reel[-1], frame(49))
    assert [_row(one) for one in reel[::20]] == [0, 20, 40]
    assert len(list(reel)) == 50
    with pytest.raises(IndexError):
        reel[50]


def test_every_other_frame_is_left(reel):
    reel.thin()
    assert [_row(one) for one in reel[:3]] == [0, 2, 4]
    assert len(reel) == 25


def test_packed_they_are_small(reel):
    assert sum(map(len, reel._packed)) < 0.02 * sum(one.nbytes for one in reel)


@pytest.fixture
def alone():
    """Of all that is in memory, only what the test makes is looked through."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
    gc.freeze()  # as tests find it (conftest.py)


def pictures():
    """How many are in memory."""
    found = [one for one in gc.get_objects() if issubclass(type(one), Image.Image)]
    return sum(one.mode == "RGB" for one in found)


class Counted(Reel):
    """Counts the pictures in memory whenever a frame is asked for."""

    most = 0

    def __getitem__(self, index):
        self.most = max(self.most, pictures())
        return super().__getitem__(index)


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("name", ["film.gif", "film.webp"])
def test_a_film_is_written_without_all_its_pictures_in_memory(reel, tmp_path, name):
    counted = Counted()
    for one in reel:
        counted.append(one)
    save_film(counted, tmp_path / name, 10.0)
    with Image.open(tmp_path / name) as film:
        assert film.n_frames == 50
        film.seek(30)
        assert _row(np.asarray(film.convert("RGB"))) == 30
    assert counted.most < 10


def test_an_mp4_is_told_one_frame_after_the_other_and_stays_at_the_last(reel, tmp_path, monkeypatch):
    told = []

    class Writer:
        def __init__(self, path, **_):
            path.write_bytes(b"film")

        def __enter__(self):
            return SimpleNamespace(append_data=told.append)

        def __exit__(self, *_):
            pass

    monkeypatch.setattr(picture_file, "_imageio", lambda: SimpleNamespace(get_writer=Writer))
    save_film(reel, tmp_path / "film.mp4", 10.0)
    assert (tmp_path / "film.mp4").read_bytes() == b"film"
    assert len(told) == 50 + 15
    assert all(np.array_equal(one, reel[-1]) for one in told[-16:])
