"""YAML text -> plain data and where in the text each value stands.

Scalars follow YAML 1.2: `yes`, `on` and `12:30` are text, `1e3` is a number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import yaml

from rudc.scenario.dotted import Path, dotted
from rudc.scenario.problems import got

_INT = re.compile(r"^[-+]?(?:0|[1-9][0-9]*)$")
_FLOAT = re.compile(
    r"^(?:[-+]?(?:\.[0-9]+|[0-9]+\.[0-9]*)(?:[eE][-+]?[0-9]+)?|[-+]?[0-9]+[eE][-+]?[0-9]+"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"
)
_TAG = "tag:yaml.org,2002:"
LONGEST = 200_000
"""characters of a file: PyYAML reads 100,000 in about a second"""
DEEPEST = 30
"""lists and mappings within one another"""
MOST = 10_000
"""values of a file, each alias counted as all that it stands for"""


class _Loader(yaml.SafeLoader):
    """PyYAML's loader with the scalars of YAML 1.2."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 - PyYAML declares it so


_Loader.add_implicit_resolver(
    _TAG + "bool", re.compile(r"^(?:true|True|TRUE|false|False|FALSE)$"), list("tTfF")
)
_Loader.add_implicit_resolver(_TAG + "null", re.compile(r"^(?:~|null|Null|NULL|)$"), ["~", "n", "N", ""])
_Loader.add_implicit_resolver(_TAG + "int", _INT, list("-+0123456789"))
_Loader.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))


class YamlDumper(yaml.SafeDumper):
    """PyYAML's dumper, which quotes whatever YAML 1.1 or 1.2 would take for something else than text."""


YamlDumper.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))


@dataclass(frozen=True)
class Mark:
    """A value's place and its key's, lines and columns from 1."""

    file: str
    line: int
    column: int
    key_line: int
    key_column: int


@dataclass(frozen=True)
class Report:
    """A problem and where it stands."""

    file: str
    line: int
    column: int
    path: Path
    text: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return f"{place}: {f'{dotted(self.path)}: ' if self.path else ''}{self.text}"


@dataclass
class Sheet:
    """What a file says: data, and a mark for every value in it by path."""

    data: dict[str, Any] = field(default_factory=dict)
    marks: dict[Path, Mark] = field(default_factory=dict)

    def report(self, path: Path, text: str, on_key: bool = False) -> Report:
        """A problem at a path, placed at the innermost value on the way there that exists."""
        known = next(path[:n] for n in range(len(path), -1, -1) if path[:n] in self.marks)
        mark = self.marks[known]
        line, column = (
            (mark.key_line, mark.key_column) if on_key and known == path else (mark.line, mark.column)
        )
        return Report(mark.file, line, column, path, text)


@lru_cache(maxsize=64)
def _compose(text: str) -> yaml.Node | None:
    """The one document in a text, as nodes, if it has no more values and levels than a scenario may have.

    What the text says is counted before anything is built of it: each alias as all that it stands for. The
    last texts are remembered, since many scenarios extend the same few; nobody changes their nodes. Raises
    yaml.YAMLError.
    """
    depth = values = 0
    sizes: dict[str, int] = {}
    anchored: list[tuple[str | None, int]] = []
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
            anchor, before = anchored.pop()
            if anchor is not None:
                sizes[anchor] = values - before
            continue
        if not isinstance(event, yaml.NodeEvent):
            continue
        values += sizes.get(event.anchor, 1) if isinstance(event, yaml.AliasEvent) else 1
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            anchored.append((event.anchor, values - 1))
        if depth > DEEPEST:
            raise _TooMuch(problem=f"nested more than {DEEPEST} deep", problem_mark=event.start_mark)
        if values > MOST:
            aliases = ", counting what its aliases stand for" if sizes else ""
            raise _TooMuch(problem=f"more than {MOST} values{aliases}", problem_mark=event.start_mark)
    return yaml.compose(text, Loader=_Loader)


class _TooMuch(yaml.MarkedYAMLError):
    """More than a scenario may hold."""


def read_yaml(text: str, file: str, keys: str = "`name` and `network`") -> tuple[Sheet | None, list[Report]]:
    """The data in a text and its problems; no data where it cannot be understood at all. `keys`: examples of
    what it may have, for the message where it is no mapping.
    """
    if len(text) > LONGEST:
        return None, [Report(file, 1, 1, (), f"longer than {LONGEST} characters; that is too long")]
    try:
        node = _compose(text)
    except yaml.MarkedYAMLError as error:
        return None, [_syntax_report(error, file)]
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        line, column = before.count("\n") + 1, error.position - before.rfind("\n")
        character = f"the character U+{ord(text[error.position]):04X} is not allowed"
        return None, [Report(file, line, column, (), f"not valid YAML: {character}")]
    reader = _Reader(file)
    if node is None:
        return None, [Report(file, 1, 1, (), "the file is empty")]
    data = reader.value(node, (), node.start_mark)
    if not isinstance(data, dict):
        expected = f"expected a mapping with keys such as {keys}"
        return None, reader.reports or [
            Report(file, *_place(node.start_mark), (), f"{expected}, got {got(data)}")
        ]
    return Sheet(data, reader.marks), reader.reports


def read_value(text: str) -> Any:
    """A single value, read as one in a file. Raises ValueError, in words, where it cannot be."""
    shown = text if len(text) <= 60 else text[:57] + "..."
    if len(text) > LONGEST:
        raise ValueError(f"{shown!r} is too long")
    try:
        node = _compose(text)
    except _TooMuch as error:
        raise ValueError(f"{shown!r} {error.problem}") from None
    except yaml.YAMLError:
        raise ValueError(f"{shown!r} is not a value as in a YAML file") from None
    if node is None:
        return None
    reader = _Reader("")
    value = reader.value(node, (), node.start_mark)
    if reader.reports:
        raise ValueError(reader.reports[0].text)
    return value


class _Reader:
    """Turns nodes into plain data, marking where each comes from."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.marks: dict[Path, Mark] = {}
        self.reports: list[Report] = []
        self._open: list[yaml.Node] = []

    def value(self, node: yaml.Node, path: Path, key: yaml.Mark) -> Any:
        """Plain data of a node that stands at a path."""
        self.marks[path] = Mark(self.file, *_place(node.start_mark), *_place(key))
        if any(node is outer for outer in self._open):
            self._report(node, path, "refers to itself")
            return None
        self._open.append(node)
        try:
            if isinstance(node, yaml.MappingNode):
                return self._mapping(node, path)
            if isinstance(node, yaml.SequenceNode):
                self._check_tag(node, path, "seq")
                return [self.value(item, (*path, i), item.start_mark) for i, item in enumerate(node.value)]
            return self._scalar(node, path)
        finally:
            self._open.pop()

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        self._check_tag(node, path, "map")
        data: dict[str, Any] = {}
        first: dict[str, int] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                self._report(key, path, "a key must be a word")
            elif key.value in data:
                text = f"given twice, first in line {first[key.value]}"
                self._report(key, (*path, key.value), text)
            else:
                first[key.value] = key.start_mark.line + 1
                data[key.value] = self.value(value, (*path, key.value), key.start_mark)
        return data

    def _scalar(self, node: yaml.Node, path: Path) -> Any:
        text = node.value
        try:
            match node.tag.removeprefix(_TAG):
                case "str":
                    return text
                case "null":
                    return None
                case "bool":
                    return {"true": True, "false": False}[text.lower()]
                case "int":
                    return int(text)
                case "float":
                    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        except (ValueError, KeyError):
            self._report(node, path, f"{text!r} is not a value of the type {node.tag.removeprefix(_TAG)!r}")
            return None
        self._check_tag(node, path, "str")
        return text

    def _check_tag(self, node: yaml.Node, path: Path, expected: str) -> None:
        if node.tag != _TAG + expected:
            tag = node.tag.replace(_TAG, "!!")
            self._report(node, path, f"the YAML tag {tag} is not understood here")

    def _report(self, node: yaml.Node, path: Path, text: str) -> None:
        self.reports.append(Report(self.file, *_place(node.start_mark), path, text))


def _place(mark: yaml.Mark) -> tuple[int, int]:
    return mark.line + 1, mark.column + 1


def _syntax_report(error: yaml.MarkedYAMLError, file: str) -> Report:
    line, column = _place(error.problem_mark) if error.problem_mark else (1, 1)
    problem = error.problem or "cannot be read"
    if isinstance(error, _TooMuch):
        return Report(file, line, column, (), problem)
    if "'\\t'" in problem:
        problem = "a tab; YAML is indented with spaces"
    elif problem.startswith("mapping values are not allowed"):
        problem += " (a stray colon, a missing space after one, or wrong indentation)"
    context = f" {error.context}" if error.context else ""
    return Report(file, line, column, (), f"not valid YAML{context}: {problem}")
