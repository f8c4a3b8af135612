"""The documentation as it is built: offline, every link of it leading somewhere, reference from the code."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from rudc.evaluation.columns import COLUMNS
from rudc.scenario import shipped_scenarios
from rudc.scenario.events import EVENT_KINDS
from tests.reporting.accessibility import MISSING, faults

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Built with `strict`: a link that leads nowhere ends it. From elsewhere: no place depends on that."""
    folder, elsewhere = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("elsewhere")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(folder)]
    command += ["--config-file", str(ROOT / "mkdocs.yml")]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    run = subprocess.run(command, cwd=elsewhere, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout + run.stderr == ""
    return folder


def test_no_page_asks_for_anything_outside(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) >= 18
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert re.findall(r'(?:src|href|srcset)="((?:https?:)?//[^"]*)"', text) == [], page


def test_the_reference_has_what_the_code_has(site):
    said = {name: (site / "reference" / f"{name}.html").read_text() for name in ("metrics", "scenario_files")}
    assert all(f"<code>{name}</code>" in said["metrics"] for name in COLUMNS)
    assert all(f"Event: {kind}" in said["scenario_files"] for kind in EVENT_KINDS)
    shipped = (site / "reference" / "scenarios.html").read_text()
    assert all(f"<code>{name}</code>" in shipped for name in shipped_scenarios())
    for name in shipped_scenarios():
        assert f'src="../figures/scenarios/{name}.webp"' in shipped
        with Image.open(site / "figures" / "scenarios" / f"{name}.webp") as picture:
            assert picture.width >= 400
    commands = (site / "reference" / "commands.html").read_text()
    assert all(
        f'id="rudc-{name}"' in commands for name in ("sweep", "run", "scenario-validate", "network-check")
    )


def test_the_front_page_has_a_picture_that_moves(site):
    assert 'src="figures/blocked_left_turn.webp"' in (site / "index.html").read_text()
    with Image.open(site / "figures" / "blocked_left_turn.webp") as film:
        assert film.n_frames > 50


def test_no_escaped_bar_is_shown(site):
    text = "".join(path.read_text(encoding="utf-8") for path in (site / "reference").glob("*.html"))
    assert "KEY=VALUE|LIST" in text
    assert "\\|" not in text


def test_figures_are_drawn(site):
    method = (site / "method.html").read_text()
    names = re.findall(r'src="(figures/\w+\.svg)"', method)
    assert len(names) == 5
    assert all((site / name).read_text().startswith("<?xml") for name in names)


@pytest.mark.slow
@pytest.mark.skipif(MISSING, reason="no Chromium, which pip cannot install, for axe to run in")
@pytest.mark.parametrize(
    "name",
    [
        "index.html",
        "method.html",
        "tutorials/own_scenario.html",
        "reference/metrics.html",
        "reference/scenarios.html",
    ],
)
def test_no_page_has_a_serious_fault_of_accessibility(site, name):
    page = site / name
    assert faults(page.read_text(encoding="utf-8"), page.parent) == {"light": [], "dark": []}
