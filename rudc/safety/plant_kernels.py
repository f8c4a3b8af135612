"""The plant monitor's arithmetic as kernels (see rudc/safety/plant.py): D dead times, L lags, F frictions."""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import NewCube, NewRowTable, NewTable, NewVector, Rows, Table, Vector, kernel

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
def lateral(tangent: float, v: float, cg_to_rear: float, ratio: float) -> float:
    """m/s2, v^2 sin(slip) / l_r with tan(slip) = ratio tan(delta), at a front-wheel angle whose tangent is
    `tangent`.
    """
    tan_slip = ratio * tangent
    return v**2 * (tan_slip / math.sqrt(1.0 + tan_slip * tan_slip)) / cg_to_rear


@kernel
def within_friction(a: float, across: float, limit: float) -> float:
    """m/s2, what the friction circle of radius `limit` leaves of an acceleration `a` beside a lateral one."""
    if a * a + across * across <= limit * limit:
        return a
    left = math.sqrt(max(limit * limit - across * across, 0.0))
    return min(max(a, -left), left)


@kernel
def weigh_part(
    cost: NewCube, given: Table, delays: Rows, keep: Vector, limit: Vector, between: Vector, prompt: int,
    now: complex, read: complex, std: complex, substeps: int, v: float, v_after: float, cg_to_rear: float,
    ratio: float, counts: float, forget: float, cut: float,
) -> float:  # fmt: skip
    """`weigh_bank` for a part of the bank, whose J are `cost` (D, L, F); returns the least of them. The
    innermost loops are short and plain, so that compiled code can process several models at a time.
    """
    lags, frictions = cost.shape[1:]
    start, wanted = np.empty((2, frictions)), np.empty((substeps, 2, len(delays), frictions))
    widest, widest_tangent = widest_angles(limit, v, cg_to_rear, ratio)
    for f in range(frictions):
        turned = min(max(now.imag, -widest[f]), widest[f])
        start[1, f] = turned
        start[0, f] = within_friction(now.real, lateral(math.tan(turned), v, cg_to_rear, ratio), limit[f])
    for i in range(substeps):
        here = v + (v_after - v) * i / substeps
        widest, widest_tangent = widest_angles(limit, here, cg_to_rear, ratio)
        before = 0
        for d in range(len(delays)):
            acts = delays[d] + substeps - 1 - i
            a_d, delta_d = given[acts, 0], given[acts, 1]
            if d > 0 and a_d == given[before, 0] and delta_d == given[before, 1]:
                wanted[i, :, d] = wanted[i, :, d - 1]
            else:
                tangent = math.tan(delta_d)
                across = lateral(tangent, here, cg_to_rear, ratio)
                for f in range(frictions):
                    if abs(tangent) <= widest_tangent[f]:
                        wanted[i, 1, d, f], pull = delta_d, across
                    else:
                        wanted[i, 1, d, f] = math.copysign(widest[f], delta_d)
                        pull = lateral(widest_tangent[f], here, cg_to_rear, ratio)
                    wanted[i, 0, d, f] = within_friction(a_d, pull, limit[f])
            before = acts
    start[0], start[1] = (start[0] - read.real) / std.real, (start[1] - read.imag) / std.imag
    wanted[:, 0], wanted[:, 1] = (wanted[:, 0] - read.real) / std.real, (wanted[:, 1] - read.imag) / std.imag
    off, least = np.empty((2, frictions)), np.full(frictions, math.inf)
    for d in range(len(delays)):
        unsure = (between > 0.0) & (abs(given[delays[d], 1]) > widest * (1.0 - between))
        limited = unsure.any()
        for k in range(lags):
            left, of_lag = keep[k], cost[d, k]
            for kind in range(2):
                now_off = off[kind]
                for f in range(frictions):
                    now_off[f] = start[kind, f]
                for i in range(substeps):
                    row = wanted[i, kind, d]
                    for f in range(frictions):
                        now_off[f] = row[f] + (now_off[f] - row[f]) * left
            if limited and k < prompt:
                for f in range(frictions):
                    if unsure[f]:
                        off[0, f] = max(abs(off[0, f]) - abs(read.real / std.real + off[0, f]), 0.0)
                        off[1, f] /= 1.0 + between[f] * abs(read.imag / std.imag + off[1, f])
            for f in range(frictions):
                more = counts * min(off[0, f] ** 2, cut) + min(off[1, f] ** 2, cut)
                of_lag[f] = forget * of_lag[f] + more
            for f in range(frictions):
                least[f] = min(least[f], of_lag[f])
    return least.min()


@kernel
def weigh_bank(
    cost: NewVector, given: NewTable, sizes: NewRowTable, delays: Rows, keep: Vector, limit: Vector,
    between: Vector, prompt: int, command: complex, now: complex, read: complex, std: complex, substeps: int,
    v: float, v_after: float, cg_to_rear: float, ratio: float, counts: float, forget: float, cut: float,
    worst: float,
) -> int:  # fmt: skip
    """Update `cost`, the J of all models, with a reading after some sub-steps of a command; their least is 0
    then, their largest `worst` at most. Returns 0. The command is put first in `given`, the commands of each
    sub-step, (delays[-1] + substeps or more, 2) m/s2 and rad, newest first.

    `now`: acceleration and front-wheel angle that were read before, a + i delta; `read`: those that were
    read after these sub-steps; meanwhile the speed went from v to v_after m/s. `std`: the sizes of the errors
    of what is read; `counts`: 1 if the acceleration counts, else 0. Where the road may limit the angle, since
    its friction may lie between two of the bank's, the angle delta of a model with one of the first `prompt`
    lags counts as far off, in errors of size std, as it is in errors of size std + `between` |delta|, and its
    acceleration a as |a| less than it is, since an angle at the limit may leave the brakes anything up to a.

    `sizes`: (P, 3) numbers D, L and F of dead times, lags and frictions of each part of the bank, whose
    models are all combinations of them; what follows is one after the other for all parts. `delays`: (D,)
    sub-steps, increasing; `keep`: (L,) share of the difference from the command that is left after a
    sub-step; `limit`, `between`: (F,) m/s2, what friction gives, and shares.
    """
    for i in range(len(given) - 1, substeps - 1, -1):
        given[i] = given[i - substeps]
    given[:substeps, 0], given[:substeps, 1] = command.real, command.imag
    least, first, d, k, f = math.inf, 0, 0, 0, 0
    for p in range(len(sizes)):
        dead, lags, frictions = sizes[p]
        last = first + dead * lags * frictions
        of_part = weigh_part(
            cost[first:last].reshape((dead, lags, frictions)), given, delays[d : d + dead],
            keep[k : k + lags], limit[f : f + frictions], between[f : f + frictions], prompt, now,
            read, std, substeps, v, v_after, cg_to_rear, ratio, counts, forget, cut,
        )  # fmt: skip
        least, first, d, k, f = min(least, of_part), last, d + dead, k + lags, f + frictions
    for m in range(len(cost)):
        cost[m] = min(cost[m] - least, worst)
    return 0
