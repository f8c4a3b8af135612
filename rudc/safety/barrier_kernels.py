"""Terms, rows and road points of the barriers as kernels; the docstrings of clearance.py, rows.py and
road_points.py give the formulas.
"""

from __future__ import annotations

import math

import numpy as np

from rudc.kernels import (
    NewColumns,
    NewPlaces,
    NewTable,
    NewVector,
    Places,
    PlaceTable,
    Rows,
    Table,
    Vector,
    WrittenTable,
    kernel,
)

CLOSEST = 1e-6
"""m2; a smaller |r|^2 is taken as this, since the bearing of r means nothing there"""


@kernel
def _radius(r: complex, squared: float, short: float, stretch: float) -> tuple[float, float, float]:
    """rho(theta), rho', rho'' of r = |r| e^(i theta): rho^2 = short + stretch cos^2 theta."""
    across, square = r.real * r.imag / squared, r.real**2 / squared
    rho = math.sqrt(short + stretch * square)
    rho1 = -stretch * across / rho
    return rho, rho1, (stretch * (1.0 - 2.0 * square) - rho1 * rho1) / rho


@kernel
def ellipses(
    size: Table, half_length: float, half_width: float, margin: float, epsilon: float
) -> tuple[NewTable, NewTable]:
    """B^2 + eps0 and A^2 - B^2, (2, N) m2 each: for the ego in the first row, for others of `size` (N, 2) m
    in the second; B of the others is half their width plus `margin` m.
    """
    short, stretch = np.empty((2, len(size))), np.empty((2, len(size)))
    for i in range(len(size)):
        half, across = 0.5 * size[i, 0], 0.5 * size[i, 1] + margin
        short[0, i] = half_width * half_width + epsilon
        stretch[0, i] = half_length * half_length - half_width * half_width
        short[1, i], stretch[1, i] = across * across + epsilon, half * half - across * across
    return short, stretch


@kernel
def some_bodies(
    position: Table, velocity: Table, heading: Vector, short: Table, stretch: Table, who: Rows,
    buffer: float, places: NewPlaces, velocities: NewPlaces, directions: NewPlaces, mode: NewVector,
    margin: NewVector, its_short: WrittenTable, its_stretch: WrittenTable,
) -> int:  # fmt: skip
    """Write the others `who` (n,) into the arrays of `Bodies`, with a margin of `buffer` m. Returns 0."""
    for k in range(len(who)):
        i = who[k]
        places[k] = complex(position[i, 0], position[i, 1])
        velocities[k] = complex(velocity[i, 0], velocity[i, 1])
        directions[k] = complex(math.cos(heading[i]), math.sin(heading[i]))
        mode[k], margin[k] = 1.0, buffer
        for row in range(2):
            its_short[row, k], its_stretch[row, k] = short[row, i], stretch[row, i]
    return 0


@kernel
def clearance(
    position: complex, heading: complex, v: float, wheelbase: float, places: Places, velocities: Places,
    directions: Places, offset: Vector, mode: Vector, margin: Vector, short: Table, stretch: Table,
) -> NewTable:  # fmt: skip
    """(9, K): h, L_f h, L_g h, L_f^2 h, L_g L_f h for a and for z, L_f L_g h, X, Y (see clearance.py)."""
    terms, k = np.empty((9, len(places))), v / wheelbase
    for i in range(len(places)):
        c, m = offset[i], mode[i]
        r, w = (position + c * heading) - places[i], v * heading - velocities[i]
        along, own = r * heading.conjugate(), r * directions[i].conjugate()
        p, q = along.real, along.imag
        squared = max(p * p + q * q, CLOSEST)
        closing = (r.conjugate() * w).real
        f = (r.conjugate() * w).imag / squared
        rho, e1, e2 = _radius(along, squared, short[0, i], stretch[0, i])
        its_rho, o1, o2 = _radius(own, squared, short[1, i], stretch[1, i])
        d = m * (rho + its_rho) + margin[i]
        slope = e1 + o1
        swing, lever = slope * f, c * q + d * e1
        s = (w * heading.conjugate()).imag
        lflg = 2.0 * k * (c * s + (slope * e1 + d * e2) * f)
        terms[0, i] = p * p + q * q - d * d
        terms[1, i] = 2.0 * (closing - d * swing)
        terms[2, i] = 2.0 * k * lever
        bend = f * ((e2 + o2) * f - 2.0 * slope * closing / squared)
        terms[3, i] = 2.0 * (w.real**2 + w.imag**2 - swing * swing - d * bend)
        terms[4, i] = 2.0 * (p + d * slope / squared * q)
        terms[5, i] = 2.0 * k * v * (q - d * slope / squared * p) + lflg
        terms[6, i] = lflg
        terms[7, i] = 2.0 / wheelbase * lever
        terms[8, i] = 2.0 * k * k * (c * c - c * p - e1 * e1 - d * e2)
    return terms


@kernel
def rows(
    h: Vector, lf: Vector, lg: Vector, lf2: Vector, lglf_a: Vector, lglf_z: Vector, lflg: Vector, az: Vector,
    zz: Vector, lg_a: Vector, zeroth: Vector, first: Vector, second: float, required: float, a0: float,
    z0: float, relief: Vector,
) -> tuple[NewColumns, NewVector]:  # fmt: skip
    """A (K, 2) and b (K,) of A u >= b, linearised about (a0, z0): see rudc/safety/rows.py."""
    rows, b = np.empty((2, len(h))), np.empty(len(h))
    for i in range(len(h)):
        rows[0, i] = first[i] * lg_a[i] + second * (lglf_a[i] + z0 * az[i])
        rows[1, i] = first[i] * lg[i] + second * (lglf_z[i] + lflg[i] + a0 * az[i] + 2.0 * z0 * zz[i])
        drift = zeroth[i] * h[i] + first[i] * lf[i]
        drift += second * (lf2[i] - z0 * (a0 * az[i] + z0 * zz[i]))
        b[i] = required - drift - relief[i]
    return rows.T, b


# ---- the road's edges


@kernel
def to_edges(
    edges: PlaceTable,
    spacing: float,
    reach: float,
    position: complex,
    heading: complex,
    ahead: Vector,
    s: float,
) -> NewPlaces:
    """(E n,) m, vectors from the nearest point on each of E edges (E, M) m to each of n reference points.
    These lie `ahead` (n,) m of `position` m in the direction `heading`. Only the stretch of edge within
    `reach` m of path before and after s m is searched.
    """
    pieces = edges.shape[1] - 1
    window = min(int(np.rint(2 * reach / spacing)), pieces)
    begin = min(max(int((s - reach) / spacing), 0), pieces - window)
    away = np.empty(len(edges) * len(ahead), np.complex128)
    for e in range(len(edges)):
        for n in range(len(ahead)):
            point, least = position + ahead[n] * heading, 1e300
            for i in range(begin, begin + window):
                step, r = edges[e, i + 1] - edges[e, i], point - edges[e, i]
                # on the inside of a bend stations may coincide; such a piece is a point
                length = max(step.real**2 + step.imag**2, 1e-12)
                r -= min(max((r * step.conjugate()).real / length, 0.0), 1.0) * step
                if r.real**2 + r.imag**2 < least:
                    least, away[e * len(ahead) + n] = r.real**2 + r.imag**2, r
    return away


@kernel
def on_edges(
    away: Places, offset: Vector, position: complex, heading: complex, motion: complex, buffer: float,
    places: NewPlaces, velocities: NewPlaces, directions: NewPlaces, offsets: NewVector, margin: NewVector,
) -> int:  # fmt: skip
    """Write the projections of n reference points into the arrays of `Bodies`, with a margin of `buffer` m.
    The points lie `offset` (n,) m ahead of `position` m in the direction `heading`; `away` (n,) m are the
    vectors from the projections to the points, `motion` m/s the velocity of the points. Returns 0.
    """
    for i in range(len(away)):
        r = away[i]
        rate = r.real * motion.real + r.imag * motion.imag
        share = rate / max(r.real * r.real + r.imag * r.imag, CLOSEST)
        places[i], velocities[i] = position + offset[i] * heading - r, motion - share * r
        directions[i], offsets[i], margin[i] = 1.0, offset[i], buffer
    return 0
