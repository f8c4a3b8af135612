"""Path following as kernels; the docstring of tracking.py gives the formulas."""

from __future__ import annotations

import math

from rudc.kernels import Table, Vector, half_turn, kernel
from rudc.network.line_kernels import between, on_line


@kernel
def slip_in_bend(bend: float, cg_to_rear: float) -> float:
    """rad, slip with which the ego drives round a bend of curvature `bend` (1/m); the sine is cut at 0.9."""
    return math.asin(min(max(cg_to_rear * bend, -0.9), 0.9))


@kernel
def deviation(
    poses: Table, curvature: Vector, s: float, psi: float, v: float, preview: float, cg_to_rear: float
) -> tuple[float, float, float]:
    """For an ego at s m on a line, heading psi rad at v m/s: the line's curvature (1/m) where the ego will be
    after `preview` s, the slip (rad) that this curvature needs, and the angle (rad) from the line to the
    direction of travel with that slip.
    """
    bend = between(curvature, s + preview * v)
    slip = slip_in_bend(bend, cg_to_rear)
    astray = psi + slip - on_line(poses, len(poses), 0, s)[1]
    return bend, slip, half_turn(astray)


@kernel
def way_back(v: float, seconds: float, longest: float, cg_to_rear: float) -> float:
    """m, L of rudc/env/tracking.py at v m/s: as far as the ego drives in `seconds`, 2 l_r at least and
    `longest` m at most."""
    return min(longest, max(2.0 * cg_to_rear, seconds * v))


@kernel
def front_wheels(
    poses: Table, curvature: Vector, s: float, offset: float, psi: float, v: float, preview: float,
    seconds: float, longest: float, wheelbase: float, cg_to_rear: float, delta_max: float,
) -> float:  # fmt: skip
    """rad, front-wheel angle of an ego that follows a line and is `offset` m left of it, by the formulas of
    rudc/env/tracking.py; `seconds` and `longest` m as for `way_back`.
    """
    within = way_back(v, seconds, longest, cg_to_rear)
    bend, _, astray = deviation(poses, curvature, s, psi, v, preview, cg_to_rear)
    astray, offset = min(max(astray, -1.0), 1.0), min(max(offset, -2.0), 2.0)
    wanted = bend - 2.0 * astray / within - offset / (within * within)
    delta = math.atan(wheelbase / cg_to_rear * math.tan(slip_in_bend(wanted, cg_to_rear)))
    return min(max(delta, -delta_max), delta_max)
