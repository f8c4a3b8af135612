"""A wider turn: the line over a movement that a car can drive where the lanes' own shapes bend too tightly.

The line is the lanes', smoothed over BASE m and moved sideways by offsets l(s): a cubic spline through knots
KNOTS m apart, 0 at both ends. The knots are found by nonlinear least squares (scipy) over what the line
should not have:

    TIGHT (|k| - EASIER tightest)+,  BENT k,  JERKY dk/ds            its curvature k, 1/m
    OUTSIDE (MARGIN - depth)+                                      m of road beside each corner of the car
    ACROSS (OWN - depth)+                                   m of own carriageway beside its centre of gravity
    OVER (INSIDE - depth)+                              m of own carriageway beside each corner of the car
    ASIDE l                                                                                              m

It swings out before the turn and after it, within its own carriageway, as drivers do. A corner of
the car comes into a neighbouring lane only where the turn is too tight otherwise: those who wait at the stop
lines there need the room.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rudc.arrays import Array
from rudc.geometry import rectangle_corners
from rudc.network.depths import Depths
from rudc.network.polyline import arc_length, resample, smooth, union_boundary
from rudc.network.route import ReferencePath
from rudc.network.surface import Surface
from rudc.vehicle import EgoVehicle

AROUND = 18.0
"""m before the stop line and beyond the exit within which the line may differ from the lanes'"""
BASE, KNOTS, FINE = 10.0, 2.5, 0.05
"""m of smoothing, m between knots, m between drawn points"""
TIGHT, BENT, JERKY, OUTSIDE, ACROSS, ASIDE = 150.0, 1.0, 6.0, 12.0, 6.0, 0.05
OVER = 6.0, 0.0
"""weights of the corners outside the own carriageway: the first with which the car can drive the line on the
road is taken, or the last"""
MARGIN, OWN, EASIER = 0.3, 0.4, 0.95
"""m beside each corner, m beside the centre of gravity, share of the tightest curvature"""
INSIDE = 0.1
"""m of own carriageway beside each corner"""
DRIVEN = 1.05
"""share of the tightest curvature that the car can drive without leaving its line much"""
HOPELESS = 1.5
"""share of the tightest curvature beyond which no weights make a line that the car can drive"""
STATIONS = 1.0
"""m between the places that are judged"""
ROUNDS, ENOUGH = 15, 1e-2
"""rounds of least squares, at most; relative gain below which they end sooner"""
DIFFERENCE = 1.5e-8
"""m, step of the forward differences, for knots below a metre"""


def widened(
    surface: Surface,
    carriageway: Sequence[Array],
    line: Array,
    span: tuple[float, float],
    body: EgoVehicle,
) -> ReferencePath:
    """The line (K, 2) m, wider between stop line and exit (`span`, m along it).

    `carriageway`: polygons (K, 2) m of the movement.
    """
    from scipy.interpolate import make_interp_spline  # few networks need these, and they load slowly
    from scipy.optimize import least_squares

    fine = resample(line, np.arange(0.0, arc_length(line)[-1], FINE))
    base = ReferencePath(smooth(fine, FINE, BASE))
    own, lanes = Depths(base, carriageway, union_boundary(carriageway)), Surface(carriageway, ())
    first, last = max(span[0] - AROUND, 0.0), min(span[1] + AROUND, base.length)
    s = np.arange(first, last, STATIONS)
    knots = np.linspace(first, last, max(round((last - first) / KNOTS), 4))
    x, y, psi = base.pose(s)
    normal = np.column_stack([-np.sin(psi), np.cos(psi)])
    size = np.broadcast_to([body.length, body.width], (len(s), 2))

    splines = make_interp_spline(knots, np.eye(len(knots))[:, 1:-1], k=3, bc_type="clamped")(s)

    def shape(free: Array) -> tuple[Array, ...]:
        """Of lines with free knots (..., K) m: (..., S) m aside, m between stations and 1/m of curvature, and
        (..., S, 4, 2) m, the car's corners."""
        aside = free @ splines.T
        xy = np.column_stack([x, y]) + aside[..., None] * normal
        step = np.gradient(xy, axis=-2)
        spacing = np.hypot(step[..., 0], step[..., 1])
        heading = np.unwrap(np.arctan2(step[..., 1], step[..., 0]))
        bend = np.gradient(heading, axis=-1) / spacing
        turned = heading - np.arcsin(np.clip(body.cg_to_rear * bend, -0.9, 0.9))
        return aside, spacing, bend, rectangle_corners(xy, turned, size)

    def missing(where: Surface, margin: float, corners: Array) -> Array:
        """(..., C) m that corners (..., S, 4, 2) m lack of `margin` m inside an area."""
        lack = np.maximum(margin - where.signed_distance(corners), 0.0)
        return lack.reshape(*lack.shape[:-2], -1)

    def faults(free: Array, over: float) -> Array:
        """(..., F) faults, weighted, of lines with free knots (..., K) m."""
        aside, spacing, bend, corners = shape(free)
        return np.concatenate(
            [
                TIGHT * np.maximum(np.abs(bend) - EASIER * body.tightest, 0.0),
                BENT * bend,
                JERKY * np.gradient(bend, axis=-1) / spacing,
                OUTSIDE * missing(surface, MARGIN, corners),
                ACROSS * np.maximum(OWN - own.at(s, aside), 0.0),
                *([over * missing(lanes, INSIDE, corners)] if over else []),
                ASIDE * aside,
            ],
            axis=-1,
        )

    def slopes(free: Array, over: float) -> Array:
        """(F, K) of `faults` by forward differences, all knots at once."""
        moved = free + np.diag(np.copysign(DIFFERENCE * np.maximum(np.abs(free), 1.0), free))
        return ((faults(moved, over) - faults(free, over)) / np.diag(moved - free)[:, None]).T

    found = unmoved = np.zeros(len(knots) - 2)
    for over in OVER:
        found = least_squares(
            faults,
            unmoved,
            slopes,  # pyright: ignore[reportArgumentType] - scipy takes functions, but its types do not say so
            max_nfev=ROUNDS,
            ftol=ENOUGH,
            args=(over,),
        ).x.round(3)
        _, _, bend, corners = shape(found)
        tightest = np.abs(bend).max() / body.tightest
        if tightest > HOPELESS or (tightest <= DRIVEN and not missing(surface, 0.0, corners).any()):
            break
    stations = np.arange(0.0, base.length, FINE)
    x_all, y_all, psi_all = base.pose(stations)
    aside = np.interp(stations, s, splines @ found, left=0.0, right=0.0)
    xy = np.column_stack([x_all - aside * np.sin(psi_all), y_all + aside * np.cos(psi_all)])
    return ReferencePath(smooth(resample(xy, np.arange(0.0, arc_length(xy)[-1], FINE)), FINE, 2.0))
