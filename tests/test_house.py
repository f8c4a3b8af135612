"""How the house is kept: what import contracts cannot say."""

import ast
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import rudc
from rudc import arrays

PACKAGE = Path(rudc.__file__).parent
FILES = sorted([*PACKAGE.rglob("*.py"), *Path(__file__).parent.rglob("*.py")])
LONGEST = 400
"""lines of a file at most"""


def test_no_file_is_too_long():
    lengths = {str(file): len(file.read_text(encoding="utf-8").splitlines()) for file in FILES}
    assert len(lengths) > 200
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST} == {}


@pytest.mark.parametrize("name", [name for name in vars(arrays) if name[0].isupper() and name != "NDArray"])
def test_a_type_of_arrays_means_one_thing(name):
    definition = re.compile(rf"^{name}\b.*= ", re.MULTILINE)
    assert [f.name for f in PACKAGE.rglob("*.py") if definition.search(f.read_text(encoding="utf-8"))] == [
        "arrays.py"
    ]


@pytest.mark.parametrize(("trace", "home"), [("os.replace(", "files.py"), ("get_close_matches", "hints.py")])
def test_files_and_hints_are_made_in_one_place(trace, home):
    assert [f.name for f in PACKAGE.rglob("*.py") if trace in f.read_text(encoding="utf-8")] == [home]


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
def test_make_takes_any_folder_and_leaves_results_alone():
    command = ["make", "--no-print-directory", "-n", "clean", "sweep", "OUT=out/two words"]
    lines = subprocess.run(command, cwd=PACKAGE.parent, capture_output=True, text=True, check=True).stdout
    removed, *_, sweep = lines.splitlines()
    removed, sweep = shlex.split(removed), shlex.split(sweep)
    assert removed[:2] == ["rm", "-rf"]
    assert not {"out", "out/sweep", "results"} & set(removed)
    assert sweep[-2:] == ["out/two words", "--resume"]


COMES_WITH = {"pydantic-core": "pydantic"}
"""distributions that a declared one pins to one version, and which are half of it"""


def spelled(distribution):
    return re.sub(r"[-_.]+", "-", distribution).lower()


def declared(requirements):
    return {spelled(re.match(r"[\w.-]+", requirement)[0]) for requirement in requirements}


PROJECT = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CORE = declared(PROJECT["dependencies"])
EXTRAS = declared(
    requirement
    for extra, requirements in PROJECT["optional-dependencies"].items()
    if extra not in ("dev", "bench")
    for requirement in requirements
)


def imported(node):
    """Dotted names that a statement imports: `from a import b` names a and a.b."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom):
        assert node.level == 0, "imports are absolute"
        return {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
        return {a.value for a in node.args if isinstance(a, ast.Constant)}
    return set()


def at_module_level(tree):
    """Nodes that run as a module is imported: none in functions or under TYPE_CHECKING."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        yield from at_module_level(node)


def strangers(names):
    """The distributions of other people among what is imported; one not installed is named as its import."""
    tops = {name.partition(".")[0] for name in names} - sys.stdlib_module_names - {"rudc"}
    distributions = {spelled(installed().get(top, [top])[0]) for top in tops}
    return {COMES_WITH.get(name, name) for name in distributions}


def named(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def installed():
    """Import -> its distributions. Where it is asked for: to collect tests, nobody needs it."""
    return packages_distributions()


@cache
def trees():
    """Module of ours -> its syntax tree."""
    return {named(path): ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}


@cache
def anywhere(module):
    """What a module imports, in functions and for checkers only, too."""
    return {name for node in ast.walk(trees()[module]) for name in imported(node)}


@cache
def at_once(module):
    """What a module imports as it is imported."""
    return {name for node in at_module_level(trees()[module]) for name in imported(node)}


def ours(names):
    """Modules of ours among the names, packages above them included."""
    above = {name[: dot.start()] for name in names for dot in re.finditer(r"\.", name)}
    return (names | above) & trees().keys()


def reached(names):
    """Modules of ours that are imported where these are."""
    waiting, seen = ours(names), set()
    while waiting:
        module = waiting.pop()
        seen.add(module)
        waiting |= ours(at_once(module)) - seen
    return seen


def test_what_is_imported_is_declared():
    """For users: packages for development do not count."""
    used = {module: strangers(anywhere(module)) for module in trees()}
    assert {"torch", "ray", "pillow", "pygame-ce", "imageio-ffmpeg"} <= set.union(*used.values())
    assert {module: more for module, names in used.items() if (more := names - CORE - EXTRAS)} == {}


@pytest.mark.parametrize(
    "command", ["main", "run", "sweep", "search", "table", "replay", "scenario", "network", "agent"]
)
def test_commands_without_training_need_core_dependencies_only(command):
    """As the command line starts, and as one of its commands begins its work."""
    start = {"rudc.cli.main", "rudc.cli.commands"} if command == "main" else anywhere(f"rudc.cli.{command}")
    modules = reached(start)
    assert {"rudc", "rudc.errors"} < modules
    used = {module: strangers(at_once(module)) for module in modules}
    assert {module: more for module, names in used.items() if (more := names - CORE)} == {}
