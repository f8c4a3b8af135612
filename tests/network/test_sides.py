"""Which one-way edges are the two sides of one road."""

import pytest

from rudc.network.network import load_network
from tests.network.test_reader import CROSS, both_ways, build, needs_netconvert


@needs_netconvert
@pytest.mark.parametrize(("apart", "one"), [(12.0, True), (30.0, False), (-12.0, False)])
def test_two_sides_of_a_road_that_lie_side_by_side_are_one_arm(tmp_path, apart, one):
    """Also where a slip lane parts from one of them, so that they share no node: unless the median is wide,
    or the one to the junction lies on the right of the other."""
    y = 0.5 * apart
    nodes = {**CROSS, "e1": (60, y), "e2": (75, -y), "far": (160, y), "off": (160, -y), "slip": (30, 80)}
    edges = [edge for arm in "nsw" for edge in both_ways("c", arm)]
    edges += [
        ("in", "e1", "c", f'shape="60,{y} 3,{y} 0,0"'),
        ("out", "c", "e2", f'shape="0,0 3,{-y} 75,{-y}"'),
    ]
    edges += [("before", "far", "e1", ""), ("past", "e1", "slip", ""), ("behind", "e2", "off", "")]
    network = load_network(build(tmp_path, nodes, edges), "c")
    east = [arm for arm in network.arms if arm.name.startswith("east")]
    assert [(arm.in_edge, arm.out_edge) for arm in east].count(("in", "out")) == one
    turning_back = ("in", "out") in [(m.edges[0], m.edges[-1]) for m in network.onward]
    assert not (one and turning_back)
