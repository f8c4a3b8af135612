"""Command lines put together at random: every command and option, values that fit and values that do not."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer

from rudc.cli.commands import app
from tests.fuzz.fuzzer import Case, Fuzzer
from tests.fuzz.mutations import NUMBERS, scratched_text
from tests.fuzz.swept import finished_sweep

LEFT_OUT = ("--help", "--watch", "--gui", "--install-completion", "--show-completion")
"""what waits for somebody, or changes the user's shell"""
PATHS = (
    "new", "new/deep/er", "nowhere", "file.txt", "file.txt/x", "empty", "swept", "loop", "/proc/nothing/x",
    "/dev/null",
    "/dev/full", "", " ", ".", "\u00e9\u2028", "x" * 300, "x" * 5000, "a.png", "a.gif", "a.html", "a.csv",
    "a.xml", "a.net.xml",
    "own.yaml", "own.net.xml", "broken.py", "raises.py", "-", "new.json", "swept/manifest.json",
)  # fmt: skip
SCENARIOS = (
    "random_destination", "dense_left_turn", "own.yaml", "random_destinaton", "*", "*left*", "[", "**/*",
    "", "swept", "file.txt",
    "broken.yaml", "x" * 300, "four_way", "own.net.xml", "~", "-", "density_sweep",
)  # fmt: skip
AGENTS = (
    "follower", "gap-acceptance", "gap-acceptance+ttcbf", "planner", "sumo", "sumo+ecbf", "rudc-t",
    "rudc-e-seed1", "sac", "folower",
    "+ttcbf", "follower+", "follower+cbf", "rudc-t:", "rudc-t:correction.kind=none",
    "rudc-t:correction.d_safe=1e308",
    "rudc-t:correction.slack.gain=nan", "follower+ttcbf:correction.gate_step=1e-9",
    "gap-acceptance+ttcbf:correction.gate_horizon=1e12",
    "rudc-t:x.y=z", "rudc-t:correction=none", "rudc-t:=", "rudc-t:learner.members=0", "rudc-t:sigma=route",
    "swept", "empty", "loop",
    "fails.py:Fails", "fails.py:Fail", "fails.py:Fails(", "fails.py:Fails(speed=3)", "fails.py",
    "broken.py:X", "raises.py:X", "json:loads",
    "math:sqrt(-1)", "nowhere.py:X", "a:b", ":", "(", "", "x" * 5000, "follower:outlook.course=true",
    "follower:outlook.course=maybe",
)  # fmt: skip
SETTINGS = (
    "traffic.density", "ego.speed", "ego.distance", "ego.route", "ego.route.turn", "episode.timeout",
    "network", "events", "events.0",
    "traffic", "name", "sweep", "junction", "traffic.mix", "traffic.mix.car", "traffic.from",
    "traffic.from.north", "traffic.turns.left", "ego.route.from", "learner.batch",
    "learner.members", "learner.kind",
    "training.seed", "correction.d_safe", "correction.kind", "vehicles", "observation.vehicles",
    "action.kind", "steps", "envs", "",
    ".", "traffic..density", "traffic.densty", "x" * 300,
)  # fmt: skip
VALUES = (
    *NUMBERS, "[10, 20]", "[]", "[1, x]", "{uniform: [6, 10]}", "{uniform: [10, 6]}", "{", "*a", "&a [*a]",
    "null", "random", "left",
    "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", "four_way", "!!python/object:os.system x",
    "own.net.xml", "[" + "1, " * 3000 + "1]",
)  # fmt: skip
KNOWN: dict[str, tuple[str, ...]] = {
    "scenarios": SCENARIOS, "source": (*SCENARIOS, "four_way", "t_junction"), "files": SCENARIOS,
    "patterns": SCENARIOS,
    "scenario": SCENARIOS, "agents": AGENTS, "agent": AGENTS, "predictor": PATHS, "episodes": ("1", "2",
    *NUMBERS, "own:follower:1"),
    "style": ("csv", "markdown", "latex", "word"), "by": ("agent", "scenario,agent", "agent,,", "nothing",
    "outcome", "seed"),
    "metrics": ("SR", "SR,VR", "nothing", "all"), "algorithm": ("sac", "rudc", "dsac", "nobody"),
    "engine": ("local", "locl"),
    "device": ("cpu", "cuda", "cuda:9", "tpu"), "action": ("direct", "adjustment", "nothing"),
    "topic": ("hard_brake", "when", "nothing"),
    "imports": ("broken.py", "raises.py", "file.txt", "nowhere.py", "json", "no.such.module", "fails.py"),
    "budget": ("quick", "paper", "none"), "against": ("swept", "paper", "nothing"), "steps": ("1", "50",
    *NUMBERS),
    "junction": ("centre", "J1", ""), "limit": ("1", *NUMBERS), "share": ("0.5", "1", *NUMBERS),
}  # fmt: skip
"""values that fit an option's name, by that"""


def prepare(folder: Path) -> Callable[[random.Random, Path], Case]:
    """In a folder with a sweep, a scenario, agents and files that are none of these."""
    made = finished_sweep(folder)
    (made / "file.txt").write_text("nothing of use\n")
    (made / "broken.py").write_text("def (\n")
    (made / "raises.py").write_text("raise KeyError('on import')\n")
    (made / "broken.yaml").write_text("name: [\n")
    (made / "empty").mkdir()
    (made / "loop").symlink_to("loop")
    known = list(_commands(typer.main.get_command(app), ()))

    def make(rng: random.Random, place: Path) -> Case:
        shutil.copytree(made, place, dirs_exist_ok=True, symlinks=True)
        path, params = rng.choice(known)
        words = [*path]
        for param in params:
            if rng.random() < (0.9 if param.required else 0.3):
                words += _given(rng, param)
        kind = rng.choice(
            ("values", "values", "values", "without one", "doubled", "out of order", "scratched", "import")
        )
        return Case(kind, [tuple(_damaged(rng, kind, words, len(path)))], works=True)

    return make


def _commands(command: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    """Every command's words, and its parameters."""
    if hasattr(command, "commands"):
        for name, inner in command.commands.items():
            yield from _commands(inner, (*path, name))
    else:
        yield path, [param for param in command.params if not set(param.opts) & set(LEFT_OUT)]


def _given(rng: random.Random, param: Any) -> list[str]:
    """An option with its value, or one or more arguments."""
    if getattr(param, "is_flag", False):
        return [rng.choice(param.opts)]
    count = rng.choice((1, 1, 2)) if param.nargs == -1 or param.multiple else 1
    option = [rng.choice(param.opts)] if param.param_type_name == "option" else []
    return [word for _ in range(count) for word in (*option, _value(rng, param))]


def _value(rng: random.Random, param: Any) -> str:
    if param.name in ("overrides", "settings"):
        return f"{rng.choice(SETTINGS)}{rng.choice(('=', '=', '=', '', '=='))}{rng.choice(VALUES)}"
    kind = str(getattr(getattr(param, "type", None), "name", ""))
    fitting = KNOWN.get(param.name) or (NUMBERS if kind.startswith(("int", "float")) else PATHS)
    return rng.choice(fitting if rng.random() < 0.85 else (*PATHS, *NUMBERS, *VALUES))


def _damaged(rng: random.Random, kind: str, words: list[str], least: int) -> list[str]:
    """Words of a command line with one damage more; texts without zero bytes, which no command line holds."""
    at = rng.randrange(len(words))
    if kind == "without one":
        del words[at]
    elif kind == "doubled":
        words.insert(at, words[at])
    elif kind == "out of order":
        words.append(words.pop(min(least, len(words) - 1)))
    elif kind == "scratched" and words[at]:
        words[at] = scratched_text(rng, words[at])
    elif kind == "import":
        words = ["--import", rng.choice(KNOWN["imports"]), *words]
    return [word.replace("\0", "") for word in words if word not in LEFT_OUT]


FUZZER = Fuzzer("arguments", 2_000, prepare, patience_s=240.0)
