"""The pages of docs/: their blocks run, in one empty folder a page, in order but for `--import`; links lead
somewhere.
"""

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from rudc.agents.registry import make_agent
from rudc.network import build
from rudc.network.check import check_network
from rudc.scenario import load_scenario
from rudc.studies.base import Report
from rudc.studies.catalogue import STUDIES
from tests.blocks import blocks_of, run_commands, run_python_here, smaller
from tests.world.networks import two_lane_ring

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
WITH_BLOCKS = [page for page in PAGES if blocks_of(page)]


def test_there_are_pages():
    assert len(PAGES) >= 11
    assert {page.stem for page in WITH_BLOCKS} >= {"own_scenario", "own_agent", "own_network", "own_barrier"}


def ordered(order, *_):
    """Instead of a study: its agents are there."""
    for agent in order.agents:
        make_agent(agent)
    return Report("", ())


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: page.stem)
def test_what_a_page_says_works(page, tmp_path, monkeypatch):
    """Studies are ordered only: tests/studies/test_quick.py runs them. Blocks with `--import` come last, in
    one process, and `python FILE` runs in this one.
    """
    for name, study in STUDIES.items():
        monkeypatch.setitem(STUDIES, name, replace(study, run=ordered))
    last = ""
    for block in blocks_of(page):
        if block.file:
            (tmp_path / block.file).parent.mkdir(exist_ok=True)
            (tmp_path / block.file).write_text(smaller(block.text), encoding="utf-8")
        elif block.language == "bash" and "--import" in block.text:
            last += block.text
        elif block.language == "bash":
            run_commands(smaller(block.text), tmp_path)
        elif block.language == "python":
            run_python_here(block.text, tmp_path)
        elif block.language == "yaml":
            (tmp_path / "block.yaml").write_text(block.text, encoding="utf-8")
            load_scenario(tmp_path / "block.yaml")
        else:
            assert block.language == "text", f"{page}: nobody runs {block.language}"
    run_commands(smaller(last), tmp_path)


def test_functions_that_tables_name_are_there():
    """In rows whose first cell is one of our modules, the second names functions: `NAME` (what)."""
    rows = re.findall(
        r"^\| `(rudc\.[\w.]+)` \| (.*?) \|",
        "\n".join(page.read_text(encoding="utf-8") for page in PAGES),
        re.MULTILINE,
    )
    assert len(rows) >= 3
    for module, names in rows:
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(import_module(module), name), f"{module}.{name}"


def test_netconverts_options_are_those_of_network_build():
    said = (DOCS / "tutorials" / "own_network.md").read_text(encoding="utf-8")
    given = (*build.PLAIN_OPTIONS, *build.OSM_OPTIONS, *build.OPTIONS)
    assert [option for option in given if f"{option} " not in said and f"{option}`" not in said] == []


def test_on_the_ring_of_two_lanes_all_lanes_lead_somewhere(tmp_path):
    page = DOCS / "tutorials" / "own_network.md"
    (text,) = (block.text for block in blocks_of(page) if str(block.file).endswith("my_ring.con.xml"))
    without = check_network(two_lane_ring(tmp_path, 2))
    assert sum("leads nowhere" in warning for warning in without.warnings) == 4
    (tmp_path / "ring.con.xml").write_text(text, encoding="utf-8")
    report = check_network(two_lane_ring(tmp_path, 2))
    assert report.warnings == ()
    assert {m.turn: m.lanes for m in report.movements} == {"right": (0, 1), "straight": (1,), "left": (1,)}


def test_every_page_is_in_the_menu():
    menu = yaml.load((DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8"), yaml.BaseLoader)["nav"]
    named = set(re.findall(r"[\w/]+\.md", str(menu)))
    assert {str(page.relative_to(DOCS)) for page in PAGES} <= named
