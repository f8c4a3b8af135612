"""`rudc sweep --resume --out DIR` alone: the folder says what is to be done."""

import json
import shutil
from pathlib import Path

import pytest

from rudc.data import shipped_networks

SHORT = ("--set", "episode.timeout=0.5", "--workers", "1", "--quiet")
ALONE = ("sweep", "--resume", "--workers", "1", "--quiet", "--out")


def seeds(file):
    return [line.split(",")[2] for line in file.read_text().splitlines()[1:]]


def test_scenarios_agents_and_swept_values_come_from_the_folder(rudc, tmp_path):
    given = ("random_destination", "--agent", "follower", "--set", "traffic.density=[10, 20]", *SHORT)
    assert rudc("sweep", *given, "--episodes", "3", "--seed", "7", "--out", "at_once").status == 0
    assert rudc("sweep", *given, "--episodes", "2", "--seed", "7", "--out", "swept").status == 0
    rows = tmp_path / "swept" / "episodes.csv"
    lines = rows.read_text().splitlines(keepends=True)
    rows.write_text("".join(lines[:-1]))  # as a kill leaves it
    assert rudc(*ALONE, "swept").status == 0
    assert seeds(rows) == ["7", "8", "7", "8"]
    assert rudc(*ALONE, "swept", "--episodes", "3").status == 0
    same = [(tmp_path / folder / "manifest.json").read_text() for folder in ("swept", "at_once")]
    assert (seeds(rows), same[0]) == (["7", "8", "9"] * 2, same[1])


@pytest.fixture
def network(tmp_path):
    file = tmp_path / "mine" / "own.net.xml"
    file.parent.mkdir()
    shutil.copy(shipped_networks()["four_way"], file)
    return file


def scenario(tmp_path, rest=""):
    file = tmp_path / "own.yaml"
    file.write_text(f"name: own\nextends: random_destination\nnetwork: mine/own.net.xml\n{rest}")
    return str(file)


def test_networks_come_from_the_folder_which_may_have_been_moved(rudc, tmp_path, network):
    own = scenario(tmp_path)
    assert rudc("sweep", own, "--agent", "follower", *SHORT, "--episodes", "1", "--out", "swept").status == 0
    shutil.move(tmp_path / "swept", tmp_path / "moved")
    network.unlink()
    copies = sorted((tmp_path / "moved" / "networks").rglob("*"))
    assert rudc(*ALONE, "moved", "--episodes", "2").status == 0
    assert seeds(tmp_path / "moved" / "episodes.csv") == ["0", "1"]
    assert sorted((tmp_path / "moved" / "networks").rglob("*")) == copies  # no copies of copies
    assert rudc("sweep", "--verify", "moved", "--share", "1", "--workers", "1").status == 0


def test_swept_networks_keep_the_paths_by_which_rows_name_them(rudc, tmp_path, network):
    own = scenario(tmp_path, "sweep: {network: [mine/own.net.xml, four_way]}\n")
    assert rudc("sweep", own, "--agent", "follower", *SHORT, "--episodes", "1", "--out", "swept").status == 0
    assert rudc(*ALONE, "swept", "--episodes", "2").status == 0
    assert seeds(tmp_path / "swept" / "episodes.csv") == ["0", "1"] * 2
    network.unlink()
    lost = rudc(*ALONE, "swept", "--episodes", "3")
    assert (lost.status, "'own' of swept cannot be read any more: network: no such" in lost.err) == (2, True)


def test_another_seed_is_refused_and_so_is_a_folder_without_a_sweep(rudc, tmp_path):
    given = ("random_destination", "--agent", "follower", *SHORT)
    assert rudc("sweep", *given, "--episodes", "1", "--out", "swept").status == 0
    other = rudc(*ALONE, "swept", "--seed", "3")
    assert (other.status, "seed: 0 there, 3 here" in other.err) == (2, True)
    none = rudc(*ALONE, "nowhere")
    assert (none.status, "which scenarios? nowhere holds no sweep to go on with" in none.err) == (2, True)
    assert not (tmp_path / "nowhere").exists()
    manifest = tmp_path / "swept" / "manifest.json"
    told = json.loads(manifest.read_text())
    manifest.write_text(json.dumps({**told, "configuration": {**told["configuration"], "search": {}}}))
    search = rudc(*ALONE, "swept")
    assert (search.status, "swept is the folder of a search" in search.err) == (2, True)


def test_an_agent_of_ones_own_that_is_not_there_is_named_with_where_it_was(rudc, tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(
        "class Own:\n    def reset(self, scene, seed): pass\n    def act(self, scene): return 0, 0\n"
    )
    given = ("random_destination", "--agent", "own.py:Own", *SHORT, "--episodes", "1")
    assert rudc("sweep", *given, "--out", "swept").status == 0
    assert rudc(*ALONE, "swept", "--episodes", "2").status == 0
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    lost = rudc(*ALONE, "../swept", "--episodes", "3")
    assert (lost.status, "relative to the folder in which the sweep was started" in lost.err) == (2, True)


def test_a_checkpoint_that_is_there_and_wrong_is_not_said_to_be_elsewhere(rudc, tmp_path):
    agent = "many/sac-seed0+ttcbf"
    shutil.copytree(Path(__file__).parents[2] / "results" / "checkpoints" / "sac", "many/sac-seed0")
    given = ("random_destination", "--agent", agent, *SHORT, "--episodes", "1")
    assert rudc("sweep", *given, "--out", "swept").status == 0
    (tmp_path / "many" / "sac-seed0" / "agent.json").write_text("{")
    for command in ((*ALONE, "swept"), ("replay", "swept", "--episode", "1", "--out", "x.html")):
        wrong = rudc(*command)
        assert (wrong.status, "agent.json" in wrong.err, "named relative" in wrong.err) == (2, True, False)
    shutil.rmtree("many")
    assert f"{agent} is named relative to the folder in which" in rudc(*ALONE, "swept").err


def test_a_strangers_file_of_the_same_name_is_not_run(rudc, tmp_path, monkeypatch):
    own = "class Own:\n    def reset(self, scene, seed): ...\n    def act(self, scene): return 0, 0\n"
    (tmp_path / "own.py").write_text(own)
    assert (
        rudc("sweep", "random_destination", "-a", "own.py:Own", "-n", "1", *SHORT, "-o", "swept").status == 0
    )
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "own.py").write_text(f"{own}open('ran', 'w').close()\n")
    monkeypatch.chdir(elsewhere)
    ended = rudc(*ALONE, "../swept", "--episodes", "2")
    assert ended.status == 2
    assert "own.py is not the file that the sweep's agent own.py:Own was made of" in ended.err
    assert not (elsewhere / "ran").exists()
    (elsewhere / "own.py").write_text(own)
    assert rudc(*ALONE, "../swept", "--episodes", "2").status == 0


def test_to_a_folder_without_a_sweep_nothing_is_added(rudc, tmp_path):
    for given, missing in ((("--agent", "follower"), "scenarios"), (("jaywalkers",), "agents")):
        refused = rudc("sweep", *given, "--resume", "--out", "mispelt")
        assert refused.status == 2
        assert f"which {missing}? mispelt holds no sweep to go on with; give" in refused.err
    assert not (tmp_path / "mispelt").exists()


def test_agents_and_scenarios_are_added(rudc, tmp_path):
    given = ("random_destination", "--agent", "follower", *SHORT, "--episodes", "1")
    assert rudc("sweep", *given, "--out", "swept").status == 0
    added = rudc("sweep", "--agent", "sumo", "--resume", "--workers", "1", "--out", "swept")
    assert (added.status, "adding sumo to the sweep in swept" in added.err) == (0, True)
    more = ("dense_left_turn", "--set", "episode.timeout=0.6", "--workers", "1", "--resume", "--out", "swept")
    assert rudc("sweep", *more).status == 0
    rows = (tmp_path / "swept" / "episodes.csv").read_text().splitlines()[1:]
    assert [line.split(",")[:2] for line in rows] == [
        [scenario, agent]
        for scenario in ("random_destination", "dense_left_turn")
        for agent in ("follower", "sumo")
    ]
    both = ("crossing_cyclists", "--agent", "planner", "--set", "episode.timeout=0.6", "--workers", "1")
    assert rudc("sweep", *both, "--resume", "--out", "swept").status == 0  # one episode of each, as before
    assert len((tmp_path / "swept" / "episodes.csv").read_text().splitlines()) == 1 + 9
    alone = rudc(*ALONE, "swept", "--set", "traffic.density=3")
    assert (alone.status, "not those of swept: name scenarios" in alone.err) == (2, True)
    wrong = rudc(*ALONE, "swept", "--agent", "plannr")
    assert (wrong.status, "did you mean 'planner'?" in wrong.err) == (2, True)
    assert rudc("sweep", "--verify", "swept", "--share", "1", "--workers", "1").status == 0
