"""Networks that are not shipped: what a user's own file may look like."""

import gzip
import shutil
from importlib.util import find_spec

import numpy as np
import pytest

from rudc.errors import NetworkError
from rudc.network.build import OPTIONS, build_network
from rudc.network.check import check_network
from rudc.network.network import load_network
from rudc.world.trial import refuse_untried
from rudc.world.world import World
from tests.plans import PlanSource

needs_netconvert = pytest.mark.skipif(
    find_spec("sumo") is None and shutil.which("netconvert") is None, reason="netconvert is not installed"
)


def build(folder, nodes, edges, connections=""):
    """A network from {id: (x, y)} (or (x, y, type)) and [(id, from, to, attributes)]."""
    rows = "".join(
        f'<node id="{k}" x="{v[0]}" y="{v[1]}" type="{v[2] if len(v) > 2 else "priority"}"/>'
        for k, v in nodes.items()
    )
    (folder / "own.nod.xml").write_text(f"<nodes>{rows}</nodes>")
    rows = "".join(f'<edge id="{e}" from="{a}" to="{b}" speed="10" {more}/>' for e, a, b, more in edges)
    (folder / "own.edg.xml").write_text(f"<edges>{rows}</edges>")
    if connections:
        (folder / "own.con.xml").write_text(f"<connections>{connections}</connections>")
    return build_network(folder)


def both_ways(a, b, more='numLanes="1"'):
    return [(f"{a}_{b}", a, b, more), (f"{b}_{a}", b, a, more)]


def mark_roundabout(path, ring):
    """Enter in a network the roundabout of these nodes, where netconvert saw none."""
    text = path.read_text()
    if "<roundabout" not in text:
        edges = " ".join(f"ring_{a}_{b}" for a, b in zip(ring, [*ring[1:], ring[0]], strict=True))
        mark = f'<roundabout nodes="{" ".join(ring)}" edges="{edges}"/>'
        path.write_text(text.replace("</net>", f"{mark}</net>"))


CROSS = {"c": (0, 0), "n": (0, 100), "e": (100, 0), "s": (0, -100), "w": (-100, 0)}


@needs_netconvert
def test_of_several_junctions_one_must_be_chosen(tmp_path):
    nodes = {**CROSS, "d": (200, 0), "dn": (200, 100), "ds": (200, -100), "de": (300, 0)}
    del nodes["e"]
    pairs = [("c", "n"), ("c", "s"), ("c", "w"), ("c", "d"), ("d", "dn"), ("d", "ds"), ("d", "de")]
    path = build(tmp_path, nodes, [edge for pair in pairs for edge in both_ways(*pair)])
    with pytest.raises(NetworkError, match=r"several junctions.*`junction: ID` .* by --junction ID\): c, d"):
        load_network(path)
    west, east = load_network(path, "c"), load_network(path, "d")
    assert (
        [arm.name for arm in west.arms]
        == [arm.name for arm in east.arms]
        == ["east", "north", "west", "south"]
    )
    assert west.arm("east").in_edge == "d_c"
    assert east.arm("west").in_edge == "c_d"
    np.testing.assert_allclose(east.center, [200, 0])
    assert float(west.surface.signed_distance(np.array([150.0, 1.6]))) > 1.0
    assert west.route("south", "right").path.xy[-1][0] > 150.0


@needs_netconvert
def test_an_arm_goes_on_through_nodes_where_the_road_only_changes(tmp_path):
    nodes = {**CROSS, "m": (60, 0), "k": (140, 30)}
    nodes["e"] = (200, 30)
    pairs = [("c", "n"), ("c", "s"), ("c", "w")]
    edges = [edge for pair in pairs for edge in both_ways(*pair)]
    edges += [
        ("e_k", "e", "k", 'numLanes="1"'),
        ("k_m", "k", "m", 'numLanes="1"'),
        ("m_c", "m", "c", 'numLanes="2"'),
    ]
    edges += [
        ("c_m", "c", "m", 'numLanes="2"'),
        ("m_k", "m", "k", 'numLanes="1"'),
        ("k_e", "k", "e", 'numLanes="1"'),
    ]
    network = load_network(build(tmp_path, nodes, edges))
    east = network.arm("east")
    assert east.in_edges == ("e_k", "k_m", "m_c")
    assert east.out_edges == ("c_m", "m_k", "k_e")
    assert len(east.in_lanes) == 2
    assert east.length > 180.0
    assert network.movement("east", "west").edges[:3] == ("e_k", "k_m", "m_c")
    x, y, _ = network.place_on_lane("east_in_0", 100.0)
    assert x > 100.0
    assert y > 5.0
    for row in network.movement("east", "west").rows:
        lane = network.paths.lane_ids[row][0]
        if lane.startswith("e_k"):
            found, s = network.paths.locate("east", "west", lane, 0.0)
            assert s == pytest.approx(0.0)
            assert found in network.movement("east", "west").rows
    s = np.arange(0.0, 150.0, 1.0)
    row = network.movement("west", "east").rows[0]
    x, y, _ = network.paths.pose(np.full(len(s), row), s)
    assert network.surface.signed_distance(np.column_stack([x, y])).min() > 1.0


@needs_netconvert
def test_an_arm_leads_where_it_leads_over_20_m_whatever_its_edges(tmp_path):
    edges = [edge for arm in "nsw" for edge in both_ways("c", arm)]
    edges += [*both_ways("c", "m"), *both_ways("m", "e")]
    network = load_network(build(tmp_path, {**CROSS, "m": (10, -7), "e": (120, -7)}, edges))
    east = network.arm("east")
    assert network.lanes[east.in_lanes[0]].length < 8.0
    assert abs(np.degrees(east.heading_in)) > 170.0
    assert network.movement("west", "straight").destination == "east"


@needs_netconvert
def test_a_roundabout_whose_entries_and_exits_part_before_the_ring_is_one_junction(tmp_path):
    nodes, edges = {}, []
    ring = []
    for k, arm in enumerate("enws"):
        turn = np.array([[0, -1], [1, 0]])
        place = np.linalg.matrix_power(turn, k)
        for name, at in (("x", (17.0, -8.0)), ("i", (17.0, 8.0)), ("y", (45.0, 0.0)), ("z", (140.0, 0.0))):
            nodes[arm + name] = tuple(float(v) for v in place @ np.array(at))
        edges += both_ways(arm + "y", arm + "z")
        edges += [(f"{arm}_enter", arm + "y", arm + "i", ""), (f"{arm}_leave", arm + "x", arm + "y", "")]
        ring += [arm + "x", arm + "i"]
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        edges.append((f"ring_{a}_{b}", a, b, 'priority="9"'))
    path = build(tmp_path, nodes, edges)
    mark_roundabout(path, ring)
    network = load_network(path)
    assert network.is_roundabout
    assert len(network.nodes) == 8
    assert [arm.name for arm in network.arms] == ["east", "north", "west", "south"]
    assert network.arm("east").in_edges == ("ez_ey", "e_enter")
    assert network.arm("east").out_edges == ("e_leave", "ey_ez")
    assert {m.turn for m in network.movements if m.origin == "south"} >= {"left", "straight", "right"}
    assert load_network(path, "ni").arms == network.arms


@needs_netconvert
def test_a_node_with_two_roads_to_one_roundabout_and_a_third_is_a_junction(tmp_path):
    nodes = {"re": (20, 0), "rn": (0, 20), "rw": (-20, 0), "rs": (0, -20), "j": (80, 80), "x": (160, 80)}
    ring = ["re", "rn", "rw", "rs"]
    pairs = [("re", "j"), ("rn", "j"), ("j", "x"), ("rw", "w"), ("rs", "s")]
    edges = [edge for pair in pairs for edge in both_ways(*pair)]
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        edges.append((f"ring_{a}_{b}", a, b, 'priority="9"'))
    path = build(tmp_path, {**nodes, "w": (-120, 0), "s": (0, -120)}, edges)
    mark_roundabout(path, ring)
    assert {arm.in_edge for arm in load_network(path, "j").arms} == {"re_j", "rn_j", "x_j"}
    assert {arm.in_edges for arm in load_network(path, "re").arms} == {
        ("j_re",), ("j_rn",), ("w_rw",), ("s_rs",)
    }  # fmt: skip


@needs_netconvert
def test_one_way_arms_and_lanes_for_others_are_understood(tmp_path):
    edges = [edge for pair in (("c", "n"), ("c", "s"), ("c", "w")) for edge in both_ways(*pair)]
    edges.append(("e_c", "e", "c", 'numLanes="1" width="3.2"'))
    edges = [(i, a, b, 'numLanes="2"' if i == "w_c" else more) for i, a, b, more in edges]
    network = load_network(build(tmp_path, CROSS, edges))
    east = network.arm("east")
    assert east.out_edge is None
    assert east.out_lanes == ()
    assert east.length == pytest.approx(95, abs=8)
    assert east.two_way_m == 0.5 * east.length
    assert network.arm("west").two_way_m == network.arm("west").length
    assert not [m for m in network.movements if m.destination == "east"]

    text = network.path.read_text().replace(
        '<lane id="w_c_0" index="0"', '<lane id="w_c_0" index="0" allow="pedestrian"'
    )
    sidewalk = tmp_path / "sidewalk.net.xml"
    sidewalk.write_text(text)
    other = load_network(sidewalk)
    assert other.arm("west").in_lanes == ("w_c_1",)
    assert "west_in_0" not in other.lane_names
    assert "west_in_1" in other.lane_names
    off_road = other.surface.signed_distance(load_network(network.path).lane("w_c_0").xy.mean(axis=0))
    assert float(off_road) < 0.0


@needs_netconvert
@pytest.mark.parametrize("closed", ["lane", "connection"])
def test_the_way_on_leads_over_lanes_for_cars(tmp_path, closed):
    """A bus bay, to which the lane before it leads straight on."""
    nodes = {**CROSS, "m": (60, 0), "k": (90, 0), "e": (150, 0)}
    edges = [edge for pair in (("c", "n"), ("c", "s"), ("c", "w")) for edge in both_ways(*pair)]
    edges += [("e_c", "e", "c", 'numLanes="1"'), ("c_m", "c", "m", 'numLanes="1"')]
    edges += [("m_k", "m", "k", 'numLanes="2"'), ("k_e", "k", "e", 'numLanes="1"')]
    links = [("c_m", "m_k", 0, 0), ("c_m", "m_k", 0, 1), ("m_k", "k_e", 0, 0), ("m_k", "k_e", 1, 0)]
    told = "".join(f'<connection from="{a}" to="{b}" fromLane="{i}" toLane="{j}"/>' for a, b, i, j in links)
    file = build(tmp_path, nodes, edges, told)
    text = file.read_text()
    if closed == "lane":
        text = text.replace('<lane id="m_k_0"', '<lane id="m_k_0" allow="bus"')
    else:
        text = text.replace(
            'to="m_k" fromLane="0" toLane="0"', 'to="m_k" fromLane="0" toLane="0" allow="bus"'
        )
    file.write_text(text)
    network = load_network(file)
    assert network.arm("east").out_edges == ("c_m", "m_k", "k_e")
    (row,) = network.movement("west", "east").rows
    assert "m_k_1" in network.paths.lane_ids[row]
    assert "m_k_0" not in network.paths.lane_ids[row]


@needs_netconvert
def test_an_arm_ends_at_a_gate_for_buses(tmp_path):
    edges = [edge for pair in (("c", "n"), ("c", "s"), ("c", "w"), ("c", "m")) for edge in both_ways(*pair)]
    edges += both_ways("m", "e")
    gates = "".join(
        f'<connection from="{a}" to="{b}" fromLane="0" toLane="0" allow="bus"/>'
        for a, b in (("c_m", "m_e"), ("e_m", "m_c"))
    )
    network = load_network(build(tmp_path, {**CROSS, "m": (60, 0)}, edges, gates))
    assert (network.arm("east").in_edges, network.arm("east").out_edges) == (("m_c",), ("c_m",))
    refuse_untried(network)


@needs_netconvert
def test_arms_in_one_direction_carry_their_edges_name(tmp_path):
    nodes = {"c": (0, 0), "a": (100, 8), "b": (100, -38), "w": (-100, 0)}
    edges = [edge for pair in (("c", "a"), ("c", "b"), ("c", "w")) for edge in both_ways(*pair)]
    network = load_network(build(tmp_path, nodes, edges))
    assert [arm.name for arm in network.arms] == ["east_a_c", "west", "east_b_c"]
    assert network.movement("west", "straight").destination == "east_a_c"
    assert network.movement("west", "right").destination == "east_b_c"


def test_what_is_no_network_is_refused(tmp_path):
    text = load_network("four_way").path.read_text()
    cases = {
        "no.net.xml": ("hello", "not a SUMO network"),
        "own.edg.xml": (
            "<edges><edge id='a' from='b' to='c'/></edges>",
            r"not a SUMO network \(.*netconvert makes one\): it begins with <edges>, and not with <net>$",
        ),
        "nothing.net.xml": ("<net/>", r"not a SUMO network .*: <net> in line 1 lacks something, or names"),
        "empty.net.xml": ("<net version='1.20'></net>", "holds no edges"),
        "left.net.xml": (
            text.replace("<net ", '<net lefthand="true" '),
            "left-hand traffic is not supported",
        ),
        "bare.net.xml": (text.replace(' via=":', ' nope=":'), "build the network with internal links"),
    }
    for name, (content, message) in cases.items():
        path = tmp_path / name
        path.write_text(content)
        with pytest.raises(NetworkError, match=message):
            load_network(path)
    with pytest.raises(NetworkError, match="is a folder; `rudc network build`"):
        load_network(tmp_path)
    for name in ("absent.net.xml", "n" * 300 + ".net.xml"):
        with pytest.raises(NetworkError, match="neither shipped nor a file"):
            load_network(tmp_path / name)


def test_a_road_without_a_junction_is_refused(tmp_path):
    path = tmp_path / "road.net.xml"
    path.write_text(
        "<net version='1.20'><location netOffset='0,0' convBoundary='0,0,9,9' origBoundary='0,0,9,9' "
        "projParameter='!'/><edge id='r' from='a' to='b'><lane id='r_0' index='0' speed='9' length='9' "
        "shape='0,0 9,0'/></edge>"
        "<junction id='a' type='dead_end' x='0' y='0' incLanes='' intLanes='' shape=''/>"
        "<junction id='b' type='dead_end' x='9' y='0' incLanes='r_0' intLanes='' shape=''/></net>"
    )
    with pytest.raises(NetworkError, match="no junction with at least three arms"):
        load_network(path)


def test_a_compressed_network_is_the_same(tmp_path):
    original = load_network("t_junction")
    path = tmp_path / "packed.net.xml.gz"
    path.write_bytes(gzip.compress(original.path.read_bytes()))
    assert load_network(path).name == "packed"
    assert load_network(path).movements == original.movements


POCKET = [("w", "wm", 'numLanes="1"'), ("wm", "c", 'numLanes="2"'), ("c", "w", 'numLanes="1"')]


@needs_netconvert
@pytest.mark.parametrize("options", [[], ["--no-turnarounds"]])
def test_a_turn_lane_that_begins_on_one_side_of_a_road_makes_no_second_arm(tmp_path, monkeypatch, options):
    others = [o for o in OPTIONS if o != "--no-turnarounds"]
    monkeypatch.setattr("rudc.network.build.OPTIONS", (*others, *options))
    edges = [edge for arm in "nes" for edge in both_ways("c", arm)]
    edges += [(f"{a}_{b}", a, b, more) for a, b, more in POCKET]
    network = load_network(build(tmp_path, {**CROSS, "wm": (-45, 0)}, edges))
    west = network.arm("west")
    assert len(network.arms) == 4
    assert (west.in_edges, west.out_edges) == (("w_wm", "wm_c"), ("c_w",))
    assert network.movement("west", "straight").edges == ("w_wm", "wm_c", "c_e")


@needs_netconvert
def test_turning_back_onto_the_other_carriageway_is_no_turn(tmp_path, monkeypatch):
    """Also where SUMO says that a way turns back and its two carriageways are two arms."""
    monkeypatch.setattr("rudc.network.build.OPTIONS", [o for o in OPTIONS if o != "--no-turnarounds"])
    monkeypatch.setattr("rudc.network.sides.MEDIAN_M", 0.0)
    edges = [edge for arm in "nsw" for edge in both_ways("c", arm)]
    edges += [("e1_c", "e1", "c", ""), ("c_e2", "c", "e2", "")]
    path = build(tmp_path, {**CROSS, "e1": (100, 5), "e2": (100, -5)}, edges)
    network = load_network(path)
    turns = {network.arm(m.destination).out_edge: m.turn for m in network.movements if "e1" in m.edges[0]}
    assert turns == {"c_n": "right", "c_w": "straight", "c_s": "left", "c_e2": "u_turn"}
    assert not [m for m in network.onward if (m.edges[0], m.edges[-1]) == ("e1_c", "c_e2")]
    (said,) = (text for text in check_network(path).warnings if "turns back" in text)
    assert said.endswith("turns back, and is left out")


@needs_netconvert
def test_one_way_roads_that_meet_only_far_away_stay_two_arms(tmp_path):
    nodes = {**CROSS, "far": (100, 100)}
    edges = [edge for arm in "ws" for edge in both_ways("c", arm)]
    edges += [(f"{a}_{b}", a, b, "") for a, b in (("c", "n"), ("n", "far"), ("far", "e"), ("e", "c"))]
    network = load_network(build(tmp_path, nodes, edges))
    assert {arm.name for arm in network.arms} == {"north", "east", "west", "south"}
    assert not network.arm("north").in_edges
    assert not network.arm("east").out_edges


CRESCENT = [(20, 0), (80, 0), (120, 60), (80, 100), (0, 100)]
"""m, the line of a second road from `c` to `n` of CROSS, which leaves `c` for the east"""


def with_crescent(arms):
    """CROSS' nodes with a crossing `n`, and the edges of a main road and of a crescent between `c` and `n`,
    listed so that the main road's first edge and the crescent's first are of opposite directions."""
    out = " ".join(f"{x},{y}" for x, y in CRESCENT)
    back = " ".join(f"{x},{y}" for x, y in reversed(CRESCENT))
    edges = [("a_main", "n", "c", ""), ("z_main", "c", "n", "")]
    edges += [("b_crescent", "c", "n", f'shape="0,0 {out}"'), ("y_crescent", "n", "c", f'shape="{back} 0,0"')]
    edges += [edge for pair in [("n", "nn"), ("n", "nw"), *arms] for edge in both_ways(*pair)]
    return {**CROSS, "nn": (0, 200), "nw": (-100, 100)}, edges


@needs_netconvert
def test_of_two_roads_to_one_neighbour_each_is_an_arm_of_its_own(tmp_path):
    network = load_network(build(tmp_path, *with_crescent([("c", "w"), ("c", "s")])), "c")
    assert {arm.name: (arm.in_edge, arm.out_edge) for arm in network.arms} == {
        "north": ("a_main", "z_main"),
        "east": ("y_crescent", "b_crescent"),
        "west": ("w_c", "c_w"),
        "south": ("s_c", "c_s"),
    }
    assert network.movement("south", "straight").destination == "north"


@needs_netconvert
@pytest.mark.parametrize("two_way", [True, False])
def test_a_road_that_comes_back_to_its_junction_belongs_to_one_arm(tmp_path, two_way):
    ring = [("c", "a"), ("a", "b"), ("b", "c")]
    edges = [edge for pair in [("c", "w"), *ring] for edge in both_ways(*pair)]
    if not two_way:
        edges = [edge for edge in edges if "w" in edge[0] or edge[1:3] in ring]
    path = build(tmp_path, {"c": (0, 0), "w": (-100, 0), "a": (60, -60), "b": (60, 60)}, edges)
    network = load_network(path, "c")
    assert len(network.arms) == 3
    used = [edge for arm in network.arms for edge in (*arm.in_edges, *arm.out_edges)]
    assert sorted(used) == sorted(edge[0] for edge in edges)
    for movement in network.movements:
        assert len({*movement.edges}) == len(movement.edges)
    with World(network) as world:
        world.reset(PlanSource(str(path), 20.0).plan(0))


@needs_netconvert
def test_of_three_edges_to_one_neighbour_one_is_a_one_way_road(tmp_path):
    nodes, edges = with_crescent([("c", "w"), ("c", "s")])
    edges = [edge for edge in edges if edge[0] != "z_main"]
    network = load_network(build(tmp_path, nodes, edges), "c")
    assert (network.arm("north").in_edge, network.arm("north").out_edge) == ("a_main", None)
    assert (network.arm("east").in_edge, network.arm("east").out_edge) == ("y_crescent", "b_crescent")


@needs_netconvert
def test_three_roads_are_a_junction_though_two_lead_to_one_neighbour(tmp_path):
    path = build(tmp_path, *with_crescent([("c", "s")]))
    assert {arm.name for arm in load_network(path, "c").arms} == {"north", "east", "south"}
