"""Pages of studies: heading, what was driven, its command, the tables, and what their words mean."""

from pathlib import Path

import pytest

from rudc.reporting.report.study import parts
from rudc.studies import (
    cbf_grid,
    curves,
    filter_pairs,
    filter_study,
    filter_variants,
    latency,
    sigma_study,
)
from rudc.studies.base import Order
from rudc.studies.page import command, page

GLOSSARY = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text(encoding="utf-8")
TABLES = [
    filter_study.as_markdown([]),
    filter_pairs.pairs_markdown([]),
    sigma_study.as_markdown([]),
    sigma_study.slack_markdown([]),
    latency.as_markdown([]),
    cbf_grid.as_markdown([]),
    curves.as_markdown([]),
]


def test_a_page_says_what_was_driven_and_how_before_its_tables():
    order = Order(Path("x"), ("rudc-t:sigma=route",), (), 3, 5, resume=True, budget="quick")
    text = page("sigma", order, "Two drove.", ["| a |\n| - |\n| 1 |\n"], {"a": "one", "b": "`two`"})
    assert text == (
        "# Study sigma\n\nTwo drove. The command: `rudc study sigma --agent rudc-t:sigma=route --episodes 3 "
        "--seed 5 --budget quick --out DIR`.\n\n| a |\n| - |\n| 1 |\n\n## Words\n\n- a: one\n- b: `two`\n"
    )
    assert list(parts(text))[-3:] == [
        {"title": "Words"},
        {"text": ["a: one"]},
        {"text": ["b: ", "two", ""]},
    ]


def test_folders_and_trainings_stand_in_the_command():
    order = Order(Path("x"), folders=(Path("my a"),), training_seeds=(0, 2), trainings=Path("made"))
    assert command("curves", order) == ("rudc study curves 'my a' --seeds 0,2 --trainings made --out DIR")


def test_names_in_tables_are_explained_on_their_page():
    variants = {"off", "oracle", *filter_variants.VARIANTS, *filter_variants.ADAPTIVE}
    assert variants | {"level C", "rate C", "points"} <= filter_study.WORDS.keys()
    assert "dominates" in filter_study.OF_PAIRS
    assert {*sigma_study.TASKS, *sigma_study.SHOWN} <= sigma_study.WORDS.keys()
    assert {*latency.PARTS, "HOCBF"} <= latency.WORDS.keys()


@pytest.mark.parametrize("table", TABLES)
def test_every_column_has_a_heading(table):
    assert all(cell.strip() for cell in table.splitlines()[0].strip("|").split("|"))


@pytest.mark.parametrize(
    "word",
    ["dominates", "engaged", "infeasible", "level_route", "rate_route", "rate -0.5", "percentage point",
     "route_or_mismatch", "route_or_monitors", "violation hidden"],
)  # fmt: skip
def test_the_glossary_has_what_studies_print(word):
    words = [line.split("|")[1] for line in GLOSSARY.splitlines() if line.startswith("|")]
    assert any(word in entry for entry in words)
