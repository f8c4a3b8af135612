"""`rudc run --replay` and `rudc replay`."""

import csv
import json
import shutil

import pytest

from rudc.errors import SweepError

WHICH = "random_destination:follower:0"


@pytest.fixture(scope="module")
def made(rudc_once, tmp_path_factory):
    """The folder of a sweep, which is left as it is."""
    out = tmp_path_factory.mktemp("made") / "swept"
    agents = ("-a", "follower", "-a", "follower+ttcbf")
    answer = rudc_once("sweep", "random_destination", *agents, "-n", 1, "-w", 1, "-o", out)
    assert answer.status == 0, answer.err
    return out


@pytest.fixture
def swept(rudc, made, tmp_path):
    """A copy of it in the test's folder."""
    return shutil.copytree(made, tmp_path / "swept")


def test_a_run_leaves_a_page_of_one_agent_or_two(rudc, tmp_path):
    answer = rudc("run", "random_destination", "--replay", "one.html")
    assert answer.status == 0, answer.err
    assert "gap-acceptance" in (tmp_path / "one.html").read_text(encoding="utf-8")
    answer = rudc("run", "random_destination", "-a", "follower", "-a", "sumo", "--replay", "two.html")
    assert answer.status == 0, answer.err
    assert answer.out.count("outcome") == 2
    assert (tmp_path / "two.html").read_text(encoding="utf-8").count("<section") == 2


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["-a", "sumo"], "2 agents were named"),
        (["-a", "sumo", "-a", "gap-acceptance", "--replay", "x.html"], "3 agents were named"),
        (["-a", "sumo", "--replay", "x.html", "--steps", "s.csv"], "--steps shows one agent"),
        (["--replay", "x.gif"], "a replay is an .html file"),
    ],
)
def test_what_cannot_be_beside_each_other_is_refused(rudc, tmp_path, more, says):
    answer = rudc("run", "random_destination", "-a", "follower", *more)
    assert answer.status == 2
    assert says in answer.err
    assert list(tmp_path.iterdir()) == []


FAILS = """
class Fails:
    def reset(self, scene, seed):
        self.late = seed == 1

    def act(self, scene):
        if not self.late or scene.time_s > 0.95:
            raise ValueError("enough")
        return 0.0, 0.0
"""


SLOW = """
class Slow:
    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return -0.1, 0.0
"""


def test_what_came_before_an_agent_failed_is_shown(rudc, tmp_path):
    (tmp_path / "fails.py").write_text(FAILS)
    rudc("sweep", "random_destination", "-a", "fails.py:Fails", "-n", 2, "-w", 1, "-o", "failed")
    answer = rudc("replay", "failed", "--episode", 2, "--out", "late.html")
    assert answer.status == 0, answer.err
    assert "raised ValueError: enough (fails.py:8); came out the same as row 2" in answer.err
    assert '"frames":10,' in (tmp_path / "late.html").read_text(encoding="utf-8")
    answer = rudc("replay", "failed", "--episode", 1, "--out", "early.html")
    assert answer.status == 1
    assert "fails.py:Fails at 0.0 s: act raised ValueError: enough" in answer.err
    assert not (tmp_path / "early.html").exists()


def test_a_run_keeps_what_came_before_its_agent_failed(rudc, tmp_path):
    (tmp_path / "fails.py").write_text(FAILS)
    files = ("--steps", "s.csv", "--replay", "s.html", "--video", "s.gif", "--fcd", "s.xml")
    answer = rudc("run", "random_destination", "-a", "fails.py:Fails", "--seed", 1, *files)
    assert answer.status == 1
    said = answer.err.splitlines()[-1]
    assert said == "error: agent fails.py:Fails at 1.0 s: act raised ValueError: enough (fails.py:8)"
    assert (tmp_path / "s.csv").read_text().count("\n") == 11
    assert '"frames":10,' in (tmp_path / "s.html").read_text(encoding="utf-8")
    assert (tmp_path / "s.gif").exists()
    assert (tmp_path / "s.xml").exists()
    assert answer.err.count("Traceback") == 1
    assert 'fails.py", line 8, in act' in answer.err


@pytest.mark.parametrize("seed", [0, 1])
def test_a_run_whose_agent_fails_is_told_alike_whenever_it_fails(rudc, tmp_path, seed):
    (tmp_path / "fails.py").write_text(FAILS)
    files = ("--replay", "s.html", "--fcd", "s.xml")
    answer = rudc("run", "random_destination", "-a", "fails.py:Fails", "--seed", seed, "--json", *files)
    (told,) = json.loads(answer.out)
    assert (answer.status, told["seed"]) == (1, seed)
    assert told["error"].endswith(f"at {seed:.1f} s: act raised ValueError: enough (fails.py:8)")
    assert answer.err.splitlines()[-1] == f"error: {told['error']}"
    for name in ("s.html", "s.xml"):
        assert (tmp_path / name).exists() == (f"{name} written" in answer.err) == (seed == 1)


def test_an_episode_of_a_sweep_comes_out_the_same(rudc, swept, tmp_path):
    answer = rudc("replay", "swept", "--episode", WHICH, "-e", 2, "--out", "both.html")
    assert answer.status == 0, answer.err
    assert answer.err.count("came out the same as row") == 2
    text = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert "came out the same as row 1 of swept/episodes.csv" in text
    assert "came out the same as row 2 of swept/episodes.csv" in text


def test_the_sweep_is_named_from_within_its_folder_too(rudc, swept, monkeypatch):
    monkeypatch.chdir(swept)
    answer = rudc("replay", ".", "--episode", WHICH, "--out", "../one.html")
    assert "came out the same as row 1 of swept/episodes.csv" in answer.err


def test_an_episode_that_comes_out_otherwise_says_so(rudc, swept, tmp_path):
    with (swept / "episodes.csv").open(newline="") as file:
        header, first, *rest = list(csv.reader(file))
    first[header.index("steps")] = "7"
    with (swept / "episodes.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, first, *rest])
    answer = rudc("replay", "swept", "--episode", WHICH, "--out", "page.html", "--quiet")
    assert answer.status == 1
    assert "came out differently from row 1 of swept/episodes.csv: steps: 7 then, " in answer.err
    assert "came out differently" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_what_has_changed_is_said_once(rudc, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    short = ("-n", 1, "-w", 1, "--set", "episode.timeout=1", "-o", "out")
    assert rudc("sweep", "random_destination", "-a", "slow.py:Slow", *short).status == 0
    # Of another length: Python takes compiled code for current that fits the source's length and second.
    (tmp_path / "slow.py").write_text(SLOW.replace("-0.1", "-2.00"))
    answer = rudc("replay", "out", "--episode", 1, "--out", "page.html")
    assert answer.status == 1
    assert " (what differs here: the source of the agent slow.py:Slow has changed since)\n" in answer.err
    assert answer.err.count("since") == 1


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_a_folder_of_no_sweep_is_refused(rudc, tmp_path, folder):
    answer = rudc("replay", folder, "--episode", WHICH, "--out", "page.html")
    assert answer.status == SweepError.exit_code
    assert answer.err.startswith(f"error: {folder} is not the folder of a sweep")
    assert answer.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
