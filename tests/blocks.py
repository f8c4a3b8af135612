"""Code blocks of Markdown files, and how they are run: as their reader would, in an empty folder."""

import contextlib
import io
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rudc.cli.main import main

FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.M | re.S)
PLAIN = re.compile(r"(rudc|python) [^|&;$<\\\\]*$")
"""a line that is one command, with no more of bash than quotes, or `> FILE`"""
COMMENT = re.compile(r"(^|\s)\s*# .*")
QUICK = (
    " ".join(
        f"--set training.{key}"
        for key in (
            "envs=1",
            "seed_steps=25",
            "learning_starts=16",
            "round_decisions=25",
            "evaluation_episodes=0",
            "curriculum=null",
        )
    )
    + " --set learner.batch_size=16"
)
LESS = (
    (r"--steps \d+", "--steps 25"),
    (r"(--episodes |\bepisodes=)\d+", r"\g<1>1"),
    (r"(rudc (?:--import \S+ )?sweep .*--episodes \d+)", r"\1 --set episode.timeout=4"),
    (r"--workers \d+", "--workers 1"),
    (r"--seeds \d+", "--seeds 1"),
    (r" --envs \d+", ""),  # QUICK has it
    (r"rudc train (rudc-\S+|sac|dsac) ", rf"rudc train \1 {QUICK} "),
    (r"rudc train (rudc-\S+) ", r"rudc train \1 --set training.calibration_episodes=0 "),
    (r"_episodes=0(?=.* --out out/agent\b)", "_episodes=1"),  # its report shows them
)
"""what is run with smaller numbers -> which"""


class Block(NamedTuple):
    """A block with its language; blocks without one are not run: output, set-up, what needs a cluster."""

    language: str
    file: str
    """that it is the content of; empty if it is to be run"""
    text: str


def blocks_of(path: Path) -> list[Block]:
    """All with a language, in their order."""
    return [Block(*found) for found in FENCE.findall(path.read_text(encoding="utf-8"))]


def smaller(script: str) -> str:
    """The same commands, or Python, with few steps and episodes."""
    for long, short in LESS:
        script = re.sub(long, short, script)
    return script


def run_script(script: str, folder: Path) -> None:
    """Run a bash block; what fails in it fails."""
    scripts = Path(sys.executable).parent
    _run(
        ["bash", "-euo", "pipefail", "-c", script], folder, PATH=f"{scripts}{os.pathsep}{os.environ['PATH']}"
    )


def run_commands(script: str, folder: Path) -> None:
    """As `run_script`, but in this process, which has imported what each command would import anew.

    Blocks with more than plain commands go to bash; those with `--import`, whose entries would stay, to one
    process of their own.
    """
    lines = [line for line in (COMMENT.sub("", line) for line in script.splitlines()) if line.strip()]
    if not all(PLAIN.match(line) for line in lines):
        run_script(script, folder)
        return
    commands = [shlex.split(line) for line in lines]
    if any("--import" in words for words in commands):
        assert not any(">" in words for words in commands)
        run_apart(*commands, folder=folder)
        return
    for words in commands:
        words, file = (words[:-2], words[-1]) if ">" in words else (words, os.devnull)
        said = run_here(words, folder)
        (folder / file).write_text(said, encoding="utf-8")


SEVERAL = """
import gc, json, sys
gc.set_threshold(100_000)  # imports make no garbage
from rudc.cli.main import main

for sys.argv in json.loads(sys.stdin.read()):
    try:
        main()
    except SystemExit as ended:
        if ended.code:
            raise
"""


def run_apart(*commands: Sequence[object], folder: Path, before: str = "", **more: str) -> str:
    """Run commands, the name of each its first word, in one process of their own, where what they register
    stays: what they write to stdout, one after the other. Each must succeed. `before`: code that runs first;
    `more` of the environment.
    """
    told = json.dumps([[*map(str, words)] for words in commands])
    return _run([sys.executable, "-c", before + SEVERAL], folder, told, **more)


ONE_BY_ONE = """
import contextlib, gc, io, json, sys
gc.set_threshold(100_000)
from rudc.cli.main import main

answers = []
for sys.argv in json.loads(sys.stdin.read()):
    status = 0
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            main()
        except SystemExit as ended:
            status = ended.code or 0
    answers.append((status, out.getvalue(), err.getvalue()))
print(json.dumps(answers))
"""


class Answer(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str


def answers_apart(*commands: Sequence[object], folder: Path, **more: str) -> list[Answer]:
    """As `run_apart`, but they may fail: how each ended."""
    told = json.dumps([["rudc", *map(str, words)] for words in commands])
    said = _run([sys.executable, "-c", ONE_BY_ONE], folder, told, **more)
    return [Answer(*answer) for answer in json.loads(said)]


def run_here(words: list[str], folder: Path) -> str:
    """What a command, its name the first word, writes to stdout, run in this process; it must succeed.

    `python FILE` runs the file, by its whole path: processes that it starts import it, too.
    """
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    script = words[0] == "python"
    sys.argv, status = words[script:], None
    try:
        with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            if script:
                runpy.run_path(str(folder / words[1]), run_name="__main__")
            else:
                main()
    except SystemExit as ended:
        status = ended.code
    finally:
        sys.argv = before
    assert not status, f"{shlex.join(words)}\n{out.getvalue()}\n{err.getvalue()}"
    return out.getvalue()


def run_python_here(code: str, folder: Path) -> None:
    """Run Python code in this process."""
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        exec(compile(code, "block", "exec"), {"__name__": "block"})


def run_python(code: str, folder: Path) -> None:
    """Run Python code in a process of its own."""
    _run([sys.executable, "-c", code], folder)


def _run(command: list[str], folder: Path, told: str | None = None, **more: str) -> str:
    env = {**os.environ, **more}
    run = subprocess.run(
        command, cwd=folder, env=env, input=told, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, f"{told or command[-1]}\n{run.stdout}\n{run.stderr}"
    return run.stdout
