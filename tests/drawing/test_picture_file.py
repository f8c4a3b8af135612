import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rudc.drawing.picture_file import check_film, save_film, save_picture
from rudc.errors import InputError, StorageError

FRAMES = [np.full((40, 60, 3), shade, dtype=np.uint8) for shade in (0, 120, 240)]


def test_pictures_make_their_folder(tmp_path):
    path = save_picture(Image.new("RGB", (30, 20)), tmp_path / "new" / "picture.png")
    with Image.open(path) as picture:
        assert picture.size == (30, 20)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("picture.nonsense", "'.nonsense' is no kind of picture"),
        ("picture.psd", "'.psd' is no kind of picture"),
        ("picture", "'' is no kind of picture"),
        ("file/picture.png", "is a file; give another folder"),
    ],
)
def test_places_where_no_picture_can_be(tmp_path, name, problem):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=re.escape(problem)):
        save_picture(Image.new("RGB", (30, 20)), tmp_path / name)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_leaves_the_old_picture_and_film(tmp_path):
    picture, film = tmp_path / "picture.png", tmp_path / "film.gif"
    save_picture(Image.new("RGB", (30, 20)), picture)
    save_film(FRAMES, film, 10.0)
    before = picture.read_bytes(), film.read_bytes()
    for path in (picture, film):
        path.with_name(f".{path.name}.new").symlink_to("/dev/full")  # where the draft goes
    with pytest.raises(StorageError, match="the disk is full"):
        save_picture(Image.new("RGB", (300, 200)), picture)
    with pytest.raises(StorageError, match="the disk is full"):
        save_film(FRAMES * 2, film, 10.0)
    assert (picture.read_bytes(), film.read_bytes()) == before


@pytest.mark.parametrize("name", ["film.gif", "film.webp"])
def test_a_film_holds_all_frames_and_pauses_at_the_end(tmp_path, name):
    save_film(FRAMES, tmp_path / name, 10.0)
    with Image.open(tmp_path / name) as film:
        assert film.n_frames == 3
        film.seek(2)
        film.load()
        assert film.info["duration"] == 1500


def test_films_of_another_kind_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"a film is a \.gif, \.webp or \.mp4"):
        check_film(tmp_path / "film.avi")


def test_mp4_without_its_extra_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"pip install .*\[video\]"):
        check_film(tmp_path / "film.mp4")


def test_a_film_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; give another folder"):
        save_film(FRAMES, tmp_path / "file" / "film.gif", 10.0)
