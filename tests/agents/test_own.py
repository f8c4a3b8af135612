"""Agents of other people: by the place of their class, registered, of packages; and what they answer."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest

import rudc
from rudc.agents import drivers
from rudc.agents.base import Decision
from rudc.agents.filtered import FilteredAgent
from rudc.agents.own import parse_own
from rudc.agents.registry import agent_names, agent_settings, agent_summary, make_agent
from rudc.errors import AgentError, AgentFailedError, InputError
from rudc.learning.algorithms import ALGORITHMS
from tests.offering import offer

SOURCE = '''
"""Agents for tests."""
from beside import GENTLE
import numpy as np

def Sure(total):
    from rudc.learning.uncertainty import Uncertainty

    return Uncertainty(0.0, 0.0, total)

class Steady:
    """Holds a speed.

    And more.
    """

    def __init__(self, speed=8.0, path=None, more=()):
        self.speed, self.more = speed, more

    def reset(self, scene, seed):
        self.seed = seed

    def act(self, scene):
        return GENTLE * (self.speed - scene.ego.v), 0.0

class NoReset:
    def act(self, scene):
        return 0.0, 0.0

class Grad:
    """As a torch tensor that requires grad."""

    def __array__(self, *_, **__):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")

    def __repr__(self):
        return "tensor([1., 0.], requires_grad=True)"

class Answers(Steady):
    def decision(self, **stated):
        from rudc.agents.base import unfiltered

        return unfiltered(1.0, 0.0)._replace(**stated)

    def act(self, scene):
        return {
            "nan": (float("nan"), 0.0), "shape": [1.0], "text": "left", "none": None,
            "complex": np.array([1 + 1j, 0]), "grad": Grad(), "sigma": self.decision(uncertainty=Sure("x")),
            "sure": self.decision(by_route=3.0), "corrected": self.decision(corrected=(0.0, 0.0)),
            "texts": ["1.0", "0.0"], "half": [np.array("1.0"), 0.0], "objects": np.array(["1", 0], object),
        }[self.speed]

class Raises(Steady):
    def act(self, scene):
        return scene.no_such_thing

class Needy(Steady):
    def __init__(self, speed):
        super().__init__(speed)

class Costly(Steady):
    def __init__(self):
        raise FileNotFoundError("no weights")

class Careful(Steady):
    """Wants 1 m/s2, and holds itself back."""

    def act(self, scene):
        from rudc.agents.base import Decision

        return Decision(u=(-0.5, 0.0), u_rl=(1.0, 0.0))
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with `mine.py` and `beside.py`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("beside", "my_module", "pack.inner"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    (tmp_path / "mine.py").write_text(SOURCE, encoding="utf-8")
    (tmp_path / "beside.py").write_text("GENTLE = 0.5", encoding="utf-8")
    yield tmp_path
    for name in ("beside", "my_module", "pack", "pack.inner"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("name", "text", "positional", "named", "rest"),
    [
        ("a/b c.py:K", "a/b c.py:K", (), (), ""),
        ("a.py:K(speed=3)", "a.py:K(speed=3)", (), (("speed", 3),), ""),
        ("p:K([1, -2], t='):+x(')+ecbf", "p:K([1, -2], t='):+x(')", ([1, -2],), (("t", "):+x("),), "+ecbf"),
        ("p:K()+ttcbf:correction.d_safe=0.3", "p:K()", (), (), "+ttcbf:correction.d_safe=0.3"),
    ],
)  # fmt: skip
def test_what_a_name_says(name, text, positional, named, rest):
    own, behind = parse_own(name)
    assert (own.text, own.positional, own.named, behind) == (text, positional, named, rest)


@pytest.mark.parametrize(
    "name",
    ["follower", "rudc-t:correction.d_safe=0.3", "some/folder", "follower+ttcbf:correction.d_safe=0.3"],
)
def test_other_names_are_none(name):
    assert parse_own(name) is None


def test_from_a_file(folder, scene_on):
    scene = scene_on("south", "straight", 60.0, 7.0)
    agent = make_agent("mine.py:Steady(speed=9)")
    assert (agent.name, agent.ego_driver) == ("mine.py:Steady(speed=9)", "agent")
    agent.reset(scene, 3)
    decision = agent.act(scene)
    assert isinstance(decision, Decision)
    np.testing.assert_array_equal(decision.u, [1.0, 0.0])
    assert agent_summary("mine.py:Steady") == "Holds a speed."
    assert agent_summary("mine.py:Steady()+ttcbf").startswith("Holds a speed. Behind it")


@pytest.mark.parametrize("length", [400, 5000])
def test_a_long_text_is_no_file(folder, length):
    name = f"mine.py:Steady(path={'x' * length!r})"
    for whole in (name, f"{name}+ttcbf"):
        assert make_agent(whole).name == whole
        assert agent_settings(whole)["files"] == {}
    with pytest.raises(AgentError, match="no agent 'xxx"):
        make_agent("x" * length)


def test_a_filter_behind_it(folder, scene_on):
    scene = scene_on("south", "straight", 60.0, 7.0)
    agent = make_agent("mine.py:Steady(9)+ttcbf:correction.d_safe=0.3")
    assert isinstance(agent, FilteredAgent)
    assert agent.name == "mine.py:Steady(9)+ttcbf:correction.d_safe=0.3"
    agent.reset(scene, 0)
    assert agent.act(scene).corrected is not None
    assert agent_settings(agent.name)["correction"]["d_safe"] == 0.3


def test_a_filter_behind_one_that_corrects_itself_filters_what_that_would_do(folder, scene_on):
    scene = scene_on("south", "straight", 60.0, 7.0)
    agent = make_agent("mine.py:Careful+ttcbf")
    agent.reset(scene, 0)
    decision = agent.act(scene)
    np.testing.assert_allclose(decision.u, [-0.5, 0.0], atol=1e-6)
    np.testing.assert_array_equal(decision.u_rl, [1.0, 0.0])


def test_from_a_module_of_the_working_folder(folder, scene_on):
    (folder / "my_module.py").write_text("from mine import *", encoding="utf-8")
    (folder / "pack").mkdir()
    (folder / "pack" / "__init__.py").touch()
    (folder / "pack" / "inner.py").write_text(SOURCE, encoding="utf-8")
    for name in ("my_module:Steady(speed=9)", "pack.inner:Steady(speed=9)"):
        assert make_agent(name).act(scene_on("south", "straight", 60.0, 7.0)).u[0] == 1.0


def test_settings_change_with_the_source_and_with_files_in_arguments(folder):
    (folder / "weights.bin").write_bytes(b"1")
    name = "mine.py:Steady(path='weights.bin')"
    first = agent_settings(name)
    assert first["driver"] == name
    assert agent_settings(name) == first
    (folder / "weights.bin").write_bytes(b"2")
    second = agent_settings(name)
    assert (first["source"], first["files"].keys()) == (second["source"], second["files"].keys())
    assert first["files"] != second["files"]
    (folder / "mine.py").write_text(SOURCE + "# changed\n", encoding="utf-8")
    assert agent_settings(name)["source"] != first["source"]


@pytest.mark.parametrize(
    "taken",
    [
        "from {beside} import Steady as Mine",
        "from {beside} import Steady; Mine = partial(Steady, speed={number})",
    ],
)
def test_settings_change_with_the_file_that_is_named(folder, taken):
    """Also where the class is written in another file, or what is named is no class."""
    beside = f"steady_{len(taken)}"  # this process imports each name once
    (folder / f"{beside}.py").write_text(SOURCE, encoding="utf-8")
    found = []
    for number in (3, 9):
        text = f"from functools import partial\n{taken.format(beside=beside, number=number)}  # {number}\n"
        (folder / "taking.py").write_text(text, encoding="utf-8")
        found.append(agent_settings("taking.py:Mine"))
    assert found[0] != found[1]
    assert "taking.py" in found[0]["imports"]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("mein.py:Steady", "there is no such file (did you mean 'mine.py'?)"),
        (
            "mine.py:Stedy",
            "no class or function 'Stedy' in it (did you mean 'Steady'?); there are: Steady, NoReset",
        ),
        ("mine.py", "name the class in it, too: mine.py:Class"),
        ("mine.py:Steady(sped=3)", "unexpected keyword argument 'sped' (did you mean 'speed'?)"),
        (
            "mine.py:Needy(sped=3)",
            "Needy(sped=3): unexpected keyword argument 'sped' (did you mean 'speed'?)",
        ),
        ("mine.py:Needy()", "missing a required argument: 'speed'; its arguments are (speed)"),
        ("mine.py:Steady:", "KEY=VALUE expected after the colon"),
        ("mine.py:Steady+ttcbf:d_safe", "KEY=VALUE expected after the colon"),
        ("mine.py:Steady(speed=open('x'))", "arguments are numbers, texts in quotes"),
        ("mine.py:Steady(speed=3, speed=6)", "argument speed is given twice"),
        ("mine.py:Steady({[1]: 2})", "arguments are numbers, texts in quotes"),
        ("mine.py:Steady(3", "are not Python"),
        ("mine.py:NoReset", "has no method reset(scene, seed)"),
        ("mine.py:Costly", "cannot be made: FileNotFoundError: no weights (mine.py:"),
        ("mine.py:Steady+tcbf", "no filter 'tcbf' (did you mean 'ttcbf'?)"),
        ("mine.py:Steady:d_safe=3", "has no filter, and nothing that 'd_safe=3' could set"),
        ("mine.py:Steady:speed=3", "there are outlook.course, "),
        ("mine.py:Steady:speed=3", "arguments of a class of your own stand in brackets"),
        ("mine.py:", "mine.py is a file; name the class in it, too: mine.py:Class"),
        ("garbled.py:Steady", "cannot be imported: SyntaxError: invalid syntax (garbled.py:2)"),
        ("minne:Steady", "there is no module 'minne'"),
        ("broken.py:Steady", "cannot be imported: ZeroDivisionError: division by zero (broken.py:2)"),
    ],
)
def test_what_is_wrong_is_said(folder, name, told):
    (folder / "broken.py").write_text("x = 1\nx / 0\n", encoding="utf-8")
    (folder / "garbled.py").write_text("x = 1\ndef y(:\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        make_agent(name)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("answer", "told"),
    [("nan", "(nan, 0.0)"), ("shape", "[1.0]"), ("text", "'left'"), ("none", "None"),
     ("texts", "['1.0', '0.0']"), ("half", "[array('1.0', dtype='<U3'), 0.0]"),
     ("complex", "array([1.+1.j, 0.+0.j])"), ("grad", "tensor([1., 0.], requires_grad=True)"),
     ("objects", "array(['1', 0], dtype=object)")],
)  # fmt: skip
def test_no_action_is_an_error(folder, scene_on, answer, told):
    name = f"mine.py:Answers('{answer}')"
    for whole in (name, f"{name}+ttcbf"):
        agent = make_agent(whole)
        scene = scene_on("south", "straight", 60.0, 7.0)
        agent.reset(scene, 0)
        with pytest.raises(AgentFailedError) as caught:
            agent.act(scene)
        assert f"act answered {told}, where two finite numbers" in str(caught.value)
        assert name in str(caught.value)


@pytest.mark.parametrize(
    ("answer", "told"),
    [("sigma", "uncertainty = Uncertainty(epistemic=0.0, aleatoric=0.0, total='x'); expected an"),
     ("sure", "by_route = 3.0; expected an `Uncertainty` of three numbers, or None"),
     ("corrected", "corrected = (0.0, 0.0); expected a `Corrected`, or None")],
)  # fmt: skip
def test_what_a_decision_states_is_looked_at(folder, scene_on, answer, told):
    scene = scene_on("south", "straight", 60.0, 7.0)
    with pytest.raises(AgentFailedError) as caught:
        make_agent(f"mine.py:Answers('{answer}')+ttcbf").act(scene)
    assert f"s: act answered a Decision with {told}" in str(caught.value)


def test_its_exception_is_an_error_of_ours(folder, scene_on):
    with pytest.raises(AgentFailedError, match=r"act raised AttributeError: .* \(mine\.py:\d+\)") as caught:
        make_agent("mine.py:Raises").act(scene_on("south", "straight", 60.0, 7.0))
    assert isinstance(caught.value.__cause__, AttributeError)


class Registered:
    """Stands still."""

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return np.array([-1.0, 0.0])


def test_registered(monkeypatch, scene_on):
    monkeypatch.setattr(drivers, "_registered", {})
    rudc.register_agent("stand-still", Registered)
    assert {"stand-still", "stand-still+ttcbf"} <= set(agent_names())
    agent = make_agent("stand-still")
    assert agent.act(scene_on("south", "straight", 60.0, 7.0)).u[0] == -1.0
    assert agent_summary("stand-still+ecbf").startswith("Stands still. Behind it")
    assert len(agent_settings("stand-still")["source"]) == 16
    rudc.register_agent("stand-still", Registered)  # a notebook's cell, run again
    for name in ("follower", "rudc-t", "stand+still", "a:b", ""):
        with pytest.raises(InputError):
            rudc.register_agent(name, Registered)
    with pytest.raises(InputError):
        rudc.register_agent("mine", "no class")


def test_brought_by_a_package(folder, monkeypatch, scene_on):
    offer(folder, "[rudc.agents]\nsteady = mine:Steady\ngone = mine:Gone\n")
    sys.path.append(str(folder))
    drivers._installed.cache_clear()
    try:
        assert "steady+ttcbf" in agent_names()
        assert make_agent("steady").act(scene_on("south", "straight", 60.0, 7.0)).u[0] == 0.5
        with pytest.raises(
            AgentError, match=r"package brought: its entry point `gone = mine:Gone` of rudc.agents"
        ):
            make_agent("gone")
    finally:
        drivers._installed.cache_clear()
        sys.modules.pop("mine", None)


def test_public_names():
    assert all(callable(getattr(rudc, name)) for name in rudc.PUBLIC)
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = rudc.no_such_thing


def test_agents_of_packages_whose_name_means_another_are_told(tmp_path, monkeypatch):
    for name in ("one", "two"):
        offer(tmp_path, "[rudc.agents]\nsteady = mine:Steady\n", name)
    monkeypatch.syspath_prepend(tmp_path)
    drivers._installed.cache_clear()
    (told,) = drivers.offered_in_vain()
    drivers._installed.cache_clear()
    assert re.fullmatch(
        r"the agent 'steady' of the installed package (one|two) is not used: (one|two) offers one, too", told
    )


def test_an_agent_of_a_package_does_not_take_the_name_of_a_shipped_one(tmp_path, monkeypatch):
    offer(tmp_path, "[rudc.agents]\nrudc-t = mine:Steady\n")
    monkeypatch.syspath_prepend(tmp_path)
    drivers._installed.cache_clear()
    try:
        assert drivers.offered_in_vain() == [
            "the agent 'rudc-t' of the installed package brought is not used: it is RUDC's own"
        ]
        assert not drivers.is_driver("rudc-t")
    finally:
        drivers._installed.cache_clear()


def test_a_function_that_is_meant_is_named(tmp_path):
    (tmp_path / "functions.py").write_text(
        "from os import getcwd\ndef good(): ...\ndef _hidden(): ...\n", encoding="utf-8"
    )
    told = r"no class or function 'goood' in it \(did you mean 'good'\?\); there are: good$"
    with pytest.raises(AgentError, match=told):
        make_agent(f"{tmp_path}/functions.py:goood")


@pytest.mark.parametrize("name", ["mine-sac", "mine-sac+ttcbf"])
def test_an_algorithm_of_which_no_agent_is_shipped_is_said_to_be_one(name, monkeypatch):
    monkeypatch.setitem(ALGORITHMS, "mine-sac", replace(ALGORITHMS["sac"], summary="Mine."))
    with pytest.raises(
        AgentError, match=r"'mine-sac' is an algorithm, .* Mine. Train one, rudc train mine-sac "
    ):
        agent_summary(name)


@pytest.mark.parametrize("name", ["loud.py:Loud", "loud:Loud", "loudly"])
def test_what_it_prints_while_it_is_imported_and_made_is_no_result(tmp_path, monkeypatch, capsys, name):
    (tmp_path / "loud.py").write_text(
        "print('imported')\nclass Loud:\n    def __init__(self):\n        print('made')\n"
        "    def reset(self, scene, seed): ...\n    def act(self, scene): ...\n"
    )
    offer(tmp_path, "[rudc.agents]\nloudly = loud:Loud\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(drivers, "_installed", drivers._installed.__wrapped__)
    make_agent(name)
    sys.modules.pop("loud", None)
    assert capsys.readouterr() == ("", "imported\nmade\n")
