"""Rows of two different inputs never mix: what is replaced while a sweep runs is refused, or not read."""

import os
import shutil
import time
from functools import partial
from pathlib import Path

import pytest

from rudc.agents.checkpoint import shipped_checkpoints
from rudc.errors import SimulationError, SweepError
from rudc.evaluation import manifest
from rudc.evaluation.folder import SweepFolder
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.search.folder import SearchFolder, SearchPlan
from rudc.evaluation.search.space import space_of
from rudc.evaluation.sweep import ENGINES, Engine, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.network.network import shipped_networks
from rudc.scenario import load_scenario


class AfterTheFirst:
    """Progress that does something when the first episode has ended."""

    def __init__(self, deed):
        self._deed = deed

    def begin(self, total, finished, warnings):
        pass

    def advance(self, task, record):
        deed, self._deed = self._deed, None
        if deed is not None:
            deed()


class Forgetful(EpisodeRunner):
    """A new worker for each episode, as after a crash: it makes agent and world anew."""

    def __call__(self, task):
        self.close()
        return super().__call__(task)


@pytest.fixture
def plan(tmp_path):
    """Two short episodes on a network of one's own."""
    network = tmp_path / "own.net.xml"
    shutil.copy(shipped_networks()["four_way"], network)
    file = tmp_path / "own.yaml"
    file.write_text(
        "name: own\nextends: random_destination\nnetwork: own.net.xml\ntraffic: {density: 5}\n"
        "episode: {timeout: 1}\n"
    )
    return lambda agent: SweepPlan((load_scenario(file),), (agent,), 3, 0)


@pytest.fixture
def here(monkeypatch):
    """The engine in this process: what a worker does, without one."""

    def engine(tasks, workers, limit_s, make_runner):
        for task in tasks:
            yield task, make_runner()(task)

    monkeypatch.setitem(ENGINES, "local", Engine(engine))


def search_folder(path, plan):
    (scenario,), (agent,) = plan.scenarios, plan.agents
    return SearchFolder(path, SearchPlan(scenario, agent, 3, 0, space_of(scenario, {})))


@pytest.mark.parametrize("folder", [SweepFolder, search_folder])
@pytest.mark.parametrize("writes", [0, 1, 2])
def test_a_folder_that_a_kill_leaves_half_made_is_gone_on_with(folder, writes, plan, tmp_path, monkeypatch):
    real, left = os.replace, [None] * writes

    def killed(draft, path):
        if not left:
            raise KeyboardInterrupt
        left.pop()
        real(draft, path)

    with monkeypatch.context() as patch:
        patch.setattr("os.replace", killed)
        with pytest.raises(KeyboardInterrupt), folder(tmp_path / "out", plan("follower")) as made:
            made.open(resume=False)
    with folder(tmp_path / "out", plan("follower")) as made:
        made.open(resume=True)
    assert len(list((tmp_path / "out" / "networks").rglob("own.net.xml"))) == 1


def test_a_network_that_is_replaced_changes_no_row(plan, tmp_path, here):
    network = tmp_path / "own.net.xml"
    run_sweep(plan("follower"), tmp_path / "calm", Forgetful)
    deed = partial(network.write_text, "<net/>")
    told = plan("follower")
    result = run_sweep(told, tmp_path / "replaced", Forgetful, progress=AfterTheFirst(deed))
    assert not result.errors
    assert len(list((tmp_path / "replaced" / "networks").rglob("own.net.xml"))) == 1


def test_swept_networks_are_driven_on_the_copies_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.net.xml", "b.net.xml"):
        shutil.copy(shipped_networks()["t_junction"], name)
    named = ["a.net.xml", f"{tmp_path}//b.net.xml"]
    scenario = load_scenario("random_destination", grid={"network": named})
    with SweepFolder(tmp_path / "out", SweepPlan((scenario,), ("follower",), 1, 0)) as folder:
        folder.open(resume=False)
    driven = [Path(task.scenario.network) for task in folder.tasks]
    assert [path.name for path in driven] == ["a.net.xml", "b.net.xml"]
    assert all(path.is_relative_to(tmp_path / "out" / "networks") for path in driven)
    assert [task.swept["network"] for task in folder.tasks] == named  # what the rows say


def test_an_agent_that_is_replaced_is_refused(plan, tmp_path, here):
    folder = tmp_path / "agent"
    shipped = shipped_checkpoints()
    shutil.copytree(shipped["rudc-wo-cbf"], folder)
    deed = partial(shutil.copytree, shipped["rudc-t"], folder, dirs_exist_ok=True)
    result = run_sweep(plan(str(folder)), tmp_path / "out", Forgetful, progress=AfterTheFirst(deed))
    first, *others = [row["error"] for row in result.rows]
    assert first == ""
    assert all("is no longer what it was when the sweep began" in error for error in others)


def test_code_that_is_edited_is_refused(plan, tmp_path, here, monkeypatch):
    def edited():
        monkeypatch.setattr("rudc.evaluation.sweep.code_digest", lambda: "another")

    with pytest.raises(SweepError, match="code was changed since the sweep began"):
        run_sweep(plan("follower"), tmp_path / "out", Forgetful, progress=AfterTheFirst(edited))


def test_workers_with_other_code_cannot_start(plan, tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.evaluation.sweep.code_digest", lambda: "another")  # in this process only
    with pytest.raises(SimulationError, match="code was changed since the sweep began"):
        run_sweep(plan("follower"), tmp_path / "out", EpisodeRunner)


def test_the_codes_digest_follows_its_content(tmp_path, monkeypatch):
    package = tmp_path / "rudc"
    package.mkdir()
    (package / "__init__.py").write_text("")
    monkeypatch.setattr("rudc.__file__", str(package / "__init__.py"))
    before = manifest.code_digest()
    (package / "new.py").write_text("x = 1\n")
    once = manifest.code_digest()
    (package / "new.py").write_text("x = 2\n")
    assert len({before, once, manifest.code_digest()}) == 3


def test_code_that_lies_still_is_read_once(tmp_path, monkeypatch):
    """Until it is written, be it with as many letters and at the same time by its file's own telling."""
    file = tmp_path / "__init__.py"
    file.write_text("x = 1\n")
    monkeypatch.setattr("rudc.__file__", str(file))
    monkeypatch.setattr("rudc.evaluation.code.SETTLED_NS", 0)
    time.sleep(0.05)  # its times are no finer than the clock of the files
    before, reads, read = manifest.code_digest(), [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: (reads.append(path), read(path))[1])
    assert (manifest.code_digest(), reads) == (before, [])
    told = file.stat()
    file.write_text("x = 2\n")
    os.utime(file, ns=(told.st_atime_ns, told.st_mtime_ns))
    assert manifest.code_digest() != before
    assert file in reads


def test_networks_in_a_folder_that_is_a_link_count(tmp_path, monkeypatch):
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/mine.net.xml").write_text("<net/>")
    (tmp_path / "networks").mkdir()
    monkeypatch.setattr("rudc.__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr("rudc.evaluation.code.data_folder", lambda _: tmp_path / "networks")
    before = manifest.code_digest()
    (tmp_path / "networks/mine").symlink_to(tmp_path / "mine")
    linked = manifest.code_digest()
    (tmp_path / "mine/mine.net.xml").write_text("<net></net>")
    assert len({before, linked, manifest.code_digest()}) == 3


def test_what_an_editor_keeps_beside_the_code_is_no_code(tmp_path, monkeypatch):
    (tmp_path / "__init__.py").write_text("")
    monkeypatch.setattr("rudc.__file__", str(tmp_path / "__init__.py"))
    before = manifest.code_digest()
    (tmp_path / ".#new.py").symlink_to("user@host.1")
    (tmp_path / "gone.py").symlink_to("user@host.1")
    (tmp_path / ".new.py").write_text("x = 1\n")
    assert manifest.code_digest() == before
