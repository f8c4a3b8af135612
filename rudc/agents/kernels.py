"""The agents' arithmetic as kernels; formulas stand at the heads of the modules that call them."""

from __future__ import annotations

from rudc.env.kernels import interpolated
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
