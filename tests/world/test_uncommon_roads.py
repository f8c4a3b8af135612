"""Roads that imported maps have: lanes for buses and bicycles, lanes that end, lanes that begin just before
the junction, arms closed to lorries, stated lengths that differ from the drawn ones, traffic lights on an
arm.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rudc.errors import NetworkError
from rudc.network.build import build_network
from rudc.network.check import check_network
from rudc.network.network import load_network
from rudc.world.world import World
from tests.plans import PlanSource, event

FAR = {"east": (120, 0), "north": (0, 120), "west": (-120, 0), "south": (0, -120)}
STAND = np.array([-6.0, 0.0])

Lanes = Callable[[str, str], str]
"""attributes and lanes of an edge, by the arm and the way it leads: `in` or `out`"""


def crossing(
    folder: Path,
    edge: Lanes,
    more: str = "",
    connections: str = "",
    names: dict[str, str] | None = None,
    west: float = 120.0,
) -> Path:
    """Four arms at right angles, east and west the main road. `more`: further elements of edges and nodes;
    `names`: of edges that are not called ARM_WAY; `west`: m out to the node of that arm.
    """
    nodes = ['<node id="centre" x="0" y="0" type="priority" radius="7"/>']
    edges = []
    for arm, (x, y) in {**FAR, "west": (-west, 0.0)}.items():
        nodes.append(f'<node id="{arm}" x="{x}" y="{y}"/>')
        for way, ends in (("in", (arm, "centre")), ("out", ("centre", arm))):
            name = (names or {}).get(f"{arm}_{way}", f"{arm}_{way}")
            edges.append(
                f'<edge id="{name}" from="{ends[0]}" to="{ends[1]}" speed="10" '
                f'priority="{3 if x else 1}" {edge(arm, way)}'
            )
    node = [part for part in more.split("\n") if part.startswith("<node")]
    rest = [part for part in more.split("\n") if not part.startswith("<node")]
    texts = {"nod": ("nodes", nodes + node), "edg": ("edges", edges + rest)}
    if connections:
        texts["con"] = ("connections", [connections])
    for ending, (tag, parts) in texts.items():
        text = f"<{tag}>{''.join(parts)}</{tag}>"
        (folder / f"roads.{ending}.xml").write_text(text, encoding="utf-8")
    return build_network(folder)


def one_lane(arm: str, way: str) -> str:
    return 'numLanes="1" width="3.5"/>'


def drive(world: World, source: PlanSource, seconds: float, seed: int = 0) -> list:
    scenes = [world.reset(source.plan(seed))]
    for _ in range(round(seconds / 0.1)):
        world.advance(STAND)
        scenes.append(world.scene())
    return scenes


@pytest.mark.parametrize(("allowed", "kind"), [("bicycle", "bicycle"), ("bus", "bus")])
def test_who_drives_on_a_lane_of_its_own_keeps_its_way(tmp_path, allowed, kind):
    """It was taken for somebody who drives against the lane: for an obstacle, and at fault."""

    def lanes(arm: str, way: str) -> str:
        own = f'<lane index="0" width="3.0" allow="{allowed}"/><lane index="1" width="3.5"/>'
        return f'numLanes="2">{own}</edge>'

    network = load_network(str(crossing(tmp_path, lanes)))
    source = PlanSource(str(network.path), 20.0, "south", "straight", {"car": 0.5, kind: 0.5})
    seen = 0
    with World(network) as world:
        for scene in drive(world, source, 12.0, seed=4):
            lane = dict(zip(world._reader.names, world._reader.motion.lane, strict=True))
            for i, name in enumerate(scene.ids):
                assert scene.path[i] >= 0
                x, y, heading = network.paths.pose(scene.path[i], scene.path_s[i])
                inside = lane.get(name, ":").startswith(":")
                seen += name in lane and lane[name].endswith("_0") and not inside
                if not inside:
                    assert np.hypot(*(scene.position[i] - (x, y))) < 4.5
                    assert np.cos(scene.heading[i] - heading) > 0.9
    assert seen > 100


def test_who_drives_on_behind_the_end_of_a_lane_keeps_its_way(tmp_path):
    """West, the road has two lanes for 30 m and then one."""

    def lanes(arm: str, way: str) -> str:
        return f'numLanes="{2 if arm == "west" else 1}" width="3.5"/>'

    more = '<node id="far" x="-240" y="0"/>\n<edge id="on" from="west" to="far" numLanes="1" speed="10"/>'
    network = load_network(str(crossing(tmp_path, lanes, more)))
    assert network.arm("west").out_edges == ("west_out", "on")
    source = PlanSource(str(network.path), 20.0, "east", "straight")
    behind = 0
    with World(network) as world:
        for scene in drive(world, source, 20.0):
            for i in np.flatnonzero(scene.position[:, 0] < -130.0):
                behind += 1
                assert scene.path[i] >= 0
                x, y, _ = network.paths.pose(scene.path[i], scene.path_s[i])
                assert np.hypot(*(scene.position[i] - (x, y))) < 4.5
    assert behind > 50


def test_a_way_that_ends_with_its_lane_soon_behind_the_junction_is_named(tmp_path):
    def lanes(arm: str, way: str) -> str:
        return f'numLanes="{2 if arm == "west" else 1}" width="3.5"/>'

    more = '<node id="far" x="-240" y="0"/>\n<edge id="on" from="west" to="far" numLanes="1" speed="10"/>'
    for west, named in ((40, True), (120, False)):
        path = crossing(tmp_path, lanes, more, west=west)
        found = [w for w in check_network(path).warnings if "ends with its lane" in w]
        assert bool(found) == named
        assert any("from south to west ends with its lane 25 m beyond" in w for w in found) == named


def test_no_lorries_where_they_are_forbidden(tmp_path):
    def lanes(arm: str, way: str) -> str:
        closed = 'disallow="truck"' if arm == "east" else ""
        return f'numLanes="1" width="3.5" {closed}/>'

    network = load_network(str(crossing(tmp_path, lanes)))
    leader = event("slow_vehicle", vehicle="leader", speed=3.0)
    source = PlanSource(str(network.path), 20.0, "south", "right", {"truck": 1.0}, events=(leader,))
    with World(network) as world:
        for seed in range(3):
            drive(world, replace(source, turn=("right", "left", "straight")[seed]), 6.0, seed)
            assert world.traffic.drivers
            assert "east" not in {d.origin for d in world.traffic.drivers.values()}
            assert "east" not in {d.destination for d in world.traffic.drivers.values()}


@pytest.mark.parametrize("closed", ["lane", "connection"])
def test_no_lorries_where_the_only_way_is_closed_to_them(tmp_path, closed):
    """SUMO found no route for them, and the episode failed."""

    def lanes(arm: str, way: str) -> str:
        if (arm, way) != ("west", "out"):
            return one_lane(arm, way)
        return f'numLanes="2"><lane index="1" {ban if closed == "lane" else ""}/></edge>'

    ban = 'disallow="truck"'
    ways = [("east", 0, ""), ("north", 0, ""), ("west", 1, ban if closed == "connection" else "")]
    links = "".join(
        f'<connection from="south_in" to="{arm}_out" fromLane="0" toLane="{lane}" {more}/>'
        for arm, lane, more in ways
    )
    network = load_network(str(crossing(tmp_path, lanes, "", links)))
    refused = {end: classes for (start, end), classes in network.refused.items() if start == "south"}
    assert refused == {"west": {"truck"}, "north": set(), "east": set()}
    source = PlanSource(str(network.path), 20.0, "east", "straight", {"car": 0.5, "truck": 0.5})
    with World(network) as world:
        for seed in range(2):
            drive(world, source, 6.0, seed)


def test_traffic_enters_before_a_pocket_that_is_reached_by_changing_lanes(tmp_path):
    def lanes(arm: str, way: str) -> str:
        return f'numLanes="{2 if (arm, way) == ("south", "in") else 1}" width="3.2"/>'

    more = (
        '<node id="far" x="0" y="-240"/>\n<edge id="before" from="far" to="south" numLanes="1" speed="10"/>\n'
        '<edge id="after" from="south" to="far" numLanes="1" speed="10"/>'
    )
    ahead = '<connection from="before" to="south_in" fromLane="0" toLane="0"/>'
    network = load_network(str(crossing(tmp_path, lanes, more, ahead)))
    source = PlanSource(str(network.path), 25.0, "south", "left")
    before = 0
    with World(network) as world:
        for seed in range(2):
            for scene in drive(world, source, 12.0, seed):
                for i in np.flatnonzero(scene.position[:, 1] < -130.0):
                    before += scene.path[i] in network.movement("south", "left").rows
                    x, y, _ = network.paths.pose(scene.path[i], scene.path_s[i])
                    assert np.hypot(*(scene.position[i] - (x, y))) < 4.5
    assert before > 20


@pytest.mark.parametrize("other", ["pedestrian", "bus", "bicycle"])
def test_an_arm_whose_outermost_edge_has_a_lane_without_cars_is_driven(tmp_path, other):
    """The network was refused: SUMO had been asked for a car on that lane."""
    own = f'numLanes="2"><lane index="0" allow="{other}" width="2"/><lane index="1" width="3.5"/></edge>'
    more = (
        '<node id="far" x="0" y="-240"/>\n'
        f'<edge id="before" from="far" to="south" speed="10" {own}\n'
        f'<edge id="after" from="south" to="far" speed="10" {own}'
    )
    network = load_network(str(crossing(tmp_path, lambda arm, way: own, more)))
    assert len(network.arm("south").in_edges) == 2
    with World(network) as world:
        drive(world, PlanSource(str(network.path), 20.0, "south", "straight"), 2.0)


@pytest.mark.parametrize("stated", [60, 240])
def test_who_is_put_before_the_ego_is_before_it_whatever_length_is_stated(tmp_path, stated):
    def lanes(arm: str, way: str) -> str:
        length = f'length="{stated}"' if arm == "south" else ""
        return f'numLanes="1" width="3.5" {length}/>'

    network = load_network(str(crossing(tmp_path, lanes)))
    leader = event("slow_vehicle", vehicle="leader", speed=3.0)
    source = PlanSource(str(network.path), 3.0, "south", "left", events=(leader,))
    with World(network) as world:
        for seed in range(3):
            scene = drive(world, source, 0.5, seed)[-1]
            (name,) = world.happenings()[0].bodies
            ahead = float(scene.path_s[scene.ids.index(name)]) - scene.ego_s
            assert 5.0 < ahead < 40.0


def test_an_arm_goes_by_its_name_before_another_by_its_edge(tmp_path):
    """The edge that leads to the south is called so; it is on the arm in the north."""
    path = crossing(tmp_path, one_lane, names={"north_in": "south", "south_in": "northbound"})
    network = load_network(str(path))
    assert network.arm("north").in_edges == ("south",)
    assert network.arm("south").in_edges == ("northbound",)
    assert network.arm("northbound").name == "south"


def test_lights_on_an_arm_are_refused(tmp_path):
    lights = '<node id="east" x="60" y="0" type="traffic_light"/>\n<node id="far" x="120" y="0"/>'
    more = (
        f'{lights}\n<edge id="before" from="far" to="east" numLanes="1" speed="10"/>\n'
        '<edge id="after" from="east" to="far" numLanes="1" speed="10"/>'
    )
    network = load_network(str(crossing(tmp_path, one_lane, more)))
    with pytest.raises(NetworkError, match="'east' has traffic lights"):
        World(network)


def test_the_limit_behind_the_junction_is_that_of_the_next_edge(tmp_path):
    more = (
        '<node id="far" x="-240" y="0"/>\n<edge id="on" from="west" to="far" numLanes="1" speed="20"/>\n'
        '<edge id="back" from="far" to="west" numLanes="1" speed="20"/>'
    )
    network = load_network(str(crossing(tmp_path, one_lane, more)))
    route = network.route("south", "left")
    assert route.limit_at(route.exit_s + 1.0) == 10.0
