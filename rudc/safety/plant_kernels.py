"""The plant monitor's arithmetic as kernels (see rudc/safety/plant.py): D dead times, L lags, F frictions."""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import NewCube, NewVector, Rows, Table, Vector, kernel

SLOW = 0.1
"""m/s, speed up to which friction does not limit the front wheels, as in rudc/world/ego.py"""


@kernel
def widest_angles(limit: Vector, v: float, cg_to_rear: float, ratio: float) -> tuple[NewVector, NewVector]:
    """(F,) rad, front-wheel angles at which tyres that give `limit` (F,) m/s2 begin to slide; (F,) tangents.

    sin(slip) = limit l_r / v^2, tan(delta) = tan(slip) / ratio with ratio = l_r / wheelbase.
    """
    angle, tangent = np.full(len(limit), math.inf), np.full(len(limit), math.inf)
    if v > SLOW:
        for f in range(len(limit)):
            sin_slip = min(limit[f] * (cg_to_rear / v**2), 0.999)
            tangent[f] = sin_slip / math.sqrt(1.0 - sin_slip * sin_slip) / ratio
            angle[f] = math.atan(tangent[f])
    return angle, tangent


@kernel
def within_friction(
    a: float, tangent: float, limit: float, v: float, cg_to_rear: float, ratio: float
) -> float:
    """m/s2, what the friction circle leaves of an acceleration `a` (m/s2) at a front-wheel angle whose
    tangent is `tangent`.

    The lateral acceleration is v^2 sin(slip) / l_r with tan(slip) = ratio tan(delta).
    """
    tan_slip = ratio * tangent
    across = v**2 * (tan_slip / math.sqrt(1.0 + tan_slip * tan_slip)) / cg_to_rear
    left = math.sqrt(max(limit * limit - across * across, 0.0))
    return min(max(a, -left), left)


@kernel
def drive_bank(
    a: NewCube, delta: NewCube, given: Table, delays: Rows, keep: Vector, limit: Vector, between: Vector,
    now: complex, read: complex, std: complex, substeps: int, v: float, v_after: float, cg_to_rear: float,
    ratio: float,
) -> int:  # fmt: skip
    """Fill in the accelerations `a` m/s2 and front-wheel angles `delta` rad (D, L, F) of a part of the bank
    after some sub-steps. `now`: those that were read before, a + i delta; meanwhile the speed goes from v to
    v_after m/s. Returns 0.

    `read`: those that were read after these sub-steps; `std`: the sizes of their errors. Where the road may
    limit the angle, since its friction may lie between two of the bank's, both are moved towards what was
    read: they are then as far off, in errors of size std, as they were in errors of size std + |a| and
    std + `between` |delta|, since an angle at the limit may leave the brakes anything up to a.

    `given`: (delays[-1] + substeps or more, 2) m/s2 and rad, the commands of these sub-steps and of those
    before, newest first; `delays`: (D,) sub-steps, increasing; `keep`: (L,) share of the difference from the
    command that is left after a sub-step; `limit`, `between`: (F,) m/s2, what friction gives, and shares.
    """
    lags, frictions = a.shape[1:]
    wanted_a, wanted_delta = np.empty(frictions), np.empty(frictions)
    widest, widest_tangent = widest_angles(limit, v, cg_to_rear, ratio)
    for f in range(frictions):
        turned = min(max(now.imag, -widest[f]), widest[f])
        wanted_delta[f] = turned
        wanted_a[f] = within_friction(now.real, math.tan(turned), limit[f], v, cg_to_rear, ratio)
    a[:], delta[:] = wanted_a, wanted_delta
    for i in range(substeps):
        here = v + (v_after - v) * i / substeps
        widest, widest_tangent = widest_angles(limit, here, cg_to_rear, ratio)
        before = 0
        for d in range(len(delays)):
            acts = delays[d] + substeps - 1 - i
            a_d, delta_d = given[acts, 0], given[acts, 1]
            if d == 0 or a_d != given[before, 0] or delta_d != given[before, 1]:  # else as for the last d
                tangent = math.tan(delta_d)
                for f in range(frictions):
                    turned = min(max(tangent, -widest_tangent[f]), widest_tangent[f])
                    wanted_delta[f] = min(max(delta_d, -widest[f]), widest[f])
                    wanted_a[f] = within_friction(a_d, turned, limit[f], here, cg_to_rear, ratio)
            before = acts
            for k in range(lags):
                for f in range(frictions):
                    a[d, k, f] = wanted_a[f] + (a[d, k, f] - wanted_a[f]) * keep[k]
                    delta[d, k, f] = wanted_delta[f] + (delta[d, k, f] - wanted_delta[f]) * keep[k]
    for d in range(len(delays)):
        wanted = abs(given[delays[d], 1])
        for f in range(frictions):
            if between[f] > 0.0 and wanted > widest[f] * (1.0 - between[f]):
                for k in range(lags):
                    a_m, delta_m = a[d, k, f], delta[d, k, f]
                    a[d, k, f] = read.real + (a_m - read.real) * std.real / (std.real + abs(a_m))
                    share = std.imag / (std.imag + between[f] * abs(delta_m))
                    delta[d, k, f] = read.imag + (delta_m - read.imag) * share
    return 0


@kernel
def score_bank(
    cost: NewVector, a: NewVector, delta: NewVector, acceleration: float, steering: float, counts: float,
    forget: float, a_std: float, delta_std: float, cut: float, worst: float,
) -> int:  # fmt: skip
    """Update `cost`, the J of the M models, with a reading; their least is 0, their largest `worst` at most.
    Returns 0.

    `counts`: 1 if the acceleration counts, else 0. The arrays are contiguous, so that compiled code can
    process several models at a time.
    """
    for m in range(len(cost)):
        off_a, off_delta = (a[m] - acceleration) / a_std, (delta[m] - steering) / delta_std
        cost[m] = forget * cost[m] + counts * min(off_a * off_a, cut) + min(off_delta * off_delta, cut)
    least = cost.min()
    for m in range(len(cost)):
        cost[m] = min(cost[m] - least, worst)
    return 0
