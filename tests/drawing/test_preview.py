"""Previews of real scenarios: events by their numbers in the file, and why some are not to be seen."""

import numpy as np
import pytest

from rudc.drawing.palette import ASPHALT, EGO, EVENT, OCCLUDER
from rudc.drawing.preview import caption, draw_preview, others, preview_picture
from rudc.drawing.view import view_of
from rudc.network.network import load_network
from rudc.scenario import load_scenario
from rudc.scenario.model import Scenario
from rudc.world.world import World
from tests.drawing.pixels import count

MIXED = {
    "name": "mixed",
    "ego": {"route": {"from": "south", "turn": "left"}},
    "events": [
        {"kind": "hard_brake", "when": {"probability": 0}},
        {"kind": "accident", "vehicles": [{"position": [2, 4]}, {"lane": "west_out_1", "at": 12}]},
        {"kind": "slow_vehicle", "speed": 2, "when": {"ego_distance_to_junction": {"below": 20}}},
        {"kind": "low_friction", "friction": 0.3},
        {"kind": "wrong_way", "lane": "west_out_0", "at": 100,
         "when": {"reach_position": {"position": [1.75, -16]}}},
    ],
}  # fmt: skip


def test_the_caption_says_what_is_not_drawn_and_why():
    scenario = Scenario.model_validate(MIXED)
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(1))
        view = view_of(world)
    lines = ["".join(text for text, _ in line) for line in caption(scenario, view)]
    assert lines[0].split() == ["mixed", "seed", "1"]
    assert lines[1].startswith("ego (yellow) from south to west")
    assert lines[3] == "(1) hard brake - does not happen with this seed (probability 0)"
    assert lines[4] == "(2) accident, 2 vehicles"
    assert lines[5] == (
        "(3) slow vehicle, vehicle leader, speed 2 m/s - not drawn: waits until the ego's distance to its "
        "stop line is below 20 m, its vehicle (leader) is chosen then"
    )
    assert lines[6] == "(4) low friction, friction 0.3 - nothing to draw"
    assert lines[7].endswith("waits until the ego reaches [1.75, -16] tolerance 2 m, its place is marked")
    assert {event.number for event in view.events} == {2, 3, 4, 5}
    assert set(view.numbers.values()) == {"2"}
    assert len(view.numbers) == 2


@pytest.mark.parametrize(
    ("event", "outlined"),
    [
        ({"kind": "sensor_noise", "position": 2}, True),
        ({"kind": "occlusion", "boxes": [{"position": [16, 16], "size": [13, 13]}]}, False),
    ],
)
def test_outlines_are_explained_where_there_are_some(event, outlined):
    scenario = Scenario.model_validate({"name": "seen", "traffic": {"density": 30}, "events": [event]})
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(1))
        assert ("white outlines" in others(view_of(world))) == outlined


def test_a_slippery_patch_is_drawn_where_it_lies():
    """Where it begins is marked while its event waits."""
    patch = {"kind": "slippery_patch", "lane": "south_in_1", "at": 10, "length": 20, "friction": 0.2}
    later = {**patch, "when": {"simulation_time": {"above": 3}}}
    filled, said = {}, []
    for name, events in (("none", []), ("there", [patch]), ("later", [later])):
        scenario = Scenario.model_validate(
            {"name": "oil", "ego": {"route": {"from": "west", "turn": "left"}}, "traffic": {"density": 0},
             "events": events}
        )  # fmt: skip
        with World(load_network("four_way")) as world:
            world.reset(scenario.plan(1))
            said.append("".join(text for text, _ in caption(scenario, view_of(world))[-1]))
        filled[name] = np.asarray(preview_picture(scenario, 1)).astype(int)[-900:]
    lane = (filled["there"] != filled["none"]).any(axis=2)
    rows, columns = np.flatnonzero(lane.any(axis=1)), np.flatnonzero(lane.any(axis=0))
    assert (np.ptp(rows) + 1) / (np.ptp(columns) + 1) == pytest.approx(20 / 3.5, rel=0.1)
    badge = (filled["later"] != filled["none"]).any(axis=2)
    assert 0 < badge.sum() < 0.5 * lane.sum()
    assert said[1] == "(1) slippery patch, lane south_in_1, at 10 m, length 20 m, friction 0.2"
    assert said[2].endswith("not drawn: waits until the time is above 3 s, its place is marked")


def test_events_far_out_widen_the_picture():
    scenario = Scenario.model_validate(MIXED)
    near = scenario.varied({"events.4.at": 20})
    far, usual = (np.asarray(preview_picture(s, 1))[250:] for s in (scenario, near))
    assert far.shape == usual.shape
    assert count(far, ASPHALT) < 0.8 * count(usual, ASPHALT), "drawn smaller"


@pytest.mark.parametrize("name", ["jaywalkers", "wrong_way_driver"])
def test_who_is_not_there_yet_comes_where_the_picture_says(name):
    scenario = load_scenario(name)
    with World(load_network(scenario.network)) as world:
        world.reset(scenario.plan(1))
        (waiting,) = view_of(world).events
        assert waiting.waits
        assert waiting.way is not None
        np.testing.assert_allclose(waiting.way[0], waiting.places[0])
        begun, seen = waiting, []
        for _ in range(60):
            world.advance(np.zeros(2))
            view = view_of(world)
            (begun,) = view.events
            first = f"{world.happenings()[0].name}:0"
            if first in view.truth.ids:
                seen.append(view.truth.position[view.truth.ids.index(first)])
    assert begun.way is None
    assert begun.places == ()
    assert np.linalg.norm(seen[0] - waiting.way[0]) < 1.5
    along = (waiting.way[1] - waiting.way[0]) / np.linalg.norm(waiting.way[1] - waiting.way[0])
    assert (seen[20] - seen[0]) @ along > 0.9 * np.linalg.norm(seen[20] - seen[0]) > 0.5


@pytest.mark.parametrize(
    ("name", "colour", "least"),
    [("blocked_left_turn", EVENT, 500), ("blind_corner", OCCLUDER, 10_000), ("fog", EGO, 200),
     ("roundabout_crossing", EGO, 150), ("jaywalkers", EGO, 200)],
)  # fmt: skip
def test_shipped_scenarios(tmp_path, name, colour, least):
    from PIL import Image

    path = draw_preview(load_scenario(name), 1, tmp_path / "picture.png")
    assert path.stat().st_size < 300_000
    with Image.open(path) as picture:
        assert count(np.asarray(picture.convert("RGB"))[150:], colour) > least


def test_an_event_that_is_over_has_no_place_any_more():
    """Once those who crossed had gone, their number stood again where they had begun."""
    scenario = load_scenario("jaywalkers")
    with World(load_network(scenario.network)) as world:
        world.reset(scenario.plan(1))
        while not world.happenings()[0].is_over:
            world.advance(np.zeros(2))
            assert world.scene().time_s < 60.0
        (crossing,) = view_of(world).events
    assert not crossing.bodies
    assert crossing.places == ()
