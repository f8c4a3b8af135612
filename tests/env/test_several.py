"""Several environments in one process, as people and libraries make them: nobody has to know of libsumo."""

import gc
import subprocess
import sys
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rudc
from rudc.errors import SimulationError
from rudc.world.isolated import IsolatedWorld
from rudc.world.world import World

COAST = np.array([1 / 3, 0.0], dtype=np.float32)


def test_two_side_by_side_drive_and_look_as_each_alone():
    here, apart = (
        gymnasium.make(rudc.ENV_ID, scenario="perfect_storm", render_mode="rgb_array") for _ in range(2)
    )
    (a, _), (b, info) = here.reset(seed=0), apart.reset(seed=0)
    np.testing.assert_array_equal(a, b)
    ended, steps = False, 0
    while not ended:
        mine, theirs = here.step(COAST), apart.step(COAST)
        np.testing.assert_array_equal(mine[0], theirs[0])
        assert mine[1:4] == theirs[1:4]
        info, ended, steps = theirs[4], mine[2] or mine[3], steps + 1
        assert info["scene"] == mine[4]["scene"]
        if steps == 20:
            np.testing.assert_array_equal(here.render(), apart.render())
    assert steps > 20
    assert info["metrics"] == mine[4]["metrics"]
    assert isinstance(here.unwrapped.episode.world, World)
    assert isinstance(apart.unwrapped.episode.world, IsolatedWorld)
    here.close()
    apart.close()


def test_a_vector_of_scenarios_with_and_without_events_ends():
    """Where both ended at once, Gymnasium could not put "no events are scripted" beside a number of them."""
    short = {"episode.timeout": 0.3, "ego.speed": 0.0}
    makers = [
        partial(gymnasium.make, rudc.ENV_ID, scenario=name, overrides=short)
        for name in ("jaywalkers", "random_destination")
    ]
    several = gymnasium.vector.SyncVectorEnv(makers)
    several.reset(seed=1)
    for _ in range(3):
        *_, ended, info = several.step(np.array([[-1.0, 0.0]] * 2, np.float32))
    several.close()
    assert ended.all()
    assert info["metrics"]["_events_fired"].tolist() == [True, False]
    assert info["cost"].dtype == np.float64


def test_a_dropped_environment_releases_its_world():
    env = gymnasium.make(rudc.ENV_ID)
    env.reset(seed=0)
    env = gymnasium.make(rudc.ENV_ID, isolated=False)  # a notebook's cell, run again
    gc.collect()
    env.reset(seed=0)
    env.close()


def test_a_cell_of_a_notebook_runs_as_often_as_one_likes():
    cell = (
        "import gymnasium, rudc\n"
        "env = gymnasium.make(rudc.ENV_ID, render_mode='rgb_array')\n"
        "env.reset(seed=0)\n"
        "frame = (env.step(env.action_space.sample()), env.render())[1]\n"
    )
    names = {}
    for _ in range(3):
        exec(cell, names)
        assert names["frame"].shape == (600, 600, 3)
    names["env"].close()


def test_a_second_environment_passes_gymnasiums_checks():
    first = gymnasium.make(rudc.ENV_ID)
    first.reset(seed=0)
    second = gymnasium.make(rudc.ENV_ID, overrides={"traffic.density": 2})
    check_env(second.unwrapped, skip_render_check=True)
    assert isinstance(second.unwrapped.episode.world, IsolatedWorld)
    second.close()
    first.close()


def test_closed_or_dead_and_reset_again():
    """It told to reset once its process had died, and then refused for ever."""
    first, second = gymnasium.make(rudc.ENV_ID), gymnasium.make(rudc.ENV_ID)
    observation, _ = first.reset(seed=0)
    np.testing.assert_array_equal(second.reset(seed=0)[0], observation)
    process = second.unwrapped.episode.world._process
    process.kill()
    with pytest.raises(SimulationError, match=r"has died .* reset the environment to start another"):
        second.step(COAST)
    np.testing.assert_array_equal(second.reset(seed=0)[0], observation)
    second.step(COAST)
    assert process.stdin.closed
    first.close()
    second.close()
    second.close()
    np.testing.assert_array_equal(second.reset(seed=0)[0], observation)
    second.close()


SCRIPT = """
import gymnasium, rudc
print("begins")
env = gymnasium.make("rudc/Intersection-v0", isolated=True)
env.reset(seed=0)
env.step(env.action_space.sample())
"""


def test_a_script_needs_no_main_guard(tmp_path):
    """As text neither: below."""
    file = tmp_path / "mine.py"
    file.write_text(SCRIPT, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-W", "error", str(file)], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "begins\n", "")


OWN = """
from typing import Literal
import gymnasium, numpy as np, rudc
from rudc.scenario.events import Event, Felt

class Zap(Event, frozen=True):
    kind: Literal["zap"]

class ZapEffect(Felt[Zap]):
    def begin(self, stage):
        stage.set_friction(0.3)
        return True

rudc.register_event(Zap, ZapEffect)

def drive(*kinds):
    ends = []
    for isolated in kinds:
        env = gymnasium.make("rudc/Intersection-v0", scenario="zap.yaml", isolated=isolated)
        env.reset(seed=3)
        _, reward, *_, info = env.step(np.array([1.0, 0.0], np.float32))
        ends.append((reward, info["scene"].ego.v, env.unwrapped.episode.metrics().events_fired))
    print(ends[0] == ends[1], ends[0][2])

"""


@pytest.mark.parametrize(
    ("end", "as_text", "told"),
    [
        ("if __name__ == '__main__': drive(False, True)", False, ()),
        (
            "drive(False, True)",
            False,
            (
                "must import Zap, which stands in the script itself: WorldBusyError",
                "Put the code that drives under `if __name__ == '__main__':`, or Zap into a module",
            ),
        ),
        (
            "env.reset(seed=3, options={'scenario': 'zap.yaml'})",
            True,
            ("a notebook or a console cannot be imported. Put Zap into a module",),
        ),
    ],
    ids=["with a guard", "without", "as text"],
)
def test_an_event_of_the_script_itself(tmp_path, end, as_text, told):
    (tmp_path / "zap.yaml").write_text("name: zap\nextends: dense_left_turn\nevents: [{kind: zap}]\n")
    file = tmp_path / "mine.py"
    file.write_text(OWN + end, encoding="utf-8")
    how = ["-W", "error", "-c", SCRIPT + OWN + end] if as_text else [str(file)]
    run = subprocess.run(
        [sys.executable, *how], capture_output=True, text=True, check=False, cwd=tmp_path
    )  # fmt: skip
    assert all(words in run.stderr for words in told)
    if as_text:  # what comes before the event drives
        assert (run.stdout, run.stderr.partition("\n")[0]) == (
            "begins\n",
            "Traceback (most recent call last):",
        )
    if not told:
        assert (run.returncode, run.stdout) == (0, "True 1\n"), run.stderr


def test_an_event_of_a_file_that_was_imported_first(tmp_path):
    (tmp_path / "zap.yaml").write_text("name: zap\nextends: dense_left_turn\nevents: [{kind: zap}]\n")
    (tmp_path / "zaps.py").write_text(OWN, encoding="utf-8")
    text = "from rudc.imports import import_first, import_source; import_first('zaps.py')"
    run = subprocess.run(
        [sys.executable, "-c", f"{text}; import_source('zaps.py').drive(False, True)"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert (run.returncode, run.stdout) == (0, "True 1\n"), run.stderr


@pytest.mark.parametrize(
    "text",
    [
        "import gymnasium; gymnasium.make('rudc.env:rudc/Intersection-v0')",
        "import rudc, sys; assert 'libsumo' not in sys.modules and 'rudc.env' not in sys.modules; "
        "import gymnasium; gymnasium.make('rudc/Intersection-v0')",
    ],
    ids=["by its module", "by its id"],
)
def test_it_is_registered(text):
    run = subprocess.run([sys.executable, "-W", "error", "-c", text], capture_output=True, check=False)
    assert (run.returncode, run.stderr) == (0, b"")
