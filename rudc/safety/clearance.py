"""Barriers that keep a distance: h of all of them at once, and its derivatives along the filter's own model.

Model (paper, Sec. "Safety Correction Formulation"): a kinematic bicycle without slip, and bodies to keep
clear of (vehicles, road-edge points) that move at constant velocity v_o without turning. With
e = (cos psi, sin psi), n = (-sin psi, cos psi) and z = tan(delta_f),

    dp/dt = v e,    dpsi/dt = k z,    dv/dt = a,    do/dt = v_o,        k = v / L,    u = (a, z)

Barrier. r = p + c e - o points from the body to the ego. c is 0 towards vehicles; towards road-edge points it
is the position of the reference point on the ego's axis. phi is the bearing of r, theta_e = phi - psi,
theta_o = phi - psi_o, and

    rho(theta) = sqrt(A^2 cos^2 theta + B^2 sin^2 theta + eps0)      ellipse with half axes A, B
    d = m (rho_e + rho_o) + (1 - m) dbar + d_safe                    m = 1 for vehicles, 0 for the road
    h = |r|^2 - d^2

Derivatives. Let w = v e - v_o, p = r.e, q = r.n, s = w.n, and f = (r x w) / |r|^2, the rate of the
bearing while u = 0. rho' and rho'' are derivatives by theta, R = rho_e' + rho_o', S = rho_e'' + rho_o''.
Because the radii depend on psi, and the points at c turn with the ego, steering enters the first derivative
already: the paper's "relative degree 2" holds for acceleration only. With the input held over a step, these
are exact:

    h'  = L_f h + L_g h z
    h'' = L_f^2 h + (L_g L_f h + L_f L_g h) u + X a z + Y z^2

    L_f h     = 2 r.w - 2 d R f
    L_g h     = 2 k (c q + d rho_e')                                          (steering; 0 for a)
    L_f^2 h   = 2 |w|^2 - 2 (R f)^2 - 2 d (S f^2 - 2 R f (r.w) / |r|^2)
    L_g L_f h = 2 p + 2 d R q / |r|^2                                         (a)
                2 k (v q - d R v p / |r|^2) + L_f L_g h                       (z)
    L_f L_g h = 2 k (c s + (R rho_e' + d rho_e'') f)                          (z; 0 for a)
    X         = 2 (c q + d rho_e') / L
    Y         = 2 k^2 (c^2 - c p - rho_e'^2 - d rho_e'')

RUDC uses these exact terms; the radii are not frozen over a step. Freezing them (d' = 0) would err by
2 d (R f - rho_e' k z) dt in every step. The paper's affine rows keep L_f^2 h and L_g L_f h and lack the
rest. X and Y are the only terms that are not affine in u; rows.py linearises them about an action.

In the code, points and vectors of the plane are complex numbers: r conj(e) = p + i q,
conj(r) w = r.w + i (r x w).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import NamedTuple, Self

import numpy as np

from rudc.arrays import Array, Complex
from rudc.safety.barrier import Barrier, Found, Terms
from rudc.safety.barrier_kernels import clearance
from rudc.world.scene import Scene

EPSILON = 1e-6
"""m2, eps0 under the root of the support radii"""


class Bodies(NamedTuple):
    """K things to keep clear of."""

    position: Complex
    """(K,) m, o"""
    velocity: Complex
    """(K,) m/s, v_o"""
    direction: Complex
    """(K,) e^(i psi_o)"""
    offset: Array
    """(K,) m, c: distance of the reference point on the ego's axis ahead of its centre of gravity"""
    mode: Array
    """(K,) the formulas' m, without unit: 1 where the ellipses count, 0 where only a distance does"""
    margin: Array
    """(K,) m, what d contains besides the radii: d_safe, and dbar for the road"""
    short: Array
    """(2, K) m2, B^2 + eps0 of the ego (first row) and of the body; 1 where ellipses do not count"""
    stretch: Array
    """(2, K) m2, A^2 - B^2 of both; 0 where ellipses do not count"""

    @classmethod
    def empty(cls, k: int) -> Self:
        """Arrays for K bodies, to be filled in; ellipses do not count until they are."""
        places, numbers = np.empty((3, k), dtype=np.complex128), np.zeros((7, k))
        short, stretch = numbers[3:5], numbers[5:7]
        short.fill(1.0)
        return cls(places[0], places[1], places[2], numbers[0], numbers[1], numbers[2], short, stretch)

    def part(self, rows: slice) -> Bodies:
        """Some of the bodies, as views; itself if `rows` are all of them."""
        if rows == slice(0, len(self.offset)):
            return self
        return Bodies(
            self.position[rows], self.velocity[rows], self.direction[rows], self.offset[rows],
            self.mode[rows], self.margin[rows], self.short[:, rows], self.stretch[:, rows],
        )  # fmt: skip


class Clearance(Barrier):
    """Base of barriers that keep a distance: a subclass says which bodies are where (`fill`); h and its
    derivatives follow from that.
    """

    @abstractmethod
    def fill(self, scene: Scene, found: Found, to: Bodies) -> None:
        """Write what was found into the arrays of `to`, which come from `Bodies.empty`."""

    def terms(self, scene: Scene, found: Found) -> Terms:
        """See `Barrier`; the filter itself computes the terms of all barriers of this family at once."""
        to = Bodies.empty(len(found.names))
        self.fill(scene, found, to)
        return clearance_terms(*ego_pose(scene), to)


def ego_pose(scene: Scene) -> tuple[complex, complex, float, float]:
    """Position (m) and heading e^(i psi) of the ego's centre of gravity, speed (m/s), wheelbase (m)."""
    ego = scene.ego
    heading = complex(math.cos(ego.psi), math.sin(ego.psi))
    return complex(ego.x, ego.y), heading, ego.v, scene.vehicle.wheelbase


def clearance_terms(position: complex, heading: complex, v: float, wheelbase: float, to: Bodies) -> Terms:
    """h and its derivatives, (K,) each, towards the K bodies `to`.

    `position` m and `heading` e^(i psi) of the ego's centre of gravity, `v` m/s, `wheelbase` m.
    """
    return Terms(*clearance(position, heading, v, wheelbase, *to))
