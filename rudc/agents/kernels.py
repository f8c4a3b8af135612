"""The agents' arithmetic as kernels; formulas stand at the heads of the modules that call them."""

from __future__ import annotations

import math

from rudc.env.kernels import interpolated, leader, seen_from_line
from rudc.kernels import Table, Vector, kernel


@kernel
def two_way(
    x: float, y: float, knots: Vector, values: Table, other_knots: Vector, other_values: Table
) -> tuple[float, float, float]:
    """f(x) + g(y) of three pairs of functions, linear between K knots with values (3, K), and L knots."""
    return (
        interpolated(x, knots, values[0]) + interpolated(y, other_knots, other_values[0]),
        interpolated(x, knots, values[1]) + interpolated(y, other_knots, other_values[1]),
        interpolated(x, knots, values[2]) + interpolated(y, other_knots, other_values[2]),
    )


@kernel
def who_leads(
    line: Table, course: Vector, spacing: float, position: Table, heading: Vector, velocity: Table,
    size: Table, ego_s: float, ego_length: float, ego_width: float, slowest: float, same_way: float,
    reach: float,
) -> tuple[float, float]:  # fmt: skip
    """m from the ego's front along its line (M, 2) m, with directions `course` (M,) rad, to the rear of its
    leader, inf for nobody, and m/s of the leader along it.

    The `leader` among those faster than `slowest` m/s that head its way, `reach` m ahead; `same_way` is the
    cosine of the angle up to which one does.
    """
    first = min(max(int(ego_s / spacing), 0), len(course) - 1)
    last = first + int(reach / spacing) + 1
    seen = seen_from_line(line[first:last], course[first:last], spacing, position, heading)
    for i in range(len(heading)):
        speed = math.hypot(velocity[i, 0], velocity[i, 1])
        if speed <= slowest or seen[i, 2] <= same_way:
            seen[i, 0] = -math.inf
    front = ego_s - first * spacing
    who, rear = leader(seen, size, front, ego_width)
    if rear == math.inf:
        return math.inf, 0.0
    return rear - front - 0.5 * ego_length, math.hypot(velocity[who, 0], velocity[who, 1]) * seen[who, 2]
