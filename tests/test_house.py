"""How the house is kept: what import contracts cannot say."""

import re
from pathlib import Path

import pytest

import rudc
from rudc import arrays

PACKAGE = Path(rudc.__file__).parent
FILES = sorted([*PACKAGE.rglob("*.py"), *Path(__file__).parent.rglob("*.py")])
LONGEST = 400
"""lines of a file at most"""


def test_no_file_is_too_long():
    lengths = {str(file): len(file.read_text(encoding="utf-8").splitlines()) for file in FILES}
    assert len(lengths) > 200
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST} == {}


@pytest.mark.parametrize("name", [name for name in vars(arrays) if name[0].isupper() and name != "NDArray"])
def test_a_type_of_arrays_means_one_thing(name):
    definition = re.compile(rf"^{name}\b.*= ", re.MULTILINE)
    assert [f.name for f in PACKAGE.rglob("*.py") if definition.search(f.read_text(encoding="utf-8"))] == [
        "arrays.py"
    ]


@pytest.mark.parametrize(("trace", "home"), [("os.replace(", "files.py"), ("get_close_matches", "hints.py")])
def test_files_and_hints_are_made_in_one_place(trace, home):
    assert [f.name for f in PACKAGE.rglob("*.py") if trace in f.read_text(encoding="utf-8")] == [home]
