"""Entering a roundabout and driving round in it, among those who enter elsewhere; on scenes made by hand."""

# ruff: noqa: F811 -- fixtures come by import
import numpy as np
import pytest

from rudc.agents.gaps import crossing, suffices
from rudc.env.tracking import speeds_in_bends
from rudc.network.network import load_network
from rudc.world.yielding import must_yield
from tests.world.conftest import four_way, make_scene  # noqa: F401 -- fixtures


@pytest.fixture(scope="module")
def ring():
    return load_network("roundabout")


@pytest.fixture(scope="module")
def scene(make_scene, ring):
    """The ego, from the south to the west, `front` m beyond its line; the other, `towards` one arm from
    another, with its front `its` m beyond the line of its own."""

    def make(towards, *, front, its, v=6.0, ego_v=2.0):
        row = ring.movement(*towards).rows[0]
        other = {"row": row, "s": float(ring.paths.stop_s[row]) + its - 2.5, "v": v}
        return make_scene(other, network=ring, turn="left", front=front, v=ego_v)

    return make


def may_go(scene):
    """Whether the ego may enter, and whether it owes the other its way; None if they do not meet any more."""
    found = crossing(scene)
    if found is None:
        return None
    return bool(suffices(scene, found, speeds_in_bends(scene.route.path))[0]), bool(found.yields[0])


def test_ways_that_pass_each_others_entry_meet_twice(ring):
    route, row = ring.route("south", "left"), ring.movement("north", "east").rows[0]
    met, whole = ring.crossings(route, route.row), ring.conflict(route)
    first, again = met.table[row], met.again[row]
    assert first[1] < again[0]
    assert again[3] < first[2]
    assert [first[0], again[1], again[2], first[3]] == whole[row].tolist()
    for s, its_s in ((first[0], first[2]), (again[1], again[3])):
        here, there = np.array(route.path.pose(s)[:2]), np.array(ring.paths.pose(row, its_s)[:2])
        assert np.hypot(*(here - there)) < 3.0
    twice = np.isfinite(met.again[:, 0])
    assert (twice <= ring.yields_on_entering(route.row)).all()
    assert np.array_equal(met.table[~twice], whole[~twice], equal_nan=True)


def test_elsewhere_ways_meet_once(four_way):
    for origin in ("south", "west"):
        for turn in ("left", "straight", "right"):
            route = four_way.route(origin, turn)
            met = four_way.crossings(route, route.row)
            assert np.array_equal(met.table, four_way.conflict(route), equal_nan=True)
            assert np.isnan(met.again).all()
            assert not four_way.yields_on_entering(route.row).any()


def test_those_who_go_on_in_one_lane_merge(ring):
    """Also where they part at an exit, before the ego does."""
    route = ring.route("south", "left")
    rows = [ring.movement("west", towards).rows[0] for towards in ("east", "north")]
    assert ring.crossings(route, route.row).merges[rows].all()
    assert (ring.paths.destination[rows] != ring.paths.destination[route.row]).all()


@pytest.mark.parametrize("towards", ["east", "north"])
def test_it_enters_before_one_who_comes_from_afar_and_waits_for_one_who_is_near(scene, towards):
    """From the west: its entry is 27 m before the ego's."""
    assert may_go(scene(("west", towards), front=0.0, its=-25.0)) == (True, True)
    assert may_go(scene(("west", towards), front=0.0, its=10.0)) == (False, True)


def test_who_enters_beyond_the_ego_is_waited_for_only_where_he_passes(scene):
    """From the north to the east: half round the ring is between his entry and the ego's."""
    assert may_go(scene(("north", "east"), front=0.0, its=2.0)) == (True, True)
    assert may_go(scene(("north", "east"), front=0.0, its=38.0)) == (False, True)


def test_once_in_the_ring_it_goes_before_those_who_enter(scene):
    assert may_go(scene(("north", "east"), front=35.0, its=-12.0)) == (True, False)
    late = scene(("north", "east"), front=35.0, its=3.0, v=3.0, ego_v=6.0)
    assert may_go(late) == (False, False)


def test_those_in_the_ring_do_not_brake_for_an_ego_that_comes_to_its_line(scene):
    for its in range(10, 60, 4):
        for front in (-4.0, -2.0, -1.0, 0.0):
            assert not must_yield(scene(("north", "east"), front=front, its=its, ego_v=3.0)).rows


def test_who_enters_brakes_for_an_ego_in_the_ring(scene):
    assert must_yield(scene(("north", "east"), front=52.0, its=-1.0, v=6.0, ego_v=6.0)).rows == [0]
