"""The report of a study: its own tables and figures, sorted and chosen from."""

import json
import re
from pathlib import Path

import pytest

from rudc.reporting.report.page import report_page
from rudc.reporting.report.study import is_study, parts, study_content
from tests.reporting.accessibility import MISSING, faults
from tests.reporting.browser import CHROMIUM, driven, parsed

RESULTS = Path(__file__).parents[3] / "results"
STUDIES = ["sigma", "curves", "filter"]


def test_a_text_is_tables_and_paragraphs():
    text = "# Claims\n\n| a | b (%) |\n| - | --: |\n| x\\|y | **1.5 [1, 2]** |\n\nIt `is`\nheld.\n"
    code = "\n```\n# more, less   than each\n\n| `first`\n```\n"
    table = {"head": ["a", "b (%)"], "rows": [["x|y", "1.5 [1, 2]"]], "right": [False, True]}
    said = [{"title": "Claims"}, table, {"text": ["It ", "is", " held."]}]
    assert list(parts(text)) == said
    assert list(parts(text + code + text)) == [
        *said,
        {"code": "# more, less   than each\n\n| `first`"},
        *said,
    ]


def test_what_is_no_study():
    assert not is_study(RESULTS / "ood")
    assert not is_study(RESULTS)


@pytest.mark.parametrize("name", STUDIES)
def test_a_page_has_every_row_and_refers_to_nothing_outside(name, tmp_path):
    text = report_page(RESULTS / name, tmp_path / "report.html")
    checker = parsed(text)
    assert all(link.startswith("data:image/png") for link in checker.links)
    assert len(checker.links) == 1
    lines = (RESULTS / name / f"{name}.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("|") and not line.startswith("| -")]
    assert text.count("<tr>") == len(rows)
    assert len(text) < 5_000_000


def test_commands_are_those_of_the_sweeps_below_and_can_be_pasted(tmp_path):
    study, said = tmp_path / "my study", (RESULTS / "ood" / "manifest.json").read_text(encoding="utf-8")
    for name, text in (("broken", "{"), ("fine", said), ("not_a_sweep", "{}")):
        (study / name).mkdir(parents=True)
        (study / name / "manifest.json").write_text(text, encoding="utf-8")
    content = study_content(study)
    assert content["commands"] == [f"rudc report '{study}/fine'"]
    assert content["versions"] == json.loads(said)["versions"]


DRIVE = """
const input = document.querySelector('input[type=search]'), table = find(input.dataset.table);
const shown = () => [...table.tBodies[0].rows].filter((row) => !row.hidden);
const told = { all: shown().length };
input.value = 'paper random'; input.dispatchEvent(new Event('input'));
told.chosen = shown().length;
input.value = ''; input.dispatchEvent(new Event('input'));
const column = [...table.tHead.rows[0].cells].findIndex((cell) => cell.textContent.startsWith('SR'));
const button = table.tHead.rows[0].cells[column].querySelector('button');
button.click(); told.least = shown()[0].cells[column].textContent;
button.click(); told.most = parseFloat(shown()[0].cells[column].textContent);
told.fits = document.documentElement.scrollWidth <= window.innerWidth;
finish(told);
"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
def test_tables_are_sorted_and_chosen_from(tmp_path):
    text = report_page(RESULTS / "curves", tmp_path / "report.html")
    told = driven(text, DRIVE, tmp_path, 400)
    cells = re.findall(r"^\| \S+ +\| random_destination", (RESULTS / "curves/curves.md").read_text(), re.M)
    assert told["chosen"] == sum("paper" in cell for cell in cells)
    assert (told["most"], told["fits"]) == (100.0, True)
    assert float(told["least"].split()[0]) < 40.0


@pytest.mark.slow
@pytest.mark.skipif(MISSING, reason="no Chromium, which pip cannot install, for axe to run in")
def test_it_has_no_serious_fault_of_accessibility(tmp_path):
    text = report_page(RESULTS / "comparison", tmp_path / "report.html")
    assert faults(text, tmp_path, 400) == {"light": [], "dark": []}
