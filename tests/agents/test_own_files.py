"""Which data files an agent of one's own reads: what is recorded of them, and when a sweep refuses them."""

import json
import os
import sys

import pytest

from rudc.agents import drivers
from rudc.agents.base import layers
from rudc.agents.guarded import GuardedAgent
from rudc.agents.own_files import digest
from rudc.agents.registry import agent_settings, make_agent
from rudc.errors import AgentError, AgentFailedError, SweepError
from rudc.evaluation.manifest import agent_digest, manifest, resumed
from rudc.evaluation.rerun import agent_changes
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.tasks import SweepPlan, Task
from rudc.scenario import load_scenario

AGENTS = '''
import os
import numpy as np
from pathlib import Path

HERE = Path(__file__).parent

class Slow:
    def reset(self, scene, seed): ...
    def act(self, scene): return -1.0, 0.0

class Beside(Slow):
    def __init__(self, weights="weights.npy"):
        self.weights = np.load(HERE / weights)

class Relative(Slow):
    def __init__(self):
        self.text = Path("elsewhere.txt").read_text()

class Declared(Slow):
    reads = ("sub/weights.safetensors",)

class Paths(Slow):
    reads = [Path("sub/weights.safetensors")]

class Generator(Slow):
    reads = (name for name in ["weights.npy"])

class OneText(Slow):
    reads = "weights.npy"

class Gone(Slow):
    reads = ("gone.bin",)

class Late(Slow):
    def reset(self, scene, seed):
        (HERE / "late.txt").read_text()

class LateDeclared(Late):
    reads = ("late.txt",)

class Others(Slow):
    """What does not count."""
    def __init__(self):
        for name in (".hidden/x", "__pycache__/x.nbi", "lib/site-packages/x.txt", "mine.py"):
            (HERE / name).read_bytes()
        os.listdir(HERE)
        (HERE / "log.txt").write_text("made")
        (HERE / "log.txt").read_text()
        os.close(os.open(HERE, os.O_RDONLY))

class Imports(Slow):
    def __init__(self):
        import net_beside
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with agents and their files; the working folder is another."""
    home, work = tmp_path / "home", tmp_path / "work"
    for name in ("sub", ".hidden", "__pycache__", "lib/site-packages"):
        (home / name).mkdir(parents=True)
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (home / "mine.py").write_text(AGENTS, encoding="utf-8")
    (home / "net_beside.py").write_text(
        "from pathlib import Path\nTEXT = Path(__file__).with_suffix('.txt').read_text()\n", encoding="utf-8"
    )
    for name in (".hidden/x", "__pycache__/x.nbi", "lib/site-packages/x.txt", "sub/weights.safetensors",
                 "late.txt", "net_beside.txt"):  # fmt: skip
        (home / name).write_text(name, encoding="utf-8")
    (work / "elsewhere.txt").write_text("1", encoding="utf-8")
    write_weights(home, 1.0)
    yield home
    sys.modules.pop("net_beside", None)


def write_weights(folder, value):
    import numpy as np

    np.save(folder / "weights.npy", np.full(3, value))


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("Beside", ["weights.npy"]),
        ("Relative", ["elsewhere.txt"]),
        ("Declared", ["sub/weights.safetensors"]),
        ("Paths", ["sub/weights.safetensors"]),
        ("LateDeclared", ["late.txt"]),
        ("Late", []),
        ("Others", []),
        ("Imports", ["net_beside.txt"]),
        ("Slow", []),
    ],
)
def test_which_files_are_recorded(folder, name, files):
    for _ in range(2):
        assert list(agent_settings(f"{folder}/mine.py:{name}+ttcbf").get("reads", {})) == files


def test_what_a_module_reads_as_it_is_imported_counts_whoever_imports_it_first(folder):
    (folder / "also.py").write_text(AGENTS, encoding="utf-8")
    names = [f"{folder}/{file}.py:Imports" for file in ("mine", "also")]
    for name in names:
        make_agent(name)
    assert [list(agent_settings(name)["reads"]) for name in names] == [["net_beside.txt"]] * 2


def test_a_file_of_an_argument_counts_once(folder):
    name = f"{folder}/mine.py:Beside({str(folder / 'weights.npy')!r})"
    assert list(agent_settings(name)["files"]) == ["0"]
    assert "reads" not in agent_settings(name)


def test_a_changed_file_is_refused_by_its_name(folder, tmp_path):
    name = f"{folder}/mine.py:Beside"
    plan = SweepPlan((load_scenario("dense_left_turn"),), (name,), 1, 0)
    before = json.loads(json.dumps(manifest(plan)))
    settings, known = agent_settings(name), agent_digest(name)
    assert settings["reads"] == {"weights.npy": digest(folder / "weights.npy")}
    assert resumed(before, manifest(plan), tmp_path)["configuration"] == before["configuration"]
    write_weights(folder, 2.0)
    with pytest.raises(SweepError, match=r"reads\.weights\.npy: .*\n.*; rows of old and new files would mix"):
        resumed(before, manifest(plan), tmp_path)
    now = agent_settings(name)
    assert agent_changes("mine", settings, now) == [
        "weights.npy, which the agent mine reads, has changed since"
    ]
    assert agent_changes("mine", {**settings, "reads": {}}, now) == [
        "the agent mine reads weights.npy, of which manifest.json says nothing"
    ]
    assert agent_changes("mine", settings, {**now, "reads": {}}) == [
        "the agent mine no longer reads weights.npy"
    ]
    assert agent_changes("mine", {**now, "source": "0"}, now) == [
        "the source of the agent mine has changed since"
    ]
    assert agent_changes("mine", {**now, "outlook": {}}, now) == ["the agent mine has other settings now"]
    record = EpisodeRunner()(Task(plan.scenarios[0], {}, name, 0, known, settings["reads"]))
    assert "is no longer what it was when the sweep began: weights.npy has changed; put it" in record.error


def test_what_another_agent_has_loaded_may_be_kept(folder):
    """Which of the two opens the file depends on the order, and so on the worker."""
    (folder / "shared.py").write_text(
        AGENTS + "LOADED = {}\nclass Keeps(Slow):\n    def __init__(self, speed):\n"
        "        if not LOADED: LOADED.update(weights=np.load(HERE / 'weights.npy'))\n"
    )
    first, second = (f"{folder}/shared.py:Keeps({speed})" for speed in (1, 2))
    recorded = agent_settings(first)["reads"]
    assert "reads" not in agent_settings(second)
    scenario, runner = load_scenario("random_destination", {"episode.timeout": 1}), EpisodeRunner()
    try:
        for name, reads in ((first, {}), (second, recorded)):
            assert runner(Task(scenario, {}, name, 0, agent_digest(name), reads)).error == ""
        write_weights(folder, 2.0)
        runner.close()
        record = runner(Task(scenario, {}, second, 0, agent_digest(second), recorded))
        assert "weights.npy has changed" in record.error
    finally:
        runner.close()


def test_a_file_that_is_opened_later_is_refused_in_a_sweep_only(folder):
    scenario = load_scenario("random_destination", {"episode.timeout": 1})
    runner, late = EpisodeRunner(), f"{folder}/mine.py:Late+ttcbf"
    try:
        assert runner(Task(scenario, {}, late, 0)).error == ""
        runner.close()
        record = runner(Task(scenario, {}, late, 0, agent_digest(late)))
        assert "reset opened late.txt, and a sweep keeps digests only of files" in record.error
        assert "let its class say reads = ('late.txt',)" in record.error
        again = runner(Task(scenario, {}, late, 1, agent_digest(late)))
        assert again.error == record.error, "though a module may keep now what the file says"
        declared = f"{folder}/mine.py:LateDeclared"
        assert runner(Task(scenario, {}, declared, 0, agent_digest(declared))).error == ""
        (guarded,) = [one for one in layers(runner._agents[declared]) if isinstance(one, GuardedAgent)]
        assert guarded._called == {"reset", "act"}  # from then on nothing is watched
    finally:
        runner.close()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("OneText", "as in reads = (\"weights.safetensors\",); it is 'weights.npy'"),
        ("Generator", 'as in reads = ("weights.safetensors",); it is <generator'),
        ("Gone", "`reads` names gone.bin, and there is no such file in "),
    ],
)
def test_wrong_declarations(folder, name, told):
    with pytest.raises(AgentError) as caught:
        make_agent(f"{folder}/mine.py:{name}")
    assert told in str(caught.value)


class Registered:
    def __init__(self):
        with open(os.environ["READ_BY_REGISTERED"], encoding="utf-8") as file:
            self.text = file.read()

    def reset(self, scene, seed): ...

    def act(self, scene):
        return 0.0, 0.0


def test_files_of_a_registered_agent(folder, monkeypatch):
    monkeypatch.setattr(drivers, "_registered", {})
    monkeypatch.setenv("READ_BY_REGISTERED", "elsewhere.txt")
    drivers.register_agent("reading", Registered)
    assert list(agent_settings("reading")["reads"]) == ["elsewhere.txt"]


def test_a_file_that_is_opened_at_the_first_decision_is_refused_too(folder):
    (folder / "lazy.py").write_text(
        AGENTS
        + "class Lazy(Slow):\n    def act(self, scene): return len((HERE / 'late.txt').read_text()), 0.0\n"
    )
    agent = make_agent(f"{folder}/lazy.py:Lazy")
    agent.recorded = frozenset()
    with pytest.raises(AgentFailedError, match=r"act opened late\.txt"):
        agent.act(None)
