"""The gallery: which episodes it shows, and that its page is whole, drives, and has no serious fault."""

import re
import runpy
from pathlib import Path

import pytest
from PIL import Image

from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.reporting.gallery import gallery as page_of_all
from rudc.reporting.gallery.gallery import Shown, agent_rates, chosen, pair_of, report_names, save_gallery
from rudc.reporting.replay.again import Replayed
from rudc.reporting.report.page import report_page
from rudc.scenario import find_scenarios, load_scenario, shipped_scenarios
from tests.reporting.accessibility import MISSING, faults
from tests.reporting.browser import CHROMIUM, driven, parsed
from tests.reporting.report.made_up import made_up_sweep


def episodes(*said):
    """(agent, seed, outcome) of each."""
    return [
        Shown(Path("swept"), k, {"agent": agent, "seed": str(seed), "outcome": outcome})
        for k, (agent, seed, outcome) in enumerate(said, 1)
    ]


def test_failures_are_those_of_who_has_most_and_success_is_in_the_same_episode():
    known = episodes(
        ("a", 0, "off_road"), ("a", 1, "collision"), ("a", 2, "success"), ("a", 3, "frozen"),
        ("b", 0, "success"), ("b", 1, "success"), ("b", 2, "collision"), ("b", 3, "success"),
    )  # fmt: skip
    assert {what: shown.number for what, shown in chosen(known).items()} == {
        "success": 6, "collision": 2, "off_road": 1, "frozen": 4,
    }  # fmt: skip
    assert list(chosen(known)) == ["success", "collision", "off_road", "frozen"]
    assert agent_rates(known)[0] == {"agent": "a", "episodes": 4, "rates": [25.0, 25.0, 50.0]}


def test_two_agents_stand_beside_each_other_in_the_same_episode_only():
    fails, best = ("a", 1, "collision"), ("b", 1, "success")
    assert pair_of(chosen(episodes(fails, best))) == ("collision", "success")
    assert pair_of(chosen(episodes(("a", 1, "frozen"), best))) == ("frozen", "success")
    assert pair_of(chosen(episodes(fails, ("b", 2, "success")))) is None
    assert pair_of(chosen(episodes(fails))) is None
    swept = [
        Shown(
            Path("swept"),
            k,
            {"agent": agent, "seed": "1", "outcome": outcome, "density": density},
            ("density",),
        )
        for k, (agent, outcome, density) in enumerate([("a", "collision", "10"), ("b", "success", "20")])
    ]
    assert pair_of(chosen(swept)) is None


def test_what_never_happened_is_not_shown():
    assert list(chosen(episodes(("a", 0, "success")))) == ["success"]
    assert chosen([]) == {}


def test_no_report_has_the_name_of_another_or_of_the_page():
    sweeps = [Path(name) for name in ("a/ood", "b/ood", "ood-2", "index", "plain")]
    assert report_names(sweeps) == ["ood.html", "ood-2.html", "ood-2-2.html", "index-2.html", "plain.html"]


def test_a_sweep_that_ends_meanwhile_puts_no_page_under_another_episodes_name(tmp_path, monkeypatch):
    swept, drawn, driven_again = made_up_sweep(tmp_path / "swept", 40, scenarios=1, agents=2), [], []

    def end(*_):
        header, *rows = (swept / "episodes.csv").read_text().splitlines(keepends=True)
        (swept / "episodes.csv").write_text("".join([header, *reversed(rows)]))
        drawn.append(rows)

    def replayed(_folder, found, _clip):
        driven_again.append(found)
        return Replayed({"outcome": found.row["outcome"], "row": found.row}, "", True, "")

    monkeypatch.setattr(page_of_all, "draw_preview", end)
    monkeypatch.setattr(page_of_all, "replayed", replayed)
    for name in ("save_replay", "save_report"):
        monkeypatch.setattr(page_of_all, name, lambda *_: None)
    said = []
    save_gallery(tmp_path / "out", [swept], find_scenarios(list(shipped_scenarios())[:1]), said.append)
    assert len(drawn) == 1
    assert said[0].partition(": ")[2] == ", ".join(found.row["outcome"] for found in driven_again)


def test_an_interrupted_gallery_ends_without_a_traceback(tmp_path, monkeypatch):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(page_of_all, "save_gallery", stop)
    monkeypatch.setattr("sys.argv", ["gallery", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("rudc.reporting.gallery", run_name="__main__")
    assert ended.value.code == 130


@pytest.fixture(scope="module")
def gallery(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gallery")
    scenarios = find_scenarios(["random_destination", "density_sweep"])
    plan = SweepPlan((load_scenario("random_destination"),), ("follower",), episodes=2, seed=0)
    run_sweep(plan, folder / "swept", EpisodeRunner)
    said = []
    save_gallery(folder / "out", [folder / "swept"], scenarios, said.append)
    assert len(said) == 3
    return folder / "out"


@pytest.mark.slow
def test_the_page_names_what_is_there(gallery):
    text = (gallery / "index.html").read_text(encoding="utf-8")
    checker = parsed(text)
    assert len(set(checker.ids)) == len(checker.ids)
    files = [link for link in checker.links if not link.startswith("#")]
    assert all((gallery / file).is_file() for file in files)
    assert {"pictures/density_sweep.png", "swept.html"} <= set(files)
    assert "came out differently" not in text
    assert not re.search(r"https?:|@import|url\(", text)
    for clip in gallery.glob("clips/*.webp"):
        with Image.open(clip) as film:
            assert film.width == 320
            assert film.n_frames > 10


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
def test_clips_move_when_asked_to(gallery):
    drive = """
    const image = document.querySelector('img[data-clip$=webp]');
    const button = image.closest('figure').querySelector('button');
    const said = [image.getAttribute('src')];
    button.click(); said.push(image.getAttribute('src'), button.textContent);
    button.click(); said.push(image.getAttribute('src'));
    find('play-all').click(); said.push(image.getAttribute('src'));
    finish({ said, fits: document.documentElement.scrollWidth <= window.innerWidth });
    """
    told = driven((gallery / "index.html").read_text(encoding="utf-8"), drive, gallery, 400)
    still, moving = "pictures/random_destination.png", "clips/random_destination.webp"
    assert told == {"said": [still, moving, "stop", still, moving], "fits": True}


@pytest.mark.slow
@pytest.mark.skipif(MISSING, reason="no Chromium, which pip cannot install, for axe to run in")
def test_no_page_has_a_serious_fault_of_accessibility(gallery, tmp_path):
    replay = next(gallery.glob("replays/*.html"))
    swept = made_up_sweep(tmp_path / "swept", 96, scenarios=4, agents=3)
    report = report_page(swept, swept / "report.html")
    none = {"light": [], "dark": []}
    assert faults((gallery / "index.html").read_text(encoding="utf-8"), gallery) == none
    assert faults(replay.read_text(encoding="utf-8"), replay.parent) == none
    assert faults(report, tmp_path) == none
