"""A sample of a finished sweep run again: same rows, other rows, and why they may be others."""

import json
import shutil
from pathlib import Path

import pytest

from rudc.errors import SweepError
from rudc.evaluation.folder import read_sweep
from rudc.evaluation.record import EpisodeRecord
from rudc.evaluation.rerun import Swept
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import ENGINES, Engine, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.verify import _sample, verify_sweep
from rudc.network.network import shipped_networks
from rudc.scenario import load_scenario


@pytest.fixture(scope="module", autouse=True)
def here():
    """The engine in this process: what workers do, without their start."""

    def engine(tasks, workers, limit_s, make_runner):
        run = make_runner()
        for task in tasks:
            yield task, run(task)
        run.close()

    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(ENGINES, "local", Engine(engine))
        yield


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A sweep of 12 short episodes, a learnt agent's among them, on a network of one's own."""
    folder = tmp_path_factory.mktemp("verify")
    shutil.copy(shipped_networks()["t_junction"], folder / "own.net.xml")
    (folder / "own.yaml").write_text(
        "name: own\nextends: random_destination\nnetwork: own.net.xml\nepisode: {timeout: 0.5}\n"
        "sweep: {traffic.density: [5, 15]}\n"
    )
    plan = SweepPlan((load_scenario(folder / "own.yaml"),), ("rudc-t", "gap-acceptance+ttcbf"), 3, 4)
    run_sweep(plan, folder / "swept", EpisodeRunner)
    return folder


@pytest.fixture
def copied(swept, tmp_path):
    shutil.copytree(swept, tmp_path, dirs_exist_ok=True)
    return tmp_path / "swept"


def _edit(folder, number, column, value):
    path = folder / "episodes.csv"
    lines = path.read_text().split("\n")
    cells = lines[number].split(",")
    cells[lines[0].split(",").index(column)] = value
    lines[number] = ",".join(cells)
    path.write_text("\n".join(lines))


def test_all_rows_come_out_the_same(copied):
    _edit(copied, 2, "decision_ms_mean", "1234.5")  # timing
    before = {path: path.read_bytes() for path in copied.rglob("*") if path.is_file()}
    found = verify_sweep(copied, EpisodeRunner, share=1.0)
    assert (found.of, found.again, list(found.other), found.changes) == (12, 12, [], ())
    assert {path: path.read_bytes() for path in copied.rglob("*") if path.is_file()} == before


def test_a_sample_is_a_share_drawn_by_the_seed(copied):
    for number in range(1, 13):
        _edit(copied, number, "steps", "7")  # so that every row is named
    drawn = []
    for seed in (0, 0, 1):
        found = verify_sweep(copied, EpisodeRunner, share=0.2, seed=seed)
        assert found.again == len(found.other) == 3
        drawn.append([rerun.number for rerun, _ in found.other])
    assert drawn[0] == drawn[1] != drawn[2]


def test_a_share_that_gives_a_whole_number_is_not_rounded_up(tmp_path):
    """0.07 * 100 is 7.000000000000001."""
    assert len(_sample([{"error": ""}] * 100, 0.07, 0, tmp_path).numbers) == 7


def test_reruns_that_fail_are_counted(copied):
    class Late(EpisodeRunner):
        def __call__(self, task):
            return EpisodeRecord.failed(task.scenario.name, task.agent, task.seed, "it takes too long")

    found = verify_sweep(copied, Late, share=0.25)
    assert (found.again, found.unfinished, len(found.other)) == (3, 3, 3)
    _edit(copied, 2, "steps", "7")
    assert verify_sweep(copied, EpisodeRunner, share=1.0).unfinished == 0


def test_what_differs_is_said_by_column_with_its_size(copied):
    rows, _ = read_sweep(copied)
    _edit(copied, 3, "mean_speed_mps", repr(float(rows[2]["mean_speed_mps"]) + 0.25))
    _edit(copied, 5, "mean_speed_mps", repr(float(rows[4]["mean_speed_mps"]) - 0.125))
    _edit(copied, 5, "outcome", "collision")
    found = verify_sweep(copied, EpisodeRunner, share=1.0)
    assert [rerun.number for rerun, _ in found.other] == [3, 5]
    outcome, speed = found.columns
    assert (outcome.column, outcome.episodes) == ("outcome", 1)
    assert (speed.column, speed.episodes, round(speed.largest, 6)) == ("mean_speed_mps", 2, 0.25)


def test_what_is_another_here_is_named(copied):
    path = copied / "manifest.json"
    content = json.loads(path.read_text())
    content["versions"] |= {"numpy": "0.1", "processor": "an abacus"}
    path.write_text(json.dumps(content))
    numpy, processor = sorted(verify_sweep(copied, EpisodeRunner).changes)
    assert numpy.startswith("numpy 0.1 -> ")
    assert processor.startswith("processor an abacus -> ")


def test_versions_that_the_sweep_was_resumed_with_are_named(copied):
    """Also where those of its first rows are the same here."""
    path = copied / "manifest.json"
    content = json.loads(path.read_text())
    content["resumed_with"] = [{**content["versions"], "numpy": "0.1"}]
    numpy = content["versions"]["numpy"]
    path.write_text(json.dumps(content))
    assert verify_sweep(copied, EpisodeRunner).changes == (
        f"its rows come from several versions: numpy {numpy} -> 0.1",
    )


def test_the_networks_are_the_sweeps_own_copies(copied, swept):
    """Replaced, or gone, the original changes nothing."""
    path = copied / "manifest.json"
    for replaced in (True, False):
        original = copied.parent / "own.net.xml"
        if replaced:
            shutil.copy(shipped_networks()["four_way"], original)
        else:
            original.unlink()
        path.write_text(path.read_text().replace(str(swept), str(copied.parent)))
        found = verify_sweep(copied, EpisodeRunner, share=0.1)
        assert not found.other
        assert not found.changes


@pytest.mark.parametrize("sweep", ["banana", {"network": "own.net.xml"}, {"network": 5}])
def test_a_manifest_whose_sweep_is_no_sweep_is_refused(copied, sweep):
    path = copied / "manifest.json"
    content = json.loads(path.read_text())
    content["configuration"]["scenarios"]["own"]["values"]["sweep"] = sweep
    path.write_text(json.dumps(content))
    with pytest.raises(SweepError, match=r"the scenario 'own' of .* cannot be read any more: sweep"):
        verify_sweep(copied, EpisodeRunner)


@pytest.mark.parametrize("share", [0.0, -1.0, 1.5, float("nan")])
def test_a_share_that_is_none_is_refused(copied, share):
    with pytest.raises(SweepError, match="more than 0 and at most 1"):
        verify_sweep(copied, EpisodeRunner, share=share)


def test_a_folder_without_finished_episodes_is_refused(copied):
    rows = copied / "episodes.csv"
    rows.write_text(rows.read_text().split("\n")[0] + "\n")
    with pytest.raises(SweepError, match="no finished episode"):
        verify_sweep(copied, EpisodeRunner)


def test_rows_that_failed_are_left_out_and_counted(copied):
    _edit(copied, 3, "error", "broke")
    _edit(copied, 3, "outcome", "")
    found = verify_sweep(copied, EpisodeRunner, share=1.0)
    assert (found.of, found.failed, found.again, list(found.other)) == (11, 1, 11, [])


def test_a_sweep_over_networks_of_ones_own_is_found_by_the_paths_it_was_given(tmp_path):
    """Two of one name and content are two points of it."""
    given = [str(tmp_path / folder / "own.net.xml") for folder in ("a", "b")]
    for path in given:
        Path(path).parent.mkdir()
        shutil.copy(shipped_networks()["t_junction"], path)
    scenario = load_scenario("random_destination", {"episode.timeout": 1}, grid={"network": given})
    run_sweep(SweepPlan((scenario,), ("follower",), 1, 0), tmp_path / "swept", EpisodeRunner)
    for path in given:
        Path(path).unlink()
    sweep = Swept(tmp_path / "swept")
    assert [sweep.episode(number).task.swept for number in (1, 2)] == [{"network": path} for path in given]
    found = verify_sweep(tmp_path / "swept", EpisodeRunner, share=1.0)
    assert (found.again, found.other, found.changes) == (2, [], ())


def test_networks_of_one_name_are_told_apart_by_their_paths(tmp_path, monkeypatch):
    """Of three such, no more than one assignment of copies is tried."""
    given = [str(tmp_path / f"j{k}" / "own.net.xml") for k in range(3)]
    text = shipped_networks()["t_junction"].read_text()
    for path in given:
        Path(path).parent.mkdir()
        Path(path).write_text(f"{text}<!-- {path} -->")
    scenario = load_scenario("random_destination", {"episode.timeout": 1}, grid={"network": given})
    run_sweep(SweepPlan((scenario,), ("follower",), 1, 0), tmp_path / "swept", EpisodeRunner)
    for path in given:
        Path(path).unlink()
    monkeypatch.setattr("rudc.evaluation.own_networks.TRIES", 1)
    sweep = Swept(tmp_path / "swept")
    for number, path in enumerate(given, start=1):
        again = sweep.episode(number)
        assert not again.changes
        assert path in Path(again.task.scenario.network).read_text()


@pytest.mark.parametrize("kept", ["apart", "flat", "both"])
def test_the_only_copy_of_a_network_is_taken_though_the_scenario_has_changed(copied, kept):
    """As in a folder of an earlier version: copies without a folder of their own, or twice, another digest,
    and a path that leads nowhere."""
    (copy,) = copied.glob("networks/*/own.net.xml")
    flat = copied / "networks" / "own.net.xml"
    if kept == "flat":
        copy = copy.rename(flat)
    elif kept == "both":
        copy = Path(shutil.copy(copy, flat))
    path = copied / "manifest.json"
    content = json.loads(path.read_text())
    said = content["configuration"]["scenarios"]["own"]
    said["digest"], said["values"]["network"] = "0" * 16, "networks/own.net.xml"
    path.write_text(json.dumps(content))
    again = Swept(copied).episode(1)
    assert again.task.scenario.network == str(copy)
    assert again.changes[0] == "the scenario, or a file that it names, means something else now"


def test_an_agent_that_keeps_something_from_one_episode_to_the_next_comes_out_differently(
    tmp_path, monkeypatch
):
    """Run again in the same order, each episode found what the one before had left."""
    (tmp_path / "tired.py").write_text(
        "class Tired:\n    episodes = 0\n    def reset(self, scene, seed): self.episodes += 1\n"
        "    def act(self, scene): return -0.5 * self.episodes, 0\n"
    )
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("random_destination", {"episode.timeout": 1})
    run_sweep(SweepPlan((scenario,), ("tired.py:Tired",), 4, 0), tmp_path / "swept", EpisodeRunner)
    found = verify_sweep(tmp_path / "swept", EpisodeRunner, share=1.0)
    assert found.again == 4
    assert found.other
