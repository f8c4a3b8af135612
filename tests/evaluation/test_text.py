"""Tables as text."""

import math

import pytest

from rudc.evaluation.text import csv_text, interval, interval_of, markdown, rate_decimals


def test_csv():
    rows = [
        {"name": "a, b", "value": 1 / 3, "count": 2, "yes": True},
        {"name": "", "value": math.nan, "count": 0, "yes": False},
    ]
    assert csv_text(rows) == 'name,value,count,yes\n"a, b",0.333333,2,true\n,,0,false\n'


def test_markdown_is_aligned():
    assert markdown(["a", "long"], [["xyz", "1"]]) == "| a   | long |\n| --- | ---: |\n| xyz |    1 |\n"


def test_a_bar_in_a_cell_makes_no_column():
    assert markdown(["a|b"], [["x|y"]]) == "| a\\|b |\n| ---- |\n| x\\|y |\n"


def test_intervals():
    assert interval(1.25, 1.0, 2.0) == "1.2 [1.0, 2.0]"
    assert interval(0.5, math.nan, math.nan, 3) == "0.500"
    assert interval(math.nan, math.nan, math.nan) == "–"


@pytest.mark.parametrize(
    ("rate", "decimals"),
    [(0.0, 1), (0.04, 2), (0.05, 1), (-0.04, 2), (0.003, 3), (1e-14, 1), (99.96, 2), (99.9, 1), (100.0, 1),
     (-99.96, 2), (math.nan, 1)],
)  # fmt: skip
def test_a_rate_looks_like_0_or_100_only_where_it_is(rate, decimals):
    assert rate_decimals(rate) == decimals


def test_a_line_says_its_rates_likewise_but_not_its_means():
    line = {f"{name}{end}": 0.04 for name in ("VR", "VR_change", "AES") for end in ("", "_low", "_high")}
    said = [interval_of(line, name) for name in ("VR", "VR_change", "AES")]
    assert said == ["0.04 [0.04, 0.04]", "0.04 [0.04, 0.04]", "0.0 [0.0, 0.0]"]
