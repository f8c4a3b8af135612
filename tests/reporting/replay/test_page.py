"""The replay page: whole, alone, small, and with the episode's own numbers in it."""

import json
import re
from pathlib import Path

import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import InputError
from rudc.evaluation.recording import SERIES, Recording
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.reporting.replay import page
from rudc.reporting.replay.page import replay_page, save_replay
from rudc.scenario import load_scenario
from rudc.world.world import World
from tests.reporting.browser import CHROMIUM, driven, in_node, parsed


def recorded(name, agent, seed, **changes):
    scenario, driver = load_scenario(name, changes), make_agent(agent)
    with World(load_network(scenario.network, scenario.junction)) as world:
        episode = Episode(world)
        recording = Recording(episode, driver)
        return recording.data(run_episode(episode, scenario.plan(seed), driver, watch=recording.watch))


@pytest.fixture(scope="module")
def runs():
    """The largest there is: 40 s among 40 veh/km, blocked; and another beside it."""
    dense = {"traffic.density": 40}
    return [
        recorded("blocked_left_turn", agent, 3, **dense) for agent in ("gap-acceptance+ttcbf", "follower")
    ]


def test_a_page_is_whole_and_refers_to_nothing_outside(runs):
    text = replay_page(runs, ["came out the same as row 1", ""])
    checker = parsed(text)
    assert checker.links == []
    assert len(set(checker.ids)) == len(checker.ids)
    assert not re.search(r"https?:|//[a-z]+\.|@import|url\(", text)
    assert "default-src 'none'" in text
    assert "came out the same as row 1" in text
    assert text.count('class="check"') == 1


def test_forty_seconds_are_less_than_a_megabyte(runs):
    assert runs[0]["series"]["time_s"][-1] * SERIES["time_s"] == pytest.approx(40.0)
    assert sum(len(track["state"]) for track in runs[0]["tracks"]) > 8000
    assert len(replay_page(runs[:1]).encode()) < 500_000
    assert len(replay_page(runs).encode()) < 1_000_000


def test_the_data_in_the_page_are_the_recordings(runs):
    data = json.loads(parsed(replay_page(runs)).data["data"])
    first, second = data["runs"]
    assert first == json.loads(json.dumps(runs[0]))
    assert second == json.loads(json.dumps({**runs[1], "road": None}))  # the same as the first's
    assert data["steps"] == SERIES


def test_a_page_names_both_of_its_episodes(runs):
    same = replay_page(runs)
    assert "<h1>blocked_left_turn, gap-acceptance+ttcbf and follower, seed 3</h1>" in same
    assert 'class="place"' not in same
    other = replay_page([runs[0], {**runs[0], "scenario": "fog", "seed": 5}])
    assert "<h1>blocked_left_turn and fog, gap-acceptance+ttcbf, seeds 3 and 5</h1>" in other
    assert re.findall(r'class="place">(.*)</span>', other) == ["blocked_left_turn, seed 3", "fog, seed 5"]


def test_what_a_name_says_stays_text(runs):
    told = {**runs[0], "agent": "</script><b>x", "event_lines": ["<img src=x>"]}
    checker = parsed(replay_page([told]))
    assert checker.links == []
    assert json.loads(checker.data["data"])["runs"][0]["agent"] == "</script><b>x"


def told_by(runs, folder, scripts, code):
    """What `code` writes as JSON, after scripts of the page whose data are these runs."""
    data = parsed(replay_page(runs)).data
    (folder / "data.json").write_text(json.dumps({name: data[name] for name in ("data", "look")}))
    before = (
        "const text = JSON.parse(require('fs').readFileSync('data.json'));\n"
        "const document = { getElementById: (name) => ({ textContent: text[name] }) };\n"
    )
    parts = [(Path(page.__file__).parent / name).read_text() for name in scripts]
    return in_node("".join([before, *parts, code]), folder)


def test_the_page_decodes_what_the_recording_says(runs, tmp_path):
    """The page's own script, in node."""
    code = (
        "console.log(JSON.stringify(RUNS.map((run) => ({ ego: run.ego, series: run.series,"
        " road: run.road.length, tracks: run.tracks.map((t) => [t.x, t.y, t.psi, t.speed, t.state]) }))));\n"
    )
    for run, told in zip(runs, told_by(runs, tmp_path, ["data.js"], code), strict=True):
        assert told["road"] == len(runs[0]["road"])
        assert len(told["ego"]["x"]) == run["frames"]
        assert told["ego"]["x"][-1] == pytest.approx(0.01 * sum(run["ego"]["x"]))
        assert told["series"]["speed_mps"] == pytest.approx([0.01 * v for v in run["series"]["speed_mps"]])
        for track, (x, _, psi, speed, state) in zip(run["tracks"], told["tracks"], strict=True):
            assert x[-1] == pytest.approx(0.01 * sum(track["poses"]["x"]))
            assert psi[-1] == pytest.approx(0.001 * sum(track["poses"]["psi"]))
            assert speed[-1] == pytest.approx(0.1 * sum(track["speed"]), abs=1e-6)
            assert state == [int(flags, 16) for flags in track["state"]]


BADGES = """
const view = Object.assign(Object.create(SceneView.prototype), { run: RUNS[0], colours: {}, stroke() {} });
let told;
view.badge = (x, y, text, there, seen) => told.push([String(text), there, seen]);
const frames = FRAMES_ASKED.map((k) => {
  told = [];
  view.others = present(RUNS[0], k);
  view.drawEvents(k, 0);
  return told;
});
console.log(JSON.stringify(frames));
"""


def test_numbers_stand_beside_bodies_and_at_places_only_before(runs, tmp_path):
    """The badges of the page's own script: text, whether anything is there, whether the ego has seen it."""
    moving = next(track for track in runs[0]["tracks"] if len(track["state"]) == runs[0]["frames"])
    when = {"kind": "hard_brake", "way": None, "patch": [], "over": [], "begun_s": None, "visible_s": None}
    events = [
        {**when, "number": 1, "places": [[0, 0]], "begun_s": 2.0, "visible_s": 3.0},
        {**when, "number": 2, "places": [], "begun_s": 4.0},
        {**when, "number": 3, "places": [[5, 5]], "begun_s": 2.0, "over": [[29, None]]},
    ]
    track = {**moving, "events": [[19, "1"], [39, "1,2"], [59, None]]}
    found = told_by(
        [{**runs[0], "tracks": [track], "events": events}],
        tmp_path, ["data.js", "scene.js"], BADGES.replace("FRAMES_ASKED", "[9, 19, 28, 29, 39]"),
    )  # fmt: skip
    assert found == [
        [["1", False, True], ["3", False, True]],
        [["1", True, False], ["3", True, True]],
        [["1", True, False], ["3", True, True]],
        [["1", True, True]],
        [["1,2", True, True]],
    ]


PATCHES = """
const told = [], c = { fill: (path) => told.push(["fill", path]) };
globalThis.Path2D = class { constructor() { this.at = []; }
  moveTo(x, y) { this.at.push([x, y]); } lineTo(x, y) { this.at.push([x, y]); } closePath() {} };
const view = Object.assign(Object.create(SceneView.prototype), { run: RUNS[0], colours: {}, ctx: c });
for (const k of [9, 19, 29]) view.drawPatches(k);
console.log(JSON.stringify(told.map(([how, path]) => [how, path.at])));
"""


def test_a_slippery_patch_is_filled_while_it_is_there(runs, tmp_path):
    """Its corners come as steps of 0.01 m."""
    event = {
        "number": 1, "kind": "slippery_patch", "places": [], "way": None, "begun_s": 2.0, "visible_s": None,
        "patch": [[100, 200, 400, 0, 0, 350, -400, 0]], "over": [[29, None]],
    }  # fmt: skip
    told = told_by([{**runs[0], "events": [event]}], tmp_path, ["data.js", "scene.js"], PATCHES)
    corners = [[1, 2], [5, 2], [5, 5.5], [1, 5.5]]
    assert told == [["fill", corners]]


def test_a_second_is_looked_up_in_the_longer_episode(runs, tmp_path):
    short = {name: values[:80] for name, values in runs[0]["series"].items()}
    told = told_by(
        [{**runs[0], "frames": 80, "series": short}, runs[0]], tmp_path, ["data.js"],
        "console.log(JSON.stringify([0.1, 12.3, 99].map((second) => timeAt(frameAt(second)))));\n",
    )  # fmt: skip
    assert told == pytest.approx([0.1, 12.3, 40.0])


def test_a_plot_of_very_many_decisions_has_a_range(runs, tmp_path):
    code = (
        "const values = Array.from({ length: 300000 }, (_, k) => k % 50);\n"
        "console.log(JSON.stringify(rangeOf({ lines: [{ name: 'a' }] }, [{ series: { a: values } }])));\n"
    )
    found = told_by(runs, tmp_path, ["data.js", "plots.js"], code)
    assert (found["low"], found["high"]) == pytest.approx((-2.94, 51.94))


DRIVE = r"""
const told = [], clock = () => document.getElementById('clock').textContent.split(' of')[0];
const press = (key, shiftKey) => document.dispatchEvent(new KeyboardEvent('keydown', { key, shiftKey }));
const note = (name, value) => told.push([name, value]);
note('opened', clock());
press('ArrowRight'); note('on', clock());
press('ArrowLeft', true); note('a second back', clock());
press('End'); note('end', clock());
press('Home'); note('home', clock());
press('f'); note('view', document.getElementById('view').value);
document.querySelectorAll('.moments button').forEach((b) => b.textContent.includes('end:') && b.click());
note('moment', clock());
const slider = document.getElementById('time');
slider.value = 99; slider.dispatchEvent(new Event('input')); note('slider', clock());
const plot = document.querySelector('canvas.plot'), box = plot.getBoundingClientRect();
plot.setPointerCapture = () => {};
plot.dispatchEvent(new PointerEvent('pointerdown', { clientX: box.right - 8, buttons: 1 }));
note('plot', clock());
press('Home'); press('n'); const next = clock(); press('p'); note('moments', next !== clock());
const scene = document.querySelector('canvas.scene'), all = scene.getBoundingClientRect();
scene.setPointerCapture = () => {};
const touch = (kind, pointerId, x) => scene.dispatchEvent(new PointerEvent(kind, { pointerId, clientX: x }));
press('Home'); touch('pointerdown', 1, all.left); touch('pointermove', 1, all.left + all.width / 2);
touch('pointerup', 1, all.left + all.width / 2); note('dragged', Math.round(parseFloat(clock())));
const near = state.widest;
touch('pointerdown', 1, 100); touch('pointerdown', 2, 150); touch('pointermove', 2, 200);
touch('pointerup', 2, 200); touch('pointerup', 1, 100); note('pinched', near / state.widest);
touch('pointerdown', 1, 100); touch('pointerup', 1, 100);
note('tapped', document.getElementById('play').textContent); press(' ');
const picture = () => document.querySelector('canvas.scene').toDataURL();
const shows = document.getElementById('yields'), said = () => document.querySelector('.acts').textContent;
go(YIELDS); const shown = [picture(), said()];
press('y');
note('hides', [shown[0] !== picture(), shown[1].includes(' 1 yields, '), said().includes('yield')]);
shows.click(); note('shows', shown[0] === picture() && shown[1] === said());
shows.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', bubbles: true }));
note('space on the box', document.getElementById('play').textContent);
note('fits', document.documentElement.scrollWidth <= window.innerWidth);
press('Home'); press(' ');
note('plays', document.getElementById('play').textContent);
let waited = 0;
const waiting = setInterval(() => {
  const moved = parseFloat(clock()) > 0.1;
  if (!moved && ++waited < 200) return;
  clearInterval(waiting);
  note('moved', moved);
  press(' '); note('stops', document.getElementById('play').textContent);
  finish(Object.fromEntries(told));
}, 50);
"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, which pip cannot install")
@pytest.mark.parametrize("width", [1400, 400])
def test_a_browser_opens_and_drives_the_page(runs, tmp_path, width):
    """Without a complaint."""
    frame = next(k for track in runs[0]["tracks"] for k, whom in track["yields"] if whom)
    told = driven(replay_page(runs), DRIVE.replace("YIELDS", str(frame)), tmp_path, width, "#12.3")
    assert told == {
        "opened": "12.3 s", "on": "12.4 s", "a second back": "11.4 s", "end": "40.0 s", "home": "0.1 s",
        "view": "all", "moment": told["moment"], "slider": "10.0 s", "plot": "40.0 s", "fits": True,
        "moments": True, "dragged": 20, "pinched": 2, "tapped": "Stop",
        "hides": [True, True, False], "shows": True, "space on the box": "Play",
        "plays": "Stop", "moved": True, "stops": "Play",
    }  # fmt: skip
    assert float(told["moment"].split()[0]) > 1.0


def test_only_a_page_is_written(runs, tmp_path):
    with pytest.raises(InputError, match=r"\.html file, not 'film.gif'"):
        save_replay(tmp_path / "film.gif", runs)
    save_replay(tmp_path / "new" / "page.html", runs[:1])
    assert (tmp_path / "new" / "page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
