"""Which lanes a standing thing leaves too narrow to drive, where the road bends."""

from types import SimpleNamespace

import numpy as np
import pytest

from rudc.geometry import rectangle_corners
from rudc.network.polyline import arc_length, offset_polyline, resample
from rudc.world.entering import obstructed

BEND = np.array([[-140.0, -18.0], [-80.0, -8.0], [-40.0, -2.0], [0.0, 0.0]])
"""m, a road whose chord lies 4 m beside it"""
WIDTH, FREE = 3.25, 1.1


def lane(aside):
    xy = offset_polyline(BEND, aside)
    return SimpleNamespace(xy=xy, width=WIDTH, length=float(arc_length(xy)[-1]))


@pytest.mark.parametrize("s", [15.0, 60.0, 75.0, 100.0, 130.0])
def test_what_stands_in_a_lane_leaves_the_lane_beside_it_free(s):
    right, left = lane(-1.5 * WIDTH), lane(-0.5 * WIDTH)
    here, on = resample(right.xy, np.array([s, s + 0.1]))
    heading = np.arctan2(*(on - here)[::-1])
    corners = rectangle_corners(here, np.array(heading), np.array([5.0, 1.8]))
    first, last = obstructed(right, corners, FREE)
    assert first == pytest.approx(s - 2.5, abs=0.3)
    assert last == pytest.approx(s + 2.5, abs=0.3)
    assert obstructed(left, corners, FREE) is None


def test_in_bends_stretches_are_counted_as_the_file_states_lengths():
    """SUMO has all lanes of an edge be as long; those on the inside of a bend are drawn shorter."""
    drawn = lane(-1.5 * WIDTH)
    stated = SimpleNamespace(xy=drawn.xy, width=WIDTH, length=1.1 * drawn.length)
    corners = rectangle_corners(resample(drawn.xy, np.array([100.0]))[0], np.array(0.1), np.array([5.0, 1.8]))
    assert obstructed(stated, corners, FREE) == pytest.approx(
        [1.1 * s for s in obstructed(drawn, corners, FREE)]
    )


@pytest.mark.parametrize(("length", "blocked"), [(0.16, False), (0.39, False), (0.8, True)])
def test_on_a_stub_of_lane_no_stretch_ends_before_it_begins(length, blocked):
    stub = SimpleNamespace(xy=np.array([[0.0, 0.0], [length, 0.0]]), width=WIDTH, length=length)
    corners = rectangle_corners(np.array([0.5 * length, 0.0]), np.array(0.0), np.array([5.0, 1.8]))
    span = obstructed(stub, corners, FREE)
    assert (span is not None) == blocked
    assert span is None or 0.0 < span[0] < span[1] < length
