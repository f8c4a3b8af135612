"""Agents that are not RUDC's, by the place of their class: `FILE.py:Class` or `package.module:Class`.

    examples/own_agent.py:Careful(speed=6)+ttcbf:d_safe=0.3
    `---- source ---' `class' `arguments'  `-- rest, as after any other driver's name

Arguments are Python literals (numbers, texts, lists, ...); they are parsed, never evaluated. A file can
import from its own folder, as when Python runs it; the module of `package.module` may lie in the working
folder.
"""

from __future__ import annotations

import ast
import contextlib
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from rudc.agents.base import Agent
from rudc.agents.own_files import digest, files_of, remember
from rudc.beside import code_beside
from rudc.errors import AgentError, RudcError
from rudc.hints import did_you_mean, there_are
from rudc.imports import import_source, in_words
from rudc.reading import watched

_NAME = re.compile(
    r"(?P<source>.+?\.py|[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):(?P<attribute>[A-Za-z_]\w*)(?P<rest>$|[(+:].*)",
    re.DOTALL,
)
METHODS = {"reset": "reset(scene, seed)", "act": "act(scene)"}
"""methods that every agent must have (see `rudc.agents.base.Agent`) -> how messages write them"""


@dataclass(frozen=True)
class OwnAgent:
    """Which class makes an agent, and with what arguments."""

    source: str
    """path of a file, or a module's dotted name"""
    attribute: str
    """the class in it"""
    positional: tuple[Any, ...]
    named: tuple[tuple[str, Any], ...]
    text: str
    """all of this as given"""

    def find(self) -> Callable[..., Any]:
        """The class, or a function that makes the agent. Raises InputError if there is none."""
        module = import_source(self.source)
        found = getattr(module, self.attribute, None)
        if callable(found):
            return found
        its = {
            name: value for name, value in vars(module).items()
            if getattr(value, "__module__", None) == module.__name__
        }  # fmt: skip
        names = [name for name, value in its.items() if inspect.isclass(value)]
        names += [name for name, value in its.items() if inspect.isfunction(value) and name[0] != "_"]
        known = there_are(self.attribute, names) if names else ", nor any other"
        raise AgentError(f"{self.source}: no class or function {self.attribute!r} in it{known}")

    def make(self) -> Agent:
        """A new agent. Raises InputError if there is no such class, AgentError if it makes no agent."""
        make = self.find()
        return construct(make, self.text, self.positional, dict(self.named), import_source(self.source))

    def settings(self) -> dict[str, Any]:
        """Everything that decides what the agent does, to be written as JSON: its name, and digests of its
        source, of the files that this imports from beside it, of the data files that it reads
        (rudc/agents/own_files.py), and of files that its arguments name. If the named file only takes it from
        elsewhere, or makes it by a call, that file counts among the imports. Raises AgentError if the agent
        cannot be made.
        """
        given = {str(i): value for i, value in enumerate(self.positional)} | dict(self.named)
        files = {
            key: digest(Path(value)) for key, value in given.items()
            if isinstance(value, str) and os.path.isfile(value)
        }  # fmt: skip
        found = self.find()
        known = {"driver": self.text, "source": source_digest(found), "files": files}
        reads = files_of(self.text, found, self.make)
        if reads := {name: one for name, one in reads.items() if one not in files.values()}:
            known["reads"] = reads
        beside = imports_beside(found) | named_apart(import_source(self.source), found)
        return known | ({"imports": beside} if beside else {})


def parse_own(name: str) -> tuple[OwnAgent, str] | None:
    """For a name that begins with the place of a class: the agent, and the rest of the name. None for other
    names. Raises AgentError if the arguments are not Python literals.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    rest = match["rest"]
    inside = _arguments(rest) if rest.startswith("(") else ""
    text = name[: match.end("attribute") + len(inside)]
    positional, named = _values(inside, name)
    return OwnAgent(match["source"], match["attribute"], positional, named, text), rest[len(inside) :]


def construct(
    make: Callable[..., Any],
    name: str,
    positional: Any = (),
    named: Any = None,
    named_in: ModuleType | None = None,
) -> Agent:
    """An agent made by a class (or function) that is not RUDC's, and was found in the module `named_in`, if
    any. Raises AgentError if it cannot be made or lacks a method. What it prints meanwhile goes to stderr:
    stdout is for results.
    """
    named = named or {}
    with contextlib.suppress(ValueError):  # a class of C has no signature to be looked at
        signature = inspect.signature(make)
        try:
            signature.bind(*positional, **named)
        except TypeError as error:
            told = _unexpected(named, signature) or str(error)
            raise AgentError(f"agent {name}: {told}; its arguments are {signature}") from None
    try:
        with contextlib.redirect_stdout(sys.stderr), watched() as opened:
            agent = make(*positional, **named)
    except RudcError:
        raise
    except (Exception, SystemExit) as error:
        told = f"{in_words(error)}{_where_it_is_looked_for(error)}"
        raise AgentError(f"agent {name} cannot be made: {told}") from error
    for method, form in METHODS.items():
        _check_method(name, method, getattr(agent, method, None), form)
    remember(name, make, agent, opened, named_in)
    return agent


def _check_method(name: str, method: str, there: Any, form: str) -> None:
    """Raise AgentError unless a method of an agent is there and can be called as `form` says."""
    if not callable(there):
        needs = " and ".join(METHODS.values())
        raise AgentError(f"agent {name} has no method {form}; an agent needs {needs}: see `examples/`")
    try:
        signature = inspect.signature(there)
    except (TypeError, ValueError):  # of C
        return
    try:
        signature.bind(*form.partition("(")[2].split(", "))
    except TypeError:
        raise AgentError(f"agent {name}: its {method} takes {signature}, and is called as {form}") from None


def _where_it_is_looked_for(error: BaseException) -> str:
    """Where a file that was not found is looked for, if its path is relative; empty for other errors."""
    path = getattr(error, "filename", None)
    if not isinstance(error, FileNotFoundError) or not isinstance(path, str) or os.path.isabs(path):
        return ""
    return (
        f"; that path is relative to the working folder, {Path.cwd()}; a file beside the agent's own is "
        f"Path(__file__).with_name({os.path.basename(path)!r})"
    )


def _unexpected(named: Iterable[str], signature: inspect.Signature) -> str:
    """The message about the first named argument that is unknown; empty if all are known."""
    known = signature.parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values()):
        return ""
    wrong = next((key for key in named if key not in known), None)
    return "" if wrong is None else f"unexpected keyword argument {wrong!r}{did_you_mean(wrong, known)}"


def source_digest(thing: Any) -> str:
    """`digest` of the file in which a class or function is written; `unknown` if there is no file."""
    try:
        return digest(Path(inspect.getfile(thing)))
    except (TypeError, OSError):
        return "unknown"


def imports_beside(thing: Any) -> dict[str, str]:
    """Path -> digest of each file that the source of a class or function imports from beside it."""
    try:
        path = Path(inspect.getfile(thing)).resolve()
    except (TypeError, OSError):
        return {}
    return {
        name: found for name, found in code_beside(path).items() if not path.as_posix().endswith(f"/{name}")
    }


def named_apart(module: ModuleType, thing: Any) -> dict[str, str]:
    """Path -> digest (`code_beside`) of a module that names a class or function written elsewhere. Empty if
    it is written in that module.
    """
    file = getattr(module, "__file__", None)
    try:
        written = Path(inspect.getfile(thing)).resolve()
    except (TypeError, OSError):
        written = None
    return {} if file is None or Path(file).resolve() == written else code_beside(Path(file))


def _arguments(rest: str) -> str:
    """The arguments at the beginning of a text, with their brackets: up to the first `)` that closes them."""
    for end in (match.end() for match in re.finditer(r"\)", rest)):
        with contextlib.suppress(SyntaxError):
            ast.parse(f"f{rest[:end]}", mode="eval")
            return rest[:end]
    raise AgentError(f"agent arguments {rest!r} are not Python; write them as in Class(speed=3)")


def _values(inside: str, name: str) -> tuple[tuple[Any, ...], tuple[tuple[str, Any], ...]]:
    call = ast.parse(f"f{inside or '()'}", mode="eval").body
    assert isinstance(call, ast.Call)
    words = [str(word.arg or "**") for word in call.keywords]
    if twice := next((word for word in words if words.count(word) > 1), None):
        raise AgentError(f"agent {name}: argument {twice} is given twice")
    try:
        named = tuple(zip(words, (ast.literal_eval(word.value) for word in call.keywords), strict=True))
        return tuple(ast.literal_eval(value) for value in call.args), named
    except (TypeError, ValueError):
        raise AgentError(
            f"agent {name}: arguments are numbers, texts in quotes, True, False, None, or lists or "
            "dictionaries of them"
        ) from None
