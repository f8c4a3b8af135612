"""Agents of other people, by where their class stands: `FILE.py:Class` or `package.module:Class`.

    examples/own_agent.py:Careful(speed=6)+ttcbf:d_safe=0.3
    `---- source ---' `class' `arguments'  `-- rest, as behind any other driver's name

Arguments are Python literals (numbers, texts, lists, ...), read as such and never evaluated. A file's folder
may be imported from, as when Python runs the file, and so may the working folder for `package.module`.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from rudc.agents.base import Agent
from rudc.errors import AgentError, RudcError
from rudc.hints import did_you_mean, there_are

_NAME = re.compile(
    r"(?P<source>.+?\.py|[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):(?P<attribute>[A-Za-z_]\w*)(?P<rest>$|[(+:].*)",
    re.DOTALL,
)
METHODS = {"reset": "reset(scene, seed)", "act": "act(scene)"}
"""what every agent has, see `rudc.agents.base.Agent`"""


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
        """The class. Raises AgentError."""
        module = _file(self.source) if self.source.endswith(".py") else _module(self.source)
        found = getattr(module, self.attribute, None)
        if callable(found):
            return found
        classes = [
            name for name, value in vars(module).items()
            if inspect.isclass(value) and value.__module__ == module.__name__
        ]  # fmt: skip
        known = there_are(self.attribute, classes) if classes else ", nor any other"
        raise AgentError(f"{self.source}: no class {self.attribute!r} in it{known}")

    def make(self) -> Agent:
        """The agent, new. Raises AgentError."""
        return construct(self.find(), self.text, self.positional, dict(self.named))

    def settings(self) -> dict[str, Any]:
        """What decides what it does, as JSON: digests of its source and of files that its arguments name."""
        given = {str(i): value for i, value in enumerate(self.positional)} | dict(self.named)
        files = {
            key: digest(Path(value)) for key, value in given.items()
            if isinstance(value, str) and Path(value).is_file()
        }  # fmt: skip
        return {"driver": self.text, "source": source_digest(self.find()), "files": files}


def parse_own(name: str) -> tuple[OwnAgent, str] | None:
    """The agent that a name of this kind begins with, and the rest of the name; None for other names. Raises
    AgentError when its arguments are no literals.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    rest = match["rest"]
    inside = _arguments(rest) if rest.startswith("(") else ""
    text = name[: match.end("attribute") + len(inside)]
    positional, named = _values(inside, name)
    return OwnAgent(match["source"], match["attribute"], positional, named, text), rest[len(inside) :]


def construct(make: Callable[..., Any], name: str, positional: Any = (), named: Any = None) -> Agent:
    """An agent of a class (or function) that is not ours. Raises AgentError where it cannot be made."""
    named = named or {}
    with contextlib.suppress(ValueError):  # a class of C has no signature to be looked at
        signature = inspect.signature(make)
        try:
            signature.bind(*positional, **named)
        except TypeError as error:
            near = "".join(did_you_mean(key, signature.parameters) for key in named)
            raise AgentError(f"agent {name}: {error}{near}; its arguments are {signature}") from None
    try:
        agent = make(*positional, **named)
    except RudcError:
        raise
    except Exception as error:
        raise AgentError(f"agent {name} cannot be made: {in_words(error)}") from error
    for method, form in METHODS.items():
        if not callable(getattr(agent, method, None)):
            raise AgentError(f"agent {name} has no method {form}; see rudc/agents/base.py, or `examples/`")
    return agent


def in_words(error: BaseException) -> str:
    """`ValueError: what it says (file.py:12)`, the place being where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def digest(file: Path) -> str:
    """Of a file's content."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def source_digest(thing: Any) -> str:
    """Of the file in which a class or function is written; `unknown` where there is none."""
    try:
        return digest(Path(inspect.getfile(thing)))
    except (TypeError, OSError):
        return "unknown"


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
    try:
        named = tuple((str(word.arg or "**"), ast.literal_eval(word.value)) for word in call.keywords)
        return tuple(ast.literal_eval(value) for value in call.args), named
    except ValueError:
        raise AgentError(
            f"agent {name}: arguments are numbers, texts in quotes, True, False, None, or lists of them"
        ) from None


def _file(source: str) -> ModuleType:
    path = Path(source).expanduser()
    if not path.is_file():
        beside = [other.name for other in path.parent.glob("*.py")]
        raise AgentError(f"no agent {source}: there is no such file{did_you_mean(path.name, beside)}")
    path = path.resolve()
    return _load(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _load(path: Path, _modified: int) -> ModuleType:
    """The file as a module, run once for as long as it stays as it is."""
    _importable(path.parent)
    name = f"rudc_own_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # so that its dataclasses and pickles find it
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise AgentError(f"{path} cannot be imported: {in_words(error)}") from error
    return module


def _module(source: str) -> ModuleType:
    _importable(Path.cwd())
    try:
        return importlib.import_module(source)
    except ModuleNotFoundError as error:
        if error.name and (source == error.name or source.startswith(f"{error.name}.")):
            raise AgentError(
                f"no agent from {source!r}: there is no module {error.name!r}; "
                "a file is given by its path, with .py at its end"
            ) from None
        raise AgentError(f"{source} cannot be imported: {in_words(error)}") from error
    except (Exception, SystemExit) as error:
        raise AgentError(f"{source} cannot be imported: {in_words(error)}") from error


def _importable(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
