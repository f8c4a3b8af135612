import re
from dataclasses import replace

import numpy as np
import pytest

from rudc.data import data_folder
from rudc.errors import NetworkError
from rudc.geometry import rectangle_gaps
from rudc.network.build import build_network
from rudc.network.check import check_network, waiting_warnings
from rudc.network.network import load_network, shipped_networks
from tests.world.networks import in_pieces, single_track


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_shipped_networks_have_nothing_to_complain_of(name):
    report = check_network(name)
    assert report.warnings == ()
    assert report.name == name
    assert len(report.arms) == len(load_network(name).arms)
    onwards = [m for m in load_network(name).movements if m.turn != "u_turn"]
    assert [(m.origin, m.destination) for m in report.movements] == [
        (m.origin, m.destination) for m in onwards
    ]


def test_a_report_says_what_was_understood():
    report = check_network("four_way")
    assert (report.junction, report.kind, report.road_km) == ("centre", "priority", pytest.approx(0.48))
    south = next(arm for arm in report.arms if arm.name == "south")
    assert (south.in_lanes, south.out_lanes, south.lane_width_m, south.speed_mps) == (2, 2, 3.5, 10.0)
    assert south.bearing_deg == pytest.approx(-90.0)
    left = next(m for m in report.movements if (m.origin, m.turn) == ("west", "left"))
    assert left.lanes == (1,)
    assert left.yields
    assert left.least_radius_m == pytest.approx(10.5, rel=0.03)
    assert left.waiting_m > 7.0
    assert all((m.waiting_m is None) != m.yields for m in report.movements)
    assert check_network("roundabout").kind == "roundabout"


def test_a_bend_that_is_too_tight_is_shown():
    """Its place counts from the junction's centre, as places in scenario files do."""
    path = data_folder("results") / "held-out-28" / "networks" / "bent_priority" / "bent_priority.net.xml"
    network = load_network(path)
    route = network.route("northeast", "northwest")
    assert np.hypot(*network.center) > 20.0
    (found,) = [
        text for text in check_network(path).warnings if f"from {route.origin} to northwest bends" in text
    ]
    x, y, away, where = re.fullmatch(
        r".* m at \[(-?\d+), (-?\d+)\], (\d+) m (before|beyond) its .*", found
    ).groups()
    s = route.stop_line_s + (float(away) if where == "beyond" else -float(away))
    assert np.hypot(*(np.array(route.path.pose(s)[:2]) - network.center - (float(x), float(y)))) < 1.5
    k = np.abs(route.path.curvature).argmax()
    assert route.path.s[k] == pytest.approx(s, abs=0.51)


def test_an_arm_is_as_narrow_as_its_narrowest_part():
    report = check_network(data_folder("results") / "held-out-10" / "hump_bridge" / "hump_bridge.net.xml")
    north = next(arm for arm in report.arms if arm.name == "north")
    assert (north.lane_width_m, north.speed_mps) == (2.6, pytest.approx(13.9, abs=0.01))


def changed(tmp_path, *replacements, name="four_way"):
    """A copy of a shipped network with words replaced."""
    text = load_network(name).path.read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "own.net.xml"
    path.write_text(text)
    return check_network(path).warnings


def test_each_trouble_is_named(tmp_path):
    lane = '<lane id="west_in_0" index="0" speed="{}" length="120.00" width="{}"{}'
    narrow = changed(
        tmp_path,
        (lane.format("10.00", "3.50", ""), lane.format("20.00", "2.40", ' disallow="bicycle truck"')),
        ('length="120.00"', 'length="40.00"'),
    )
    with pytest.raises(NetworkError, match=r"has traffic lights.*netconvert -s own\.net\.xml"):
        changed(tmp_path, ('type="priority"', 'type="traffic_light"'))
    assert any("lane west_in_0 is only 2.40 m wide" in w for w in narrow)
    assert any("lane west_in_0 has a limit of 20.0 m/s" in w for w in narrow)
    both = changed(
        tmp_path,
        ('type="priority"', 'type="unregulated"'),
        *(
            (f'id="west_in_{k}" index="{k}" speed="10.00"', f'id="west_in_{k}" index="{k}" speed="20.00"')
            for k in (0, 1)
        ),
    )
    assert any("`unregulated`" in w for w in both)
    assert [w for w in both if "limit of 20.0" in w] == [
        "lanes west_in_0, west_in_1 have a limit of 20.0 m/s; the ego drives at most 15 m/s"
    ]
    assert any("lane west_in_0 refuses truck, bicycle" in w for w in narrow)
    assert any("arm south is only 40 m long" in w for w in narrow)
    way = '<connection from="south_in" to="west_out"'
    lost = changed(tmp_path, (way, f'{way} allow="bus"'))
    assert lost == ("no movement leads from arm south to arm west",)
    also = way.replace("west_out", "east_out")
    more = changed(tmp_path, (way, f'{way} allow="bus"'), (also, f'{also} allow="bus"'))
    assert more == ("no movement leads from arm south to arms east, west",)


def test_a_lane_that_cannot_be_named_says_what_can():
    sets = data_folder("results")
    tannery = load_network(sets / "held-out-13" / "networks" / "tannery.net.xml")
    with pytest.raises(
        NetworkError, match=r"'south_out_0' .* closed to cars \(for bicycle only\).*`position: "
    ):
        tannery.stretch("south_out_0")
    orchard = load_network(sets / "held-out-13" / "networks" / "orchard.net.xml")
    far = next(
        lane for arm in orchard.arms for lane in orchard.lanes_of(arm)
        if lane.edge in arm.in_edges and lane.edge != arm.in_edge
    )  # fmt: skip
    with pytest.raises(NetworkError, match=r"not next to the junction; name one of .*_in_0.*`at` counts on"):
        orchard.stretch(far.id)


def test_where_both_directions_share_a_lane_no_way_is_wrong(tmp_path):
    """The ego drove the wrong way there from the first decision on."""
    path = single_track(tmp_path)
    (warning,) = (text for text in check_network(path).warnings if "overlap" in text)
    assert warning.startswith("lanes west_in_0 and west_out_0 overlap")
    network = load_network(path)
    for route, way_is_known in (
        (network.route("west", "left"), False),
        (network.route("north", "left"), True),
    ):
        directions = [network.surface.direction(*map(float, route.path.pose(s)[:2])) for s in (20.0, 60.0)]
        assert np.isfinite(directions).tolist() == [way_is_known] * 2


def test_a_short_way_in_is_named_also_where_the_way_out_is_long(tmp_path):
    old = '<lane id="south_in_{}" index="{}" speed="10.00" length="120.00"'
    short = [(old.format(k, k), old.format(k, k).replace("120", "30")) for k in (0, 1)]
    (warning,) = changed(tmp_path, *short)
    assert warning.startswith("arm south is only 30 m long on its way in;")


def test_trouble_farther_out_on_an_arm_is_named(tmp_path):
    """The arm is driven to its end."""
    path = in_pieces(tmp_path)
    text, far = path.read_text(), '<lane id="north_in1_0" index="0" speed="5.00"'
    assert far in text
    path.write_text(text.replace(far, f'{far[:-6]}"20.00" width="2.20" disallow="truck"'))
    warnings = check_network(path).warnings
    assert "lane north_in1_0 is only 2.20 m wide; from 2.6 m on a car of 1.8 m has a margin" in warnings
    assert "lane north_in1_0 refuses truck; such traffic cannot appear on it" in warnings
    assert "lane north_in1_0 has a limit of 20.0 m/s; the ego drives at most 15 m/s" in warnings


def test_lanes_for_buses_are_named_as_left_out(tmp_path):
    """They were missing from the table of arms, without a word."""
    lanes = [(f'id="{arm}_{k}" index="{k}"', f'id="{arm}_{k}" index="{k}" allow="{who}"')
             for arm, k, who in (("west_in", 0, "bus bicycle"), ("south_out", 0, "bicycle bus"),
                                 ("north_out", 0, "pedestrian"))]  # fmt: skip
    warnings = changed(tmp_path, *lanes)
    left_out = [warning for warning in warnings if "left out" in warning]
    assert left_out == [
        "lanes west_in_0, south_out_0 are closed to cars (for bus, bicycle only) and left out: no part of "
        "the ego's road"
    ]
    assert not any("north_out_0" in warning for warning in warnings), "a pavement is no part of the road"


@pytest.mark.parametrize("who", ["rail", "tram", "subway"])
def test_rails_are_named_as_left_out(tmp_path, who):
    """An arm for trains was missing from the table without a word."""
    warnings = changed(tmp_path, ('id="west_in_0" index="0"', f'id="west_in_0" index="0" allow="{who}"'))
    assert any(f"lane west_in_0 is closed to cars (for {who} only) and left out" in w for w in warnings)


def test_waiting_cars_that_overlap_are_named():
    network = load_network("four_way")
    one, other = network.route("south", "left"), network.route("west", "left")
    deep = [replace(route, waiting_s=route.stop_line_s + 15.0) for route in (one, other)]
    assert list(waiting_warnings([one, other])) == []
    (warning,) = waiting_warnings(deep)
    assert "a car from south to west and one from west to north overlap" in warning


def test_ways_that_meet_head_on_without_right_of_way_are_named():
    """The right turn and the left turn between two arms at an acute angle: bodies do overlap."""
    path = data_folder("results") / "held-out-26" / "networks" / "saddle_fork" / "saddle_fork.net.xml"
    network = load_network(path)
    (said,) = [text for text in check_network(path).warnings if "head-on" in text]
    paths, row = network.paths, {}
    for k in range(paths.count):
        origin, destination = network.arms[paths.origin[k]].name, network.arms[paths.destination[k]].name
        row[f"from {origin} to {destination}"] = k
    one, other = (row[way] for way in said.removeprefix("vehicles ").split(" meet ")[0].split(" and "))
    assert not paths.yields[one, other]
    assert not paths.yields[other, one]
    inside = [np.linspace(paths.stop_s[k], paths.exit_s[k], 60) for k in (one, other)]
    its_x, its_y, its_psi = paths.pose(np.full(60, other), inside[1])
    meets = False
    for x, y, psi in np.column_stack(paths.pose(np.full(60, one), inside[0])).tolist():
        against = np.cos(its_psi - psi) < -0.86
        place, size = np.column_stack([its_x, its_y])[against], np.tile((5.0, 1.8), (against.sum(), 1))
        meets |= bool((rectangle_gaps(x, y, psi, 5.0, 1.8, place, its_psi[against], size) == 0.0).any())
    assert meets


def test_tracks_across_an_arm_are_named_and_its_length_is_what_at_counts(tmp_path):
    """The crossing was not mentioned, and its 6 m counted in the one length and not in the other."""
    nodes = {
        "c": (0, 0),
        "east": (120, 0),
        "west": (-120, 0),
        "far": (0, -120),
        "r1": (-90, -60),
        "r2": (90, -60),
    }
    ways = [("east", "c"), ("c", "east"), ("west", "c"), ("c", "west"), ("far", "r"), ("r", "c"), ("c", "r"),
            ("r", "far"), ("r1", "r"), ("r", "r2")]  # fmt: skip
    rows = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in nodes.items())
    rows += '<node id="r" x="0" y="-60" type="rail_crossing"/>'
    (tmp_path / "own.nod.xml").write_text(f"<nodes>{rows}</nodes>")
    rails = dict.fromkeys((("r1", "r"), ("r", "r2")), "allow='rail'")
    rows = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" speed="10" {rails.get((a, b), "")}/>' for a, b in ways
    )
    (tmp_path / "own.edg.xml").write_text(f"<edges>{rows}</edges>")
    report = check_network(build_network(tmp_path))
    tracks = "tracks cross arm south at [0, -60], 60 m from the junction's centre: there are no trains here"
    assert [text for text in report.warnings if "tracks" in text] == [tracks]
    south = next(arm for arm in report.arms if arm.name == "south")
    assert south.length_m == report.network.stretch("south_in_0").reach
    assert south.length_m > report.network.arm("south").length + 4.0


def test_ways_that_cross_or_merge_without_right_of_way_do_not_meet_head_on(tmp_path):
    """They were said to meet head-on; where nobody has right of way, 12 lines said so."""
    source = data_folder("sumo_networks") / "t_junction"
    for part in ("nod", "edg", "typ"):
        text = (source / f"t_junction.{part}.xml").read_text()
        (tmp_path / f"own.{part}.xml").write_text(text)
    free = "".join(
        f'<connection from="south_in" to="{arm}_out" fromLane="{k}" toLane="{k}" pass="true"/>'
        for k, arm in enumerate(("east", "west"))
    )
    (tmp_path / "own.con.xml").write_text(f"<connections>{free}</connections>")
    path = build_network(tmp_path)
    said = [text for text in check_network(path).warnings if "neither must yield" in text]
    assert said
    assert all("cross or merge" in text for text in said)
    path.write_text(path.read_text().replace('type="priority"', 'type="unregulated"'))
    assert len([text for text in check_network(path).warnings if "vehicles" in text]) == 1


@pytest.mark.parametrize("y", [-0.5, 0.0, 0.5])
def test_the_west_is_at_180_degrees(tmp_path, y):
    """In the next network it was at -180."""
    rows = f'<node id="c" x="0" y="0"/><node id="w" x="-120" y="{y}"/><node id="e" x="120" y="0"/>'
    (tmp_path / "own.nod.xml").write_text(f'<nodes>{rows}<node id="s" x="0" y="-120"/></nodes>')
    rows = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" speed="10"/>' for x in "wes" for a, b in ((x, "c"), ("c", x))
    )
    (tmp_path / "own.edg.xml").write_text(f"<edges>{rows}</edges>")
    west = next(arm for arm in check_network(build_network(tmp_path)).arms if arm.name == "west")
    assert west.bearing_deg == pytest.approx(180.0, abs=0.5)
