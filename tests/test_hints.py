"""What a misspelt word probably means, and how to install what is missing."""

import shlex
import subprocess
from pathlib import Path

import pytest

from rudc.hints import did_you_mean, install_command, listed, nearest, there_are

KNOWN = ["density", "speed", "mix"]


@pytest.mark.parametrize(
    ("word", "meant"),
    [("densty", "density"), ("sped", "speed"), ("mxi", "mix"), ("colour", None), ("", None), (3, None)],
)
def test_the_nearest_word_is_offered_if_it_is_near(word, meant):
    assert nearest(word, KNOWN) == meant
    assert did_you_mean(word, KNOWN) == (f" (did you mean {meant!r}?)" if meant else "")


def test_all_words_can_be_listed():
    assert there_are("sped", iter(KNOWN)) == " (did you mean 'speed'?); there are: density, speed, mix"
    assert there_are("zzz", dict.fromkeys(KNOWN)) == "; there are: density, speed, mix"


def test_a_list_that_is_cut_says_so():
    assert listed(KNOWN, 3) == "density, speed, mix"
    assert listed(KNOWN, 2) == "density, speed, ... (3 in all)"


def test_an_install_hint_needs_no_working_folder(monkeypatch, tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert install_command("video").endswith(f'"{Path(__file__).parents[1]}[video]"')


@pytest.mark.parametrize("inside", [True, False])
def test_an_install_hint_is_a_command_that_works_where_it_is_read(inside, monkeypatch, tmp_path):
    root = Path(__file__).parents[1]
    monkeypatch.chdir(root if inside else tmp_path)
    words = shlex.split(install_command("video"))
    assert words[-1] == (".[video]" if inside else f"{root}[video]")
    assert Path(words[words.index("--constraint") + 1]).is_file()
    python = [words[0], "-c", "import rudc"]
    assert subprocess.run(python, check=False, env={"PYTHONPATH": str(root)}).returncode == 0


def test_an_installed_package_is_named_by_its_name(monkeypatch, tmp_path):
    monkeypatch.setattr("rudc.hints.__file__", str(tmp_path / "rudc" / "hints.py"))
    assert install_command("ray").endswith(' -m pip install "rudc[ray]"')
