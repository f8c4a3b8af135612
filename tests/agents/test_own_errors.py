"""What is said of agents of one's own that are wrong: what is meant, and where."""

import re
import sys
from pathlib import Path

import pytest

from rudc.agents.registry import make_agent
from rudc.errors import AgentError, AgentFailedError, InputError
from rudc.tracebacks import own_traceback

SOURCE = """
import json
import torch
from helping import helped

class Base:
    def reset(self, scene, seed): ...
    def act(self, scene): return 0.0, 0.0

class Grad(Base):
    def act(self, scene): return torch.ones(2, requires_grad=True)

class GradInTuple(Base):
    def __init__(self): self.weight = torch.ones((), requires_grad=True)
    def act(self, scene): return 2.0 * self.weight, 0.0

class Plain(Base):
    def act(self, scene): return torch.ones(3)

class InTorch(Base):
    def act(self, scene):
        return torch.nn.Linear(3, 4)(torch.zeros(1, 7))

class InHelper(Base):
    def act(self, scene): return helped("{")

class InRudc(Base):
    def act(self, scene):
        from rudc.env.tracking import steering
        return 0.0, steering(None)

class ResetOne(Base):
    def reset(self, scene): ...

class ActThree(Base):
    def act(self, scene, seed, more): ...

class NoWeights(Base):
    def __init__(self, path): self.text = open(path).read()

class Forgets(Base):
    def reset(self, scene, seed): self.speed = 3.0
    def act(self, scene): return self.speed, 0.0

class AnyArguments(Base):
    reset = act = lambda *given, **more: (0.0, 0.0)
"""


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Makes an agent of `SOURCE` by the name of its class."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "wrong.py").write_text(SOURCE, encoding="utf-8")
    (tmp_path / "helping.py").write_text("import json\n\ndef helped(text):\n    return json.loads(text)\n")
    yield lambda name: make_agent(f"{tmp_path}/wrong.py:{name}")
    sys.modules.pop("helping", None)


def failing(agent, scene):
    with pytest.raises(AgentFailedError) as caught:
        agent.act(scene)
    return caught.value


@pytest.mark.parametrize(("name", "detach"), [("Grad", True), ("GradInTuple", True), ("Plain", False)])
def test_a_tensor_that_requires_grad_is_to_be_detached(made, scene_on, name, detach):
    told = str(failing(made(name), scene_on("south", "straight", 60.0, 7.0)))
    assert "where two finite numbers were expected" in told
    assert ("call .detach() on it" in told) == detach


@pytest.mark.parametrize(
    ("name", "place", "innermost"),
    [("InTorch", "wrong.py:22", "linear.py"), ("InHelper", "helping.py:4", "decoder.py"),
     ("InRudc", "wrong.py:30", "tracking.py")],
)  # fmt: skip
def test_the_place_of_an_error_lies_in_the_users_files(made, scene_on, name, place, innermost):
    agent, scene = made(name), scene_on("south", "straight", 60.0, 7.0)
    agent.reset(scene, 0)
    error = failing(agent, scene)
    assert str(error).endswith(f"({place})")
    told = own_traceback(error.__cause__)
    assert re.match(r'Traceback .*:\n  File ".*wrong\.py", line \d+, in act\n', told)
    assert innermost in told


def test_an_error_of_which_no_other_code_is_part_has_no_such_traceback():
    with pytest.raises(AgentError) as caught:
        make_agent("no_such_agent")
    assert own_traceback(AgentError("never raised")) == ""
    assert "test_own_errors.py" in own_traceback(caught.value)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("ResetOne", "its reset takes (scene), and is called as reset(scene, seed)"),
        ("ActThree", "its act takes (scene, seed, more), and is called as act(scene)"),
    ],
)
def test_a_method_that_cannot_be_called_is_refused_as_the_agent_is_made(made, name, told):
    with pytest.raises(AgentError, match=re.escape(told)):
        made(name)


def test_a_method_that_takes_anything_is_taken(made, scene_on):
    agent, scene = made("AnyArguments"), scene_on("south", "straight", 60.0, 7.0)
    agent.reset(scene, 0)
    assert agent.act(scene).u.tolist() == [0.0, 0.0]


def test_where_a_file_is_looked_for_is_said(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(AgentError) as caught:
        made("NoWeights('sub/weights.pt')")
    assert str(caught.value).endswith(
        f"(wrong.py:39); that path is relative to the working folder, {tmp_path}; a file beside the agent's "
        "own is Path(__file__).with_name('weights.pt')"
    )
    with pytest.raises(AgentError, match=r"weights\.pt' \(wrong\.py:39\)$"):
        made(f"NoWeights('{tmp_path}/weights.pt')")


def test_an_agent_itself_is_no_name(made):
    for given in (made("Plain"), Path("mine.py"), None):
        with pytest.raises(
            AgentError, match=r'give one of your own a name, rudc\.register_agent\("mine", Class\)'
        ):
            make_agent(given)


def test_an_agent_that_was_never_reset(made, scene_on):
    scene = scene_on("south", "straight", 60.0, 7.0)
    agent = made("Forgets")
    assert str(failing(agent, scene)).endswith("; reset(scene, seed) was never called before")
    agent.reset(scene, 0)
    assert agent.act(scene).u[0] == 3.0
    for name in ("planner", "rudc-t"):
        with pytest.raises(
            InputError, match=rf"agent {name}: call reset\(scene, seed\) before its first act"
        ):
            make_agent(name).act(scene)


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kit_of_errors/inner").mkdir(parents=True)
    for name in ("__init__", "inner/__init__", "speeds"):
        (tmp_path / f"kit_of_errors/{name}.py").write_text("SPEED = 3.0\n")
    (tmp_path / "kit_of_errors/inner/main.py").write_text(f"from ..speeds import SPEED\n{PLAIN}")
    (tmp_path / "plain.py").write_text(PLAIN)
    (tmp_path / "dots.py").write_text(f"from .elsewhere import Plain\n{PLAIN}")
    yield
    for name in [name for name in sys.modules if name.startswith("kit_of_errors")]:
        del sys.modules[name]


PLAIN = """
class Plain:
    def reset(self, scene, seed): ...
    def act(self, scene): return 0.0, 0.0
"""


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("plain:Plain+ttcbf", None),
        ("./plain:Plain(speed=3)", "did you mean plain.py:Plain(speed=3)?"),
        ("kit_of_errors/inner/main:Plain", "did you mean kit_of_errors.inner.main:Plain?"),
        ("kit_of_errors/inner:Main", "did you mean kit_of_errors.inner:Main?"),
        ("kit_of_errors/inner/main.py:Plain", "name it as kit_of_errors.inner.main (an agent: "),
        ("dots.py:Plain", "the file is in no package: import without the dots"),
        ("kit_of_errors.inner.main:Plain", None),
    ],
)
def test_places_that_are_nearly_right(package, name, told):
    if told is None:
        make_agent(name)
        return
    with pytest.raises(InputError) as caught:
        make_agent(name)
    assert told in str(caught.value)
