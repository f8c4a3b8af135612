"""Rectangles of rudc/kernels.py against rudc/geometry.py; when kernels are loaded, and from where."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import rudc
from rudc import kernels
from rudc.data import data_folder
from rudc.files import user_cache
from rudc.geometry import gaps_between
from rudc.geometry import separation as numpys
from rudc.kernels import UNUSED_S, rectangle_gap, separation


def test_rectangles_are_as_far_apart_as_numpy_says():
    rng = np.random.default_rng(0)
    n = 300
    r = rng.uniform(-8, 8, n) + 1j * rng.uniform(-8, 8, n)
    facing, other = np.exp(1j * rng.uniform(-4, 4, (2, n)))
    half, its_half = rng.uniform(0.3, 4, (2, n, 2))
    rows = list(zip(r, facing, other, *half.T, *its_half.T, strict=True))
    wanted = numpys(r, facing, other, half, its_half)
    assert [separation(*row) for row in rows] == pytest.approx(wanted, abs=1e-12)
    nowhere = np.zeros((n, 2))
    there = np.stack([r.real, r.imag], axis=1)
    gaps = gaps_between(nowhere, np.angle(facing), 2 * half, there, np.angle(other), 2 * its_half)
    assert 20 < np.count_nonzero(gaps == 0) < n - 20
    assert [rectangle_gap(*row) for row in rows] == pytest.approx(gaps, abs=1e-12)


def test_only_workers_of_a_sweep_load_the_compiler(tmp_path):
    """And nobody does who does not drive; without it, little traffic is enough to wait for."""
    out, few = tmp_path / "out", tmp_path / "few"
    thin = [tmp_path / f"{name}.yaml" for name in ("blocked_left_turn", "icy_junction")]
    for file in thin:
        file.write_text(f"name: thin\nextends: {file.stem}\ntraffic: {{density: 2}}\n")
    few.mkdir()
    with (data_folder("results/checkpoints").parent / "ood" / "episodes.csv").open() as file:
        (few / "episodes.csv").write_text("".join(islice(file, 41)))
    commands = [
        ["--help"],
        ["scenario", "show", "dense_left_turn"],
        ["scenario", "validate", "no_such_file.yaml"],
        ["scenario", "validate", *map(str, thin)],
        ["table", str(few)],
        [
            "sweep",
            "dense_left_turn",
            "--agent",
            "rudc-t",
            "--episodes",
            "1",
            "--set",
            "episode.timeout=2",
            "--out",
            str(out),
        ],
    ]
    code = (
        "import json, sys\nfrom rudc.cli.main import main\nloaded = []\n"
        "for words in json.loads(sys.argv[1]):\n    sys.argv = ['rudc', *words]\n"
        "    try:\n        main()\n    except SystemExit:\n        pass\n"
        "    loaded += [words] * ('numba' in sys.modules)\nprint(json.dumps(loaded))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(commands)], capture_output=True, text=True, check=True
    )
    assert "gap-acceptance" in done.stdout
    assert json.loads(done.stdout.splitlines()[-1]) == []
    assert len((out / "episodes.csv").read_text().splitlines()) == 2


def test_the_first_call_puts_kernels_in_their_places_and_as_written_does_without():
    code = """
import sys
from rudc.kernels import as_written, rectangle_gap
from rudc.world import kernels

kept, where = rectangle_gap, (3.0 + 4.0j, 1.0 + 0.0j, 1.0j, 1.0, 2.0, 0.5, 0.25)
with as_written():
    written = rectangle_gap(*where)
print("numba" in sys.modules, kernels.rectangle_gap is kept)
compiled = kernels.rectangle_gap(*where)
print("numba" in sys.modules, kernels.rectangle_gap is not kept)
print(kept(*where) == compiled, abs(written - compiled) < 1e-12)
with as_written():
    print(kernels.rectangle_gap(*where) == compiled)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True", "True", "True", "True", "True"]


def test_setting_up_compiles_every_module_of_kernels():
    code = """
import sys
from rudc.evaluation.compiled import KERNELS
from importlib import import_module
for name in KERNELS:
    import_module(name)
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    root = Path(rudc.__file__).parent
    modules = {
        ".".join(file.relative_to(root.parent).with_suffix("").parts) for file in root.rglob("*kernels.py")
    }
    assert len(modules) > 10
    assert modules <= set(done.stdout.split())


def test_a_folder_for_compiled_code_is_found_where_nothing_can_be_written(tmp_path):
    """NUMBA_CACHE_DIR is where it says; one that cannot be made is passed over."""
    code = "from rudc.kernels import _folder\nprint(_folder())"
    blocked = tmp_path / "file"
    blocked.write_text("")
    for said, begins in ((tmp_path / "here", tmp_path / "here"), (blocked / "no", None)):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={"NUMBA_CACHE_DIR": str(said), "PATH": "", "HOME": str(tmp_path)},
        )  # fmt: skip
        folder = done.stdout.strip()
        assert "kernels-" in folder
        assert folder.startswith(str(begins)) if begins else not folder.startswith(str(blocked))


def test_who_interrupts_the_loading_can_go_on():
    code = """
from rudc import kernels
compiled, calls = kernels._compiled, []
def interrupted(function):
    calls.append(function)
    if len(calls) == 1:
        raise KeyboardInterrupt
    return compiled(function)
kernels._compiled = interrupted
separation, where = kernels.separation, (3.0 + 4.0j, 1.0 + 0.0j, 1.0j, 1.0, 2.0, 0.5, 0.25)
try:
    separation(*where)
except KeyboardInterrupt:
    print("interrupted")
print(separation(*where) == kernels.separation(*where))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["interrupted", "True"]


def test_threads_wait_for_each_other(tmp_path):
    code = """
import threading, time
from rudc import kernels
compiled = kernels._compiled
def slowly(function):
    time.sleep(0.3 * (function.__name__ == "separation"))  # others call it
    return compiled(function)
kernels._compiled = slowly
where = (3.0 + 4.0j, 1.0 + 0.0j, 1.0j, 1.0, 2.0, 0.5, 0.25)
calls = [(kernels.half_turn, (1.0,)), (kernels.separation, where), (kernels.rectangle_gap, where)]
threads = [threading.Thread(target=kernel, args=given) for kernel, given in calls]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.stderr == ""


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks")
def test_two_processes_compile_different_kernels_at_once_but_not_the_same(tmp_path):
    code = """
import sys
from rudc import kernels
for name in ("separation", "rectangle_gap"):
    with kernels._alone(getattr(kernels, name).written):
        print(name, flush=True)
"""
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    holds = "from rudc import kernels\nwith kernels._alone(kernels.rectangle_gap.written):\n"
    holds += "    print('held', flush=True)\n    input()"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": env}
    with subprocess.Popen([sys.executable, "-c", holds], **pipes) as first:
        assert first.stdout.readline() == "held\n"
        with subprocess.Popen([sys.executable, "-c", code], **pipes) as second:
            assert second.stdout.readline() == "separation\n"
            with pytest.raises(subprocess.TimeoutExpired):
                second.wait(0.4)
            first.communicate("\n")
            assert second.stdout.readline() == "rectangle_gap\n"


def test_a_constant_that_kernels_import_is_part_of_their_source(tmp_path):
    (tmp_path / "my_kernels.py").write_text("from rudc.some.where import (\n    STEP,\n)\n")
    (tmp_path / "some").mkdir()
    found = []
    for step in (0.5, 0.25, 0.5):
        (tmp_path / "some" / "where.py").write_text(f"STEP = {step}\n")
        found.append(kernels._source_digest(tmp_path))
    assert found[0] == found[2] != found[1]


def test_without_a_home_nothing_is_put_into_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert user_cache() is None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_cache() == tmp_path / "rudc"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no users by number")
def test_a_temporary_folder_that_somebody_else_made_is_passed_over(tmp_path, monkeypatch):
    mine, other = os.getuid(), os.getuid() + 1
    monkeypatch.setattr(kernels.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(kernels, "user_cache", lambda: None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr(kernels, "__file__", "/proc/nowhere/kernels.py")
    for user, found in ((mine, f"rudc-{mine}"), (other, "rudc-kernels-")):
        monkeypatch.setattr(os, "getuid", lambda user=user: user)
        folder = Path(kernels._folder.__wrapped__())
        assert folder.relative_to(tmp_path).parts[0].startswith(found)


def test_what_was_compiled_of_other_versions_goes_once_nobody_uses_it(tmp_path):
    own, used, unused = (tmp_path / f"kernels-{digit * 12}" for digit in "abc")
    others = tmp_path / "kernels-of-mine"
    for folder in (own, used, unused, others):
        folder.mkdir()
        (folder / "lock").touch()
        long_ago = time.time() - UNUSED_S - 60.0
        if folder != used:
            os.utime(folder / "lock", (long_ago, long_ago))
    kernels._remove_unused(own)
    assert {own, used, others} == {*tmp_path.iterdir()}
