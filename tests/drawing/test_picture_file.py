import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from rudc.drawing.palette import ACTIVE, ASPHALT, OUTCOMES
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


@pytest.mark.parametrize("outcome", sorted(OUTCOMES))
def test_a_gif_has_the_colours_of_the_outcome_and_of_what_is_seen_for_a_moment(tmp_path, outcome):
    """They turned brown or grey: no frame that the palette was made of had them."""
    shades = np.arange(60 * 90)
    plain = np.stack([150 + shades % 90, 150 + shades // 60, 150 + shades // 90], axis=-1).astype(np.uint8)
    frames = [plain.reshape(60, 90, 3).copy() for _ in range(40)]
    for k, frame in enumerate(frames):
        frame[50:, 2 * k : 2 * k + 2] = 0  # pages that are the same would be one
    badge = 0.92 * np.array(OUTCOMES[outcome][1]) + 0.08 * np.array(ASPHALT)
    frames[-1][10:20, 10:80] = badge
    frames[7][30:33, 30:33] = ACTIVE
    save_film(frames, tmp_path / "film.gif", 10.0)
    with Image.open(tmp_path / "film.gif") as film:
        shown = [np.asarray(page.convert("RGB")).astype(int) for page in ImageSequence.Iterator(film)]
    assert np.abs(shown[-1][10:20, 10:80] - badge).max() < 5
    assert np.abs(shown[7][30:33, 30:33] - np.array(ACTIVE)).max() < 5
    assert np.abs(shown[0] - frames[0]).max(axis=-1).mean() < 8, "the others are still there"


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
