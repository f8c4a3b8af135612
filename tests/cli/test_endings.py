"""How commands end: by signals, for want of a cluster, for a path that is too long.

A sweep by Ctrl-C: test_commands.py.
"""

import io
import os
import signal
import subprocess
import sys
import time
from functools import partial
from multiprocessing import Pipe
from types import SimpleNamespace
from typing import Any

import pytest

from rudc.cli.main import main
from rudc.errors import InputError
from rudc.evaluation.ray_engine import _refuse_silent
from rudc.training.trainer import Trainer
from rudc.training.workers import _work

RUDC = [sys.executable, "-m", "rudc"]


@pytest.mark.parametrize(("command", "number"), [("sweep", signal.SIGTERM), ("search", signal.SIGINT)])
def test_a_command_that_is_ended_keeps_what_is_finished(tmp_path, command, number):
    out = tmp_path / "out"
    begun = [*RUDC, command, "random_destination", "-a", "follower", "-n", "2000", "-w", "1", "-o", str(out)]
    heard = partial(signal.signal, number, signal.SIG_DFL)  # also where the tests run under nohup
    process = subprocess.Popen(begun, stderr=subprocess.PIPE, text=True, preexec_fn=heard)
    deadline = time.monotonic() + 120
    rows = out / ("episodes.csv" if command == "sweep" else "evaluations.csv")
    while not rows.exists() or rows.read_bytes().count(b"\n") < 2:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"interrupted; what is finished is kept in {out}: add --resume to go on" in told
    assert "Traceback" not in told


def test_a_run_that_is_interrupted_says_so(rudc, tmp_path):
    """By Ctrl-C, or by its agent."""
    (tmp_path / "ends.py").write_text(
        "class Ends:\n    def reset(self, scene, seed): ...\n"
        "    def act(self, scene): raise KeyboardInterrupt\n"
    )
    answer = rudc("run", "random_destination", "-a", "ends.py:Ends")
    assert (answer.status, answer.out, answer.err) == (130, "", "interrupted\n")


@pytest.mark.slow
def test_a_training_that_is_ended_says_what_is_kept(tmp_path):
    """Its workers hear the signal, too, as where a terminal closes. SIGTERM: the test below."""
    out = tmp_path / "out"
    small = ("seed_steps=25", "round_decisions=25", "checkpoint_every=50", "curriculum=null")
    settings = [part for value in small for part in ("--set", f"training.{value}")]
    begun = [*RUDC, "train", "sac", "--envs", "1", *settings, "-o", str(out)]

    def heard():
        os.setpgrp()
        signal.signal(signal.SIGHUP, signal.SIG_DFL)

    process = subprocess.Popen(begun, stderr=subprocess.PIPE, text=True, preexec_fn=heard)
    deadline = time.monotonic() + 120
    while not (out / "checkpoint").exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGHUP)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"interrupted; the last checkpoint is kept in {out / 'checkpoint'}" in told
    assert "add --resume to go on" in told
    assert "Traceback" not in told


def test_a_training_takes_both_signals_alike(monkeypatch):
    """Each ends it after the round; its workers leave that to it."""
    both, missed, heard = (signal.SIGTERM, signal.SIGHUP), [], []
    before = {number: signal.signal(number, lambda *given: missed.append(given)) for number in both}
    trainer: Any = Trainer.__new__(Trainer)
    trainer._watcher = SimpleNamespace(note=heard.append)
    try:
        for number in both:
            trainer._stop = False
            with trainer._interruptible():
                signal.raise_signal(number)
            assert trainer._stop
        pipe, other = Pipe()
        other.close()
        monkeypatch.setattr("rudc.training.workers.Collector", lambda *_: pipe.recv())  # ends at once
        _work(pipe, trainer, 0)
        assert [signal.getsignal(number) for number in both] == [signal.SIG_IGN] * 2
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert heard == ["interrupted, finishing this round"] * 2
    assert not missed


def test_a_path_that_is_too_long_is_wrong_input(rudc, tmp_path):
    for command in (
        ["table", "x" * 5000],
        ["scenario", "validate", "x" * 5000 + ".yaml"],
        ["run", "random_destination", "--fcd", str(tmp_path / ("x" * 500) / "a.xml")],
        ["network", "check", "x" * 5000 + ".net.xml"],
        ["sweep", "random_destination", "-a", "follower", "-n", "1", "-o", str(tmp_path / ("x" * 500))],
    ):
        answer = rudc(*command)
        assert answer.status == 2, answer.err
        assert answer.err.startswith("error: "), answer.err[:300]


def test_fcd_makes_its_folder(rudc, tmp_path):
    file = tmp_path / "new" / "fcd.xml"
    command = ("run", "random_destination", "-a", "follower", "--set", "episode.timeout=1")
    assert rudc(*command, "--fcd", file).status == 0
    assert file.stat().st_size > 100


@pytest.mark.parametrize("port", ["\u00b2", "9" * 5000])
def test_a_port_that_is_no_number_is_no_cluster(port):
    with pytest.raises(InputError, match=r"no cluster at RAY_ADDRESS=127\.0\.0\.1:"):
        _refuse_silent(f"127.0.0.1:{port}")


def test_no_cluster_is_said_at_once_and_before_the_folder_is_touched(tmp_path):
    pytest.importorskip("ray")
    out = tmp_path / "out"
    sweep = [*RUDC, "sweep", "random_destination", "-a", "follower", "-n", "1", "-o", str(out)]
    began = time.monotonic()
    done = subprocess.run(
        [*sweep, "--engine", "ray"], capture_output=True, text=True,
        env={**os.environ, "RAY_ADDRESS": "127.0.0.1:9"},
    )  # fmt: skip
    assert done.returncode == 2
    assert "no cluster at RAY_ADDRESS=127.0.0.1:9" in done.stderr
    assert time.monotonic() - began < 30  # 10, and this machine's mood
    assert not out.exists()


@pytest.mark.parametrize(("errors", "written"), [("strict", b"caf\xe9 \\u2192"), ("replace", b"caf\xe9 ?")])
def test_signs_that_the_output_cannot_have_are_spelled_out(monkeypatch, tmp_path, errors, written):
    (tmp_path / "a.yaml").write_text("caf\u00e9 \u2192", encoding="utf-8")
    out = io.TextIOWrapper(io.BytesIO(), encoding="latin-1", errors=errors)
    monkeypatch.setattr("sys.stdout", out)
    monkeypatch.setattr("sys.argv", ["rudc", "scenario", "show", str(tmp_path / "a.yaml")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert out.buffer.getvalue() == written
