"""A search's folder: violations of real episodes, run again from their files; same rows after a stop."""

import contextlib
import errno
import shutil
from dataclasses import replace

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.errors import InputError, StorageError, SweepError
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.search import search
from rudc.evaluation.search.folder import SearchFolder, SearchPlan
from rudc.evaluation.search.search import run_search
from rudc.evaluation.search.space import space_of
from rudc.evaluation.store import RowFile, read_table
from rudc.evaluation.tasks import Task
from rudc.scenario import load_scenario, shipped_scenarios

FAULTY = '''
from rudc.env.tracking import steering


class Fast:
    """Leaves the road where it starts fast."""

    def reset(self, scene, seed):
        self.off = scene.ego.v > 9.0

    def act(self, scene):
        return 0.0, 0.5 if self.off else steering(scene)
'''


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """Episodes in this process: what workers do, without their start."""

    @contextlib.contextmanager
    def in_process(workers, limit_s, make_runner):
        run = make_runner()
        yield lambda tasks: ((task, run(task)) for task in tasks)
        getattr(run, "close", lambda: None)()

    monkeypatch.setattr(search, "local_workers", in_process)


class Stub:
    """Collides in a corner of two keys; the gap shrinks towards it. May be stopped after some episodes."""

    def __init__(self, most=10**9):
        self.left = most

    def __call__(self, task):
        if not self.left:
            raise KeyboardInterrupt
        self.left -= 1
        ego = task.scenario.ego
        beside = max(9.96 - float(ego.speed), 0.0) + max(float(ego.distance) - 35.1, 0.0)
        return EpisodeRecord(
            {
                "scenario": task.scenario.name,
                "agent": task.agent,
                "seed": task.seed,
                "outcome": "collision" if beside == 0.0 else "success",
                "fault": "ego" if beside == 0.0 else "",
                "min_dtc_m": round(0.1 + beside, 6),
            }
        )


def planned(episodes, agent="follower", scenario="random_destination", over=()):
    loaded = load_scenario(scenario, {key: {"uniform": ends} for key, ends in dict(over).items()})
    return SearchPlan(loaded, agent, episodes, 7, space_of(loaded, dict(over)))


def test_what_is_drawn_once_an_episode_is_searched():
    assert list(planned(1).space.axes) == ["ego.speed", "ego.distance"]  # not traffic.speed: anew for each SV
    over = {"traffic.density": [5, 40]}
    assert list(planned(1, over=over, scenario="icy_junction").space.axes) == [
        "ego.speed",
        "ego.distance",
        "traffic.density",
        "events.0.friction",
    ]
    assert list(planned(1, over={"traffic.speed": [6, 10]}).space.axes)[-1] == "traffic.speed"
    with pytest.raises(InputError, match=r"sweeps traffic\.density"):
        planned(1, scenario="density_sweep")
    assert "traffic.density" in planned(1, over=over, scenario="density_sweep").space.axes
    with pytest.raises(InputError, match=r"--over ego\.speed: not a number with a low and a greater high"):
        planned(1, over={"ego.speed": [8, 8]})
    fixed = dict.fromkeys(("ego.speed", "ego.distance"), 8)
    with pytest.raises(InputError, match=r"draws no number .* --over 'KEY=\[low, high\]' says which"):
        space_of(load_scenario("random_destination", fixed), {})


@pytest.mark.parametrize("name", [name for name in shipped_scenarios() if name != "density_sweep"])
def test_all_that_a_shipped_scenario_draws_once_can_be_set(name, tmp_path):
    scenario = load_scenario(name)
    space = space_of(scenario, {})
    for z in (-30.0, -8.5, 0.3, 30.0):
        fixed = space.fixed(scenario, space.values(np.full(len(space.axes), z)))
        with pytest.raises(InputError, match="draws no number"):
            space_of(fixed, {})
        (tmp_path / "fixed.yaml").write_text(fixed.to_yaml())
        assert load_scenario(tmp_path / "fixed.yaml").digest == fixed.digest


OVERLAPPING = """
name: contra
events:
  - kind: hard_brake
    deceleration: {normal: [7, 1]}
    when: {simulation_time: {above: {uniform: [0, 6]}, below: {uniform: [3, 9]}}}
"""


def test_thresholds_that_contradict_each_other_in_a_draw_end_no_search(tmp_path):
    (tmp_path / "contra.yaml").write_text(OVERLAPPING)
    scenario = load_scenario(tmp_path / "contra.yaml")
    keys = [f"events.0.{key}" for key in ("when.simulation_time.above", "when.simulation_time.below")]
    assert [*space_of(scenario, {}).axes][2:] == [*keys, "events.0.deceleration"]

    class Late(Stub):
        def __call__(self, task):
            time = task.scenario.events[0].when.simulation_time
            late = time.above is None
            assert late or float(time.above) < float(time.below)
            assert not any(time.holds(0.1 * step) for step in range(100)) or not late
            return EpisodeRecord(
                {"agent": "a", "seed": task.seed, "outcome": "off_road" if late else "success"}
            )

    found = run_search(planned(48, scenario=tmp_path / "contra.yaml"), tmp_path / "x", Late)
    assert found.violations
    assert found.episodes == 48
    for row in read_table(tmp_path / "x" / "failures.csv"):
        assert float(row[keys[0]]) >= float(row[keys[1]])
        again = load_scenario(tmp_path / "x" / row["file"])
        assert not again.events[0].when.simulation_time.holds(0.0)


def test_a_planted_fault_is_found_and_a_search_goes_on_where_it_stopped(tmp_path):
    found = run_search(planned(500), tmp_path / "once", Stub)
    assert len(found.violations) > 50
    assert found.kinds == {"collision (fault: ego)": len(found.violations)}
    assert found.rate.low < 1e-4 < found.rate.ceiling
    assert set(found.region.bounds) == {"ego.speed", "ego.distance"}
    with pytest.raises(KeyboardInterrupt):
        run_search(planned(500), tmp_path / "twice", lambda: Stub(130))
    with pytest.raises(SweepError, match="add --resume"):
        run_search(planned(500), tmp_path / "twice", Stub)
    with pytest.raises(SweepError, match="holds another search;"):
        run_search(planned(480), tmp_path / "twice", Stub, resume=True)
    assert run_search(planned(500), tmp_path / "twice", lambda: Stub(370), resume=True) == found
    assert_same(tmp_path / "once", tmp_path / "twice")


def test_episodes_can_be_added_whatever_their_number(tmp_path):
    whole = run_search(planned(190), tmp_path / "whole", Stub)
    for episodes in (5, 130, 145):
        run_search(planned(episodes), tmp_path / "grown", Stub, resume=True)
        run_search(planned(episodes), tmp_path / str(episodes), Stub)
        assert_same(tmp_path / "grown", tmp_path / str(episodes))
    assert run_search(planned(190), tmp_path / "grown", lambda: Stub(45), resume=True) == whole
    assert_same(tmp_path / "grown", tmp_path / "whole")


def assert_same(a, b):
    for name in ("evaluations.csv", "failures.csv", "manifest.json"):
        assert (a / name).read_bytes() == (b / name).read_bytes()


def test_a_search_that_has_nothing_left_to_run_has_no_further_version(tmp_path, monkeypatch):
    run_search(planned(5), tmp_path, Stub)
    before = (tmp_path / "manifest.json").read_bytes()
    monkeypatch.setattr("rudc.evaluation.manifest.code_version", lambda: "v1")
    run_search(planned(5), tmp_path, Stub, resume=True)
    assert (tmp_path / "manifest.json").read_bytes() == before
    run_search(planned(6), tmp_path, Stub, resume=True)
    assert b'"resumed_with"' in (tmp_path / "manifest.json").read_bytes()


def test_rows_that_were_edited_are_refused(tmp_path):
    run_search(planned(25), tmp_path / "x", Stub)
    rows = tmp_path / "x" / "evaluations.csv"
    text = rows.read_text().split("\n")
    cells = text[3].split(",")
    cells[text[0].split(",").index("ego.speed")] = "7.5"
    text[3] = ",".join(cells)
    rows.write_text("\n".join(text))
    with pytest.raises(SweepError, match="seed 9 is not what this search asks for"):
        run_search(planned(25), tmp_path / "x", Stub, resume=True)
    before = (tmp_path / "x" / "manifest.json").read_bytes()
    with pytest.raises(SweepError, match="seed 9 is not what this search asks for"):
        run_search(planned(40), tmp_path / "x", Stub, resume=True)
    assert (tmp_path / "x" / "manifest.json").read_bytes() == before


def test_a_full_disk_ends_a_search_and_keeps_what_is_there(tmp_path, monkeypatch):
    real, written = RowFile._write, []

    def full(file, data):
        written.append(data)
        if len(written) > 30:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(file, data)

    with monkeypatch.context() as patch:
        patch.setattr(RowFile, "_write", full)
        with pytest.raises(StorageError, match=r"the disk is full\. .* are kept; .* with --resume"):
            run_search(planned(50), tmp_path / "x", Stub)
    assert len(read_table(tmp_path / "x" / "evaluations.csv")) == 30
    found = run_search(planned(50), tmp_path / "x", lambda: Stub(20), resume=True)
    assert found == run_search(planned(50), tmp_path / "whole", Stub)


def test_an_episode_that_cannot_be_run_is_said_and_counts_for_nothing(tmp_path):
    class Faulty(Stub):
        def __call__(self, task):
            if task.seed == 10:
                return EpisodeRecord.failed("random_destination", "follower", 10, "ValueError: no", "lines")
            return super().__call__(task)

    found = run_search(planned(30), tmp_path / "x", Faulty)
    assert found.episodes == 29
    assert found.errors == ("ValueError: no; traceback in errors/10.txt",)
    assert (tmp_path / "x" / "errors" / "10.txt").read_text() == "ValueError: no\n\nlines"


def test_seeds_that_no_float_holds_are_kept(tmp_path):
    plan = replace(planned(3), seed=2**53)
    assert run_search(plan, tmp_path / "x", Stub).episodes == 3
    rows = read_table(tmp_path / "x" / "evaluations.csv")
    assert [int(row["seed"]) for row in rows] == [2**53, 2**53 + 1, 2**53 + 2]


def test_two_cannot_write_to_one_folder(tmp_path):
    with SearchFolder(tmp_path, planned(2)) as first:
        first.open(resume=False)
        with pytest.raises(InputError, match="another rudc is writing"):
            run_search(planned(2), tmp_path, Stub, resume=True)
    assert run_search(planned(2), tmp_path, Stub, resume=True).episodes == 2


@pytest.mark.slow
def test_a_violation_is_the_same_run_again_from_its_file(tmp_path):
    (tmp_path / "fast.py").write_text(FAULTY)
    shutil.copy(data_folder("sumo_networks") / "four_way" / "four_way.net.xml", tmp_path / "mine.net.xml")
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nextends: random_destination\nnetwork: mine.net.xml\ntraffic: {density: 4}\n"
    )
    agent = f"{tmp_path / 'fast.py'}:Fast"
    plan = planned(8, agent, tmp_path / "mine.yaml", {"traffic.density": [0, 4]})
    found = run_search(plan, tmp_path / "found", EpisodeRunner)
    assert found.violations
    assert not found.errors
    (tmp_path / "mine.net.xml").unlink()  # the folder has a copy
    with contextlib.closing(EpisodeRunner()) as run:
        for row in read_table(tmp_path / "found" / "failures.csv"):
            scenario = load_scenario(tmp_path / "found" / row["file"])
            again = run(Task(scenario, {}, agent, int(row["seed"])))
            assert row["outcome"] in ("off_road", "wrong_way")
            for column in ("outcome", "steps", "route_completion", "mean_speed_mps", "min_dtc_m", "fault"):
                assert again.text(column) == row[column]
