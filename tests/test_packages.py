"""Events, algorithms and barriers that installed packages offer by entry points."""

import csv
import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.blocks import answers_apart, run_apart
from tests.offering import offer

EXAMPLES = Path(__file__).parents[1] / "examples"
ALGORITHM = """
from rudc import register_algorithm
from rudc.learning.algorithms import ALGORITHMS

register_algorithm("brought-sac", ALGORITHMS["sac"])
"""
OFFERS = "".join(f"[rudc.{kind}s]\nmine = own_{kind}\n" for kind in ("event", "algorithm", "barrier"))
EVERY_MODULE = """
import importlib, pkgutil, sys, rudc
for module in pkgutil.walk_packages(rudc.__path__, "rudc."):
    if not module.name.endswith(("__main__", "ray_engine")):
        importlib.import_module(module.name)
assert "rudc.training.residual_data" in sys.modules
assert not any(name.startswith("own_") for name in sys.modules)
"""


@pytest.fixture
def installed(tmp_path):
    """A folder with three modules, offered by one package, and a path of Python's with it."""
    site = tmp_path / "site"
    site.mkdir()
    offer(site, OFFERS)
    for kind in ("event", "barrier"):
        text = (EXAMPLES / f"own_{kind}.py").read_text(encoding="utf-8")
        (site / f"own_{kind}.py").write_text(text, encoding="utf-8")
    (site / "own_algorithm.py").write_text(ALGORITHM, encoding="utf-8")

    return SimpleNamespace(site=site, path=os.pathsep.join([str(site), *sys.path]))


def test_events_algorithms_and_barriers_of_a_package_are_as_ours(installed, tmp_path):
    """And nothing is imported before somebody asks what there is."""
    slow = "follower+ttcbf:correction.speed_limit=true,correction.speed_limit_most=3"
    agents = ("-a", "follower+ttcbf", "-a", slow)
    said = run_apart(
        ("rudc", "agent", "list", "--json"),
        ("rudc", "scenario", "keys"),
        ("rudc", "sweep", "random_destination", *agents, "-n", 1, "-w", 2, "-o", "out"),
        folder=tmp_path, before=EVERY_MODULE, PYTHONPATH=installed.path,
    )  # fmt: skip
    listed, end = json.JSONDecoder().raw_decode(said)
    assert "brought-sac" in [entry["name"] for entry in listed]
    event = next(
        line for line in (EXAMPLES / "own_event.py").read_text().splitlines() if "kind: Literal" in line
    )
    assert event.split('"')[1] in said[end:]
    with (tmp_path / "out/episodes.csv").open(newline="") as file:
        speeds = {row["agent"]: float(row["mean_speed_mps"]) for row in csv.DictReader(file)}
    assert speeds[slow] < speeds["follower+ttcbf"]


def test_a_package_that_cannot_be_imported_is_named(installed, tmp_path):
    """By whatever asks for what it has, and by nothing else."""
    orders = {
        "event": ("scenario", "schema"),
        "algorithm": ("train", "sac", "--out", "out"),
        "barrier": ("agent", "show", "follower+ttcbf"),
    }
    for kind in orders:
        (installed.site / f"own_{kind}.py").write_text("import nothing_of_that_name\n", encoding="utf-8")
    helped, *refused = answers_apart(
        ("--help",), *orders.values(), folder=tmp_path, PYTHONPATH=installed.path
    )
    assert (helped.status, helped.err) == (0, "")
    for kind, ended in zip(orders, refused, strict=True):
        assert (ended.status, "Traceback" in ended.err) == (2, False)
        said = " ".join(ended.err.split())
        assert f"package brought: its entry point `mine = own_{kind}` of rudc.{kind}s cannot be" in said
        assert "No module named 'nothing_of_that_name'" in said


def test_lists_go_without_what_cannot_be_imported(installed, tmp_path):
    for kind in ("event", "algorithm"):
        (installed.site / f"own_{kind}.py").write_text("import nothing_of_that_name\n", encoding="utf-8")
    offer(
        installed.site,
        f"{OFFERS}[rudc.agents]\ngone = own_barrier:Gone\nfollower = own_barrier:Mine\n",
        "other",
    )
    orders = (("list",), "sudden_brake"), (("keys", "hard_brake", "--json"), "deceleration")
    agents, *lists, run = answers_apart(
        ("agent", "list", "--json"),
        *(("scenario", *order) for order, _ in orders),
        ("run", "sudden_brake", "--agent", "sumo"),
        folder=tmp_path, PYTHONPATH=installed.path,
    )  # fmt: skip
    assert agents.status == 0, agents.err
    listed = [entry["name"] for entry in json.loads(agents.out)]
    assert {"follower", "rudc-t", "sac"} < set(listed)
    assert not {"gone", "brought-sac"} & set(listed)
    warnings = sorted(agents.err.splitlines())
    assert [w.partition(":")[0] for w in warnings] == ["warning"] * 4
    assert warnings[0].startswith(
        "warning: left out: the installed package brought: its entry point `mine = "
    )
    assert "other: its entry point `gone = own_barrier:Gone` of rudc.agents cannot be imported" in warnings[1]
    assert (
        warnings[3]
        == "warning: the agent 'follower' of the installed package other is not used: it is RUDC's own"
    )
    for (_, there), ended in zip(orders, lists, strict=True):
        assert ended.status == 0, ended.err
        assert there in ended.out
        assert (
            ended.err.count("warning: left out: the installed package ") == len(ended.err.splitlines()) == 2
        )
    assert run.status == 2
