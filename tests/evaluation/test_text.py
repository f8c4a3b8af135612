"""Tables as text."""

import math

from rudc.evaluation.text import csv_text, interval, markdown


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
