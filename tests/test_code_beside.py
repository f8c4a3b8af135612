"""Which files a Python file depends on; that a sweep is not resumed, nor said to be the same, with others."""

import json
import os
import pickle
import sys
from pathlib import Path

import pytest

from rudc.agents import drivers
from rudc.agents.registry import agent_settings
from rudc.beside import code_beside
from rudc.errors import InputError, SweepError
from rudc.evaluation.manifest import Manifest, manifest, resumed
from rudc.evaluation.tasks import SweepPlan
from rudc.imports import found_at, import_first, import_source, imported_first, plugins, sources_digests
from rudc.scenario import load_scenario
from tests.offering import offer

AGENT = """
from rudc.agents.base import Decision
from speed_beside import SPEED

class Mine:
    name, ego_driver = "mine", "agent"

    def reset(self, scene, seed): ...

    def act(self, scene): return SPEED, 0.0
"""


@pytest.fixture(autouse=True)
def _nothing_stays(tmp_path, monkeypatch):
    """Modules of the test's folder, and its places in sys.path, would be found by tests of other files."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


def write(folder, **files):
    for name, text in files.items():
        path = folder / f"{name.replace('__', '/')}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def test_imports_are_followed_where_they_lie_beside(tmp_path):
    write(
        tmp_path,
        one="import json\nimport two as t\nfrom kit.three import x\nfrom nowhere import y\n",
        two="def late():\n    import four\n",
        four="import two\n",
        five="",
        kit__three="from . import six\nfrom .seven import z\n",
        kit__six="", kit__seven="", kit__eight="",
    )  # fmt: skip
    (tmp_path / "kit/__init__.py").write_text("")
    beside = {"one.py", "two.py", "four.py", "kit/__init__.py", "kit/three.py", "kit/six.py", "kit/seven.py"}
    assert set(code_beside(tmp_path / "one.py")) == beside
    assert set(code_beside(tmp_path / "kit/three.py")) == {name for name in beside if name.startswith("kit/")}


def test_what_is_named_in_a_string_counts_as_imported(tmp_path):
    """A sweep was resumed after the module of an algorithm's class had changed: rows of both codes mixed."""
    write(
        tmp_path,
        one='from importlib import import_module\nENTRY = {"learner": "two:Mine", "other": "three: no"}\n'
        'def late():\n    return import_module("kit.four"), __import__("five"), import_module(f"{six}")\n'
        'LONG = "' + "x" * 300 + ':B"\n',
        two='CORRECTIONS = {"mine": "seven:Brake"}\n',
        three="", five="", six="", seven="", kit__nine="",
        kit__four='import importlib\nimportlib.import_module(".nine", __package__)\n'
        'importlib.import_module(name="kit.ten")\n',
        kit__ten="",
    )  # fmt: skip
    found = {"one.py", "two.py", "seven.py", "kit/four.py", "kit/nine.py", "kit/ten.py", "five.py"}
    assert set(code_beside(tmp_path / "one.py")) == found


def test_neither_installed_packages_nor_rudc_are_followed(tmp_path):
    site = tmp_path / "site-packages"
    write(site, alone="import other\n", other="", theirs__agent="import other\nimport theirs.part\n")
    write(site, theirs__part="")
    (site / "theirs/__init__.py").write_text("")
    assert set(code_beside(site / "alone.py")) == {"alone.py"}
    assert set(code_beside(site / "theirs/agent.py")) == {
        f"theirs/{name}.py" for name in ("__init__", "agent", "part")
    }
    write(
        tmp_path, mine="import rudc.agents.base\nimport beside\n", beside="", rudc__agents__base="import os\n"
    )
    assert set(code_beside(tmp_path / "mine.py")) == {"mine.py", "beside.py"}


def test_what_lies_above_is_not_followed(tmp_path):
    """Such a file imports it from nowhere: it is run by itself, and so has no package above it."""
    above = "try:\n    from ..common import x\n    from {} import y\nexcept ImportError:\n    x = 3\n"
    write(tmp_path, common="x = 4\n", sub__agent=above.format("." * 99))
    assert set(code_beside(tmp_path / "sub/agent.py")) == {"agent.py"}
    write(tmp_path, kit__agent=above.format("...common"))
    (tmp_path / "kit/__init__.py").write_text("")
    assert set(code_beside(tmp_path / "kit/agent.py")) == {"kit/__init__.py", "kit/agent.py"}


def test_a_changed_module_that_an_agent_imports_is_another_agent(tmp_path):
    write(tmp_path, speed_beside="SPEED = 4.0\n", driver_beside=AGENT)
    plan = SweepPlan((load_scenario("dense_left_turn"),), (f"{tmp_path}/driver_beside.py:Mine",), 1, 0)
    before = json.loads(json.dumps(manifest(plan)))
    assert resumed(before, manifest(plan), tmp_path)["configuration"] == before["configuration"]
    write(tmp_path, speed_beside="SPEED = 9.0\n")
    told = r"holds another sweep; it differs in\n.*speed_beside\.py.*\n.*; rows of old and new code would mix"
    with pytest.raises(SweepError, match=told):
        resumed(before, manifest(plan), tmp_path)
    assert "imports" not in agent_settings("gap-acceptance")


def test_what_import_names_is_in_the_manifest(tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {})
    plan = SweepPlan((load_scenario("dense_left_turn"),), ("sumo",), 1, 0)
    plain = json.loads(json.dumps(manifest(plan)))
    assert "imported" not in plain["configuration"]
    write(tmp_path, strength_beside="MU = 0.3\n", event_beside="import strength_beside\n")
    import_first(str(tmp_path / "event_beside.py"))
    before = json.loads(json.dumps(manifest(plan)))
    assert set(before["configuration"]["imported"]["event_beside.py"]) == {
        "event_beside.py",
        "strength_beside.py",
    }
    write(tmp_path, strength_beside="MU = 0.1\n")
    for there in (before, plain):
        with pytest.raises(SweepError, match=r"imported\.event_beside\.py"):
            resumed(there, manifest(plan), tmp_path)


def test_two_files_of_one_name_are_both_in_the_manifest(tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {})
    write(tmp_path, a__events_beside="A = 1\n", b__events_beside="B = 1\n")
    for folder in "ab":
        import_first(str(tmp_path / folder / "events_beside.py"))
    before = sources_digests()
    write(tmp_path, a__events_beside="A = 2\n")
    assert list(before) == ["events_beside.py", "events_beside.py (2)"]
    assert sources_digests()["events_beside.py"] != before["events_beside.py"]
    assert sources_digests()["events_beside.py (2)"] == before["events_beside.py (2)"]


def test_what_a_file_with_a_dot_in_its_name_defines_can_be_sent_to_workers(tmp_path):
    write(tmp_path, **{"oil.v2": "class Oil:\n    pass\n"})
    oil = import_source(str(tmp_path / "oil.v2.py")).Oil
    assert pickle.loads(pickle.dumps(oil)) is oil


@pytest.mark.parametrize("package", [False, True])
def test_a_helper_of_the_same_name_as_another_is_refused(tmp_path, package):
    """The second file drove with the helper of the first, or with an installed module."""
    for folder, gain in (("old", 1), ("new", 2)):
        write(
            tmp_path,
            **{f"{folder}__agent": "from gains import GAIN\n", f"{folder}__gains": f"GAIN = {gain}\n"},
        )
        if package:
            (tmp_path / folder / "__init__.py").touch()
    assert import_source(str(tmp_path / "old/agent.py")).GAIN == 1
    with pytest.raises(InputError, match=r"new/agent.py: .*'gains' and would get .*old/gains.py, not .*new"):
        import_source(str(tmp_path / "new/agent.py"))


def test_a_file_lies_at_home_or_its_name_begins_with_a_tilde(tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {})
    monkeypatch.setenv("HOME", str(tmp_path))
    write(tmp_path, home_beside="A = 1\n", **{"here__~mine": "A = 1\n"})
    monkeypatch.chdir(tmp_path / "here")
    for source in ("~/home_beside.py", "~mine.py"):
        import_first(source)
    assert imported_first() == (str(tmp_path / "home_beside.py"), str(tmp_path / "here" / "~mine.py"))
    with pytest.raises(InputError, match=r"^~no-such-user/mine\.py: there is no such file"):
        import_first("~no-such-user/mine.py")


@pytest.fixture
def offered(tmp_path, monkeypatch):
    """A folder with an installed package: an event and an algorithm in modules of it."""
    site = tmp_path / "site-packages"
    write(
        site,
        kit__events="from kit import strength\n", kit__strength="MU = 0.3\n", alone="",
        kit__algorithms="LEARNER = 'kit.learner:Mine'\n", kit__learner="", kit__unused="",
    )  # fmt: skip
    (site / "kit/__init__.py").write_text("")
    offer(site, "[rudc.events]\nmine = kit.events\n[rudc.algorithms]\nmine = kit.algorithms\nalone = alone\n")
    monkeypatch.syspath_prepend(site)
    drivers._installed.cache_clear()
    yield site
    drivers._installed.cache_clear()


def test_plug_ins_are_told_by_version_and_code_and_not_imported(offered):
    found = plugins()["brought"]
    code = {f"kit/{name}.py" for name in ("__init__", "events", "strength", "algorithms", "learner")}
    assert set(found) == {"version", "alone.py", *code}
    assert found["version"] == "1.0"
    assert not {"kit", "kit.events"} & set(sys.modules)
    (offered / "kit/events.py").unlink()
    assert plugins()["brought"]["kit.events"] == "not found"


def test_a_sweep_is_not_resumed_with_another_version_of_a_plug_in(offered, tmp_path):
    plan = SweepPlan((load_scenario("dense_left_turn"),), ("sumo",), 1, 0)
    before = json.loads(json.dumps(manifest(plan)))
    Manifest.model_validate(before, strict=True)
    assert resumed(before, manifest(plan), tmp_path)["configuration"] == before["configuration"]
    write(offered, kit__strength="MU = 0.1\n")
    with pytest.raises(SweepError, match=r"differs in\n  plugins\.brought\.kit/strength\.py: "):
        resumed(before, manifest(plan), tmp_path)
    without = {k: v for k, v in before["configuration"].items() if k != "plugins"}
    with pytest.raises(SweepError, match=r"differs in\n  plugins: brought only here\n\w"):
        resumed({**before, "configuration": without}, manifest(plan), tmp_path)


def test_an_agent_of_a_package_is_another_when_what_it_imports_is(offered):
    write(offered, kit__driver=AGENT.replace("speed_beside", "kit.speed"), kit__speed="SPEED = 4.0\n")
    entries = (offered / "brought-1.0.dist-info/entry_points.txt").read_text()
    (offered / "brought-1.0.dist-info/entry_points.txt").write_text(
        f"{entries}[rudc.agents]\nslow = kit.driver:Mine\n"
    )
    before = agent_settings("slow")
    write(offered, kit__speed="SPEED = 9.0\n")
    assert agent_settings("slow")["imports"]["kit/speed.py"] != before["imports"]["kit/speed.py"]


def test_what_a_module_prints_while_a_part_of_it_is_looked_up_is_no_result(tmp_path, monkeypatch, capsys):
    write(tmp_path, loud_beside="print('imported')\nANSWER = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert found_at("loud_beside:ANSWER") == 42
    assert capsys.readouterr() == ("", "imported\n")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, names of files are text")
def test_a_file_whose_path_is_no_text_can_be_imported(tmp_path):
    folder = Path(os.fsdecode(os.fsencode(tmp_path / "own") + b"\xff"))
    folder.mkdir()
    (folder / "mine.py").write_text("ANSWER = 42\n")
    assert import_source(str(folder / "mine.py")).ANSWER == 42
