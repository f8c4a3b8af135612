"""The report of a training: its logs' numbers, whole and driven in a browser."""

import json
import re
import shutil

import pytest

from rudc.data import data_folder
from rudc.errors import InputError, SweepError
from rudc.evaluation.store import read_table
from rudc.reporting.report.page import report_page
from tests.reporting.accessibility import MISSING, faults
from tests.reporting.browser import CHROMIUM, driven, parsed

FOLDER = data_folder("results/checkpoints") / "rudc-t"


@pytest.fixture(scope="module")
def text():
    return report_page(FOLDER, FOLDER / "report.html")


def test_the_numbers_are_those_of_the_logs(text):
    checker = parsed(text)
    assert [link for link in checker.links if not link.startswith("#")] == []
    data = json.loads(checker.data["data"])
    rows = read_table(FOLDER / "evaluation.csv")
    (curve,) = [
        curve["points"]
        for curve in data["curves"]
        if [curve[k] for k in ("scenario", "priority", "metric")] == ["dense_left_turn", "minor", "SR"]
    ]
    theirs = [r for r in rows if (r["scenario"], r["priority"]) == ("dense_left_turn", "minor")]
    assert curve == [[int(r["steps"]), pytest.approx(100 * float(r["success"]), rel=1e-4)] for r in theirs]
    sigma = next(s for s in data["statistics"] if s["name"] == "sigma_h")
    last = read_table(FOLDER / "progress.csv")[-1]
    assert sigma["points"][-1] == [int(last["steps"]), pytest.approx(float(last["sigma_h"]), rel=1e-4)]
    assert f"rudc-t: {last['steps']} decisions" in text


def test_a_training_that_has_only_begun(tmp_path):
    for name in ("progress.csv", "evaluation.csv"):
        lines = (FOLDER / name).read_text().splitlines(keepends=True)
        (tmp_path / name).write_text("".join(lines[: 3 if name == "progress.csv" else 1]))
    assert "No held-out episodes were driven yet." in report_page(tmp_path, tmp_path / "x.html", live=True)
    (tmp_path / "progress.csv").write_text("steps\n")
    with pytest.raises(SweepError, match="has no row yet"):
        report_page(tmp_path, tmp_path / "x.html")


@pytest.mark.parametrize("content", ["{", "[]", "\xff"])
def test_damaged_settings_are_named(tmp_path, content):
    shutil.copytree(FOLDER, tmp_path / "mine")
    (tmp_path / "mine" / "config.json").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=r"config\.json: "):
        report_page(tmp_path / "mine", tmp_path / "x.html")


def test_a_damaged_log_is_named_with_its_line(tmp_path):
    shutil.copytree(FOLDER, tmp_path / "mine")
    file = tmp_path / "mine" / "progress.csv"
    header, first, *others = file.read_text().splitlines()
    cells = first.split(",")
    for name, cell in (("steps", "3000.0"), ("wall_s", "long"), ("sigma_h", "?")):
        changed = [cell if n == name else c for n, c in zip(header.split(","), cells, strict=True)]
        file.write_text("\n".join([header, ",".join(changed), *others, ""]))
        with pytest.raises(InputError, match=rf"progress\.csv:2: {name} is '{re.escape(cell)}'"):
            report_page(tmp_path / "mine", tmp_path / "x.html")


DRIVE = """
const told = { curves: document.querySelectorAll('#curves .chart').length };
find('arms').value = 'minor'; find('arms').dispatchEvent(new Event('change'));
told.minor = document.querySelectorAll('#curves .curve').length;
told.statistics = document.querySelectorAll('#statistics .chart').length === DATA.statistics.length;
const chart = document.querySelector('#curves .chart');
told.legible = chart.getBoundingClientRect().width > 0.8 * chart.viewBox.baseVal.width;
told.fits = document.documentElement.scrollWidth <= window.innerWidth;
finish(told);
"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
def test_a_browser_opens_the_page(text, tmp_path):
    told = driven(text, DRIVE, tmp_path, 400)
    assert (told["curves"], told["statistics"], told["fits"]) == (4, True, True), told
    assert told["minor"] > 8
    assert told["legible"]  # text is drawn at its own size, or nearly


@pytest.mark.slow
@pytest.mark.skipif(MISSING, reason="no Chromium, which pip cannot install, for axe to run in")
def test_it_has_no_serious_fault_of_accessibility(text, tmp_path):
    assert faults(text, tmp_path, 400) == {"light": [], "dark": []}
