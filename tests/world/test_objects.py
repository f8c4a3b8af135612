"""Objects of an `accident`, and opaque boxes that are taken away again."""

import textwrap
from dataclasses import replace

import numpy as np
import pytest

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.errors import ScenarioError
from rudc.scenario import Scenario, load_scenario
from rudc.scenario.events import Event
from rudc.scenario.events.accident import Accident
from rudc.world.fitting import misfits
from rudc.world.obstacles import standing_parts
from rudc.world.scene import Kind
from tests.plans import event
from tests.scenario.test_json_schema import SCHEMA, valid
from tests.world.test_events import CALM, run

STONES = [
    {"lane": "west_in_0", "at": 30, "size": [1.2, 1.0]},
    {"lane": "east_out_1", "at": 12, "lateral": -0.8, "heading_offset": 30, "size": [0.6, 0.5]},
]


def test_objects_lie_where_and_as_large_as_the_file_says_until_their_time_is_over(world):
    lying = event("accident", vehicles=[{"lane": "north_in_0", "at": 20}], objects=STONES, duration=2.0)
    scenes = run(world, replace(CALM, events=(lying,)), 2.5)
    for scene in scenes[:20]:
        rows = [scene.ids.index(f"accident0:{k}") for k in range(3)]
        assert scene.kind[rows].tolist() == [Kind.CAR, Kind.OBSTACLE, Kind.OBSTACLE]
        np.testing.assert_allclose(scene.size[rows[1:]], [[1.2, 1.0], [0.6, 0.5]])
        for row, stone in zip(rows[1:], STONES, strict=True):
            x, y, psi = world.network.place_on_lane(
                stone["lane"], stone["at"], stone.get("lateral", 0.0),
                np.radians(stone.get("heading_offset", 0.0)),
            )  # fmt: skip
            np.testing.assert_allclose([*scene.position[row], scene.heading[row]], [x, y, psi], atol=1e-9)
    assert not [name for name in scenes[-1].ids if name.startswith("accident")]


@pytest.mark.parametrize("agent", ["planner", "rudc-t"])
def test_the_ego_drives_round_what_lies_in_its_lane_and_so_does_traffic(world, agent):
    scenario = Scenario.model_validate(
        {"name": "stones", "ego": {"route": {"from": "west", "turn": "straight"}, "distance": 60},
         "traffic": {"density": 25}, "events": [{"kind": "accident", "objects": STONES}]}
    )  # fmt: skip
    episode, driver = Episode(world), make_agent(agent)
    scene = episode.reset(scenario.plan(3))
    driver.reset(scene, 3)
    collisions = 0
    while episode.outcome is None:
        step = episode.step(driver.act(scene).u)
        scene, collisions = step.scene, collisions + step.advance.sv_collisions
    assert (episode.outcome, collisions) == ("success", 0)


def test_an_accident_without_anything_and_objects_in_the_same_place_are_refused(tmp_path):
    text = """
        name: wrong
        events:
          - {kind: accident, duration: 3}
          - kind: accident
            vehicles: [{lane: north_in_0, at: 20}]
            objects: [{lane: north_in_0, at: 40, size: [1, 1]}, {lane: north_in_0, at: 22, size: [1, 1]}]
          - {kind: accident, objects: [{lane: north_in_9, at: 5, size: [1, 0]}]}
        """
    (tmp_path / "s.yaml").write_text(textwrap.dedent(text))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(tmp_path / "s.yaml", fit=misfits)
    said = str(caught.value)
    assert "events.0: an accident involves one vehicle at least, in `vehicles`, or one of `objects`" in said
    assert "events.1.objects.1: stands where events.1.vehicles.0 stands" in said
    assert "events.2.objects.0.size.1: 0 m is not above 0" in said
    assert len(said.splitlines()) == 3


def test_a_user_s_own_accident_keeps_its_values_and_own_objects_are_no_places():
    class Lit(Accident, frozen=True):
        lights: bool = True

    class Listed(Event, frozen=True):
        lane: str = "north_in_0"
        at: float = 5.0
        objects: tuple[str, ...] = ("stone",)

    lit = Lit.model_validate({"kind": "accident", "objects": STONES, "lights": False})
    assert Lit.model_validate(lit.model_dump(mode="json", exclude_none=True)) == lit
    assert not standing_parts(Listed(kind="listed"))
    assert list(standing_parts(lit)) == [("objects", 0), ("objects", 1)]


def test_an_editor_marks_an_accident_without_anything():
    file = {"name": "s", "events": [{"kind": "accident", "objects": STONES}]}
    assert valid(file, SCHEMA)
    assert not valid({"name": "s", "events": [{"kind": "accident"}]}, SCHEMA)


def test_boxes_are_taken_away_when_their_time_is_over_and_no_others(world):
    for_good = event("occlusion", boxes=[{"position": [-20, -20], "size": [8, 6]}])
    passing = event(
        "occlusion", boxes=[{"position": [20, 20], "size": [4, 2]}], duration=0.5,
        when={"simulation_time": {"above": 0.25}},
    )  # fmt: skip
    world.reset(replace(CALM, events=(passing, for_good)).plan(0))
    widths = []
    for _ in range(12):
        widths.append(sorted(world.sensors().occluders[:, 3].tolist()))
        world.advance(np.zeros(2))
    assert widths == [[8.0]] * 4 + [[4.0, 8.0]] * 5 + [[8.0]] * 3
