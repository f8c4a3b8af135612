"""Does the filter keep h >= 0 on its own model? `python -m tests.benchmarks.invariance [STARTS]` prints it.

The ego drives the filter's own model, exactly integrated, among others that keep their velocity, on a
straight road. The nominal action is adversarial: full throttle, steering at the nearest vehicle. Each
run begins in the safe set, near its boundary, and lasts until the first QP without solution (barriers
promise nothing about what comes after).

TTCBF promises h >= 0 at the samples if Gamma dt^3 exceeds the remainder, what a row's prediction of the
next h leaves out. It is measured row by row, and the largest compared with Gamma. ECBF promises h >= 0
in continuous time only; with actions held, h may dip below, less with shorter steps.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace

import numpy as np

from rudc.arrays import Array, Complex
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.road_edges import RoadSettings
from rudc.safety.rules import Ecbf, Ttcbf
from rudc.safety.vehicles import VehicleSettings
from rudc.world.scene import Scene
from tests.safety.scenes import Other, make_scene

INSIDE = 8
"""instants looked at within a step"""
STEER = 0.25
"""largest tan of the adversary's steering angle (a radius of 11 m)"""
DURATION = 4.0
"""s"""
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass
class Figures:
    """What came out of a number of runs."""

    steps: int = 0
    """decisions whose QP, and all before it, had a solution"""
    corrected: int = 0
    """of which the action was changed"""
    ended: int = 0
    """runs that met a QP without solution"""
    samples_below: int = 0
    """steps after which some h was negative"""
    inside_below: int = 0
    """steps within which some h was negative"""
    deepest_sample: float = math.inf
    """m2, least h at a sample"""
    deepest_inside: float = math.inf
    """m2, least h anywhere"""
    remainder: float = 0.0
    """m2/s3, most by which a row overestimated the next h, over dt^3"""
    broken: int = 0
    """steps in which TTCBF broke its promise: h fell below 0 though Gamma bounded the remainder"""


def driven(scene: Scene, u: Array, t: Array) -> tuple[Complex, Array, Array]:
    """Ego's positions m, headings rad and speeds m/s, (T,) each, `t` (T,) s later on the filter's model.

    u = (acceleration m/s2, steering angle rad).
    """
    ego = scene.ego
    curvature = math.tan(u[1]) / scene.vehicle.wheelbase
    s = 0.5 * t[:, None] * (GAUSS + 1.0)
    heading = np.exp(1j * (ego.psi + curvature * (ego.v * s + 0.5 * u[0] * s * s)))
    way = ((ego.v + u[0] * s) * heading) @ WEIGHTS * (0.5 * t)
    turned = curvature * (ego.v * t + 0.5 * u[0] * t * t)
    return complex(ego.x, ego.y) + way, ego.psi + turned, np.maximum(ego.v + u[0] * t, 0.0)


def barriers(config: FilterConfig, scene: Scene, place: Complex, psi: Array, t: Array) -> Array:
    """(T, N + 6) m2, h of the others and of both road edges, written down anew from the paper's formulas."""
    others = (scene.position + t[:, None, None] * scene.velocity) @ (1, 1j)
    phi = np.angle(place[:, None] - others)

    of_vehicles, of_road = config.barriers["vehicle"], config.barriers["road"]
    assert isinstance(of_vehicles, VehicleSettings)
    assert isinstance(of_road, RoadSettings)

    def radius(a: float | Array, b: float | Array, theta: Array) -> Array:
        return np.sqrt((a * np.cos(theta)) ** 2 + (b * np.sin(theta)) ** 2 + 1e-6)

    rho_e = radius(*of_vehicles.axes(scene.vehicle), phi - psi[:, None])
    rho_o = radius(
        0.5 * scene.size[:, 0], 0.5 * scene.size[:, 1] + of_vehicles.width_margin, phi - scene.heading
    )
    vehicles = np.abs(place[:, None] - others) ** 2 - (rho_e + rho_o + of_vehicles.d_safe) ** 2
    third = scene.vehicle.wheelbase / 3
    points = np.array([0.0, third, 2 * third]) - [0.0, scene.vehicle.cg_to_rear, scene.vehicle.cg_to_rear]
    y = place.imag[:, None] + points * np.sin(psi)[:, None]
    margin = 0.5 * scene.vehicle.width + of_road.d_safe
    edge = float(scene.route.left_edge[0, 1])
    return np.hstack([vehicles, (edge - y) ** 2 - margin**2, (edge + y) ** 2 - margin**2])


def moved(scene: Scene, u: Array, t: float) -> Scene:
    """The scene `t` s later on the filter's model."""
    (place,), (psi,), (v,) = driven(scene, u, np.array([t]))
    then = replace(scene.ego, x=place.real, y=place.imag, psi=float(psi), v=float(v))
    s, offset = scene.route.path.project(then.x, then.y, scene.ego_s)
    return replace(scene, ego=then, ego_s=s, ego_offset=offset, position=scene.position + t * scene.velocity)


def adversary(scene: Scene) -> Array:
    """Full throttle, at the nearest vehicle."""
    ego = scene.ego
    away = scene.position - (ego.x, ego.y)
    dx, dy = away[np.hypot(away[:, 0], away[:, 1]).argmin()]
    astray = math.remainder(math.atan2(dy, dx) - ego.psi, 2 * math.pi)
    return np.array([scene.vehicle.a_max, math.atan(min(max(2.0 * astray, -STEER), STEER))])


def start(rng: np.random.Generator, filter: SafetyFilter) -> Scene:
    """A scene in the safe set: all h positive, for ECBF h' + lambda h too, and the first QP solvable.

    One vehicle is near: its h is between 0.001 and 30 m2.
    """
    while True:
        others = [
            Other(
                d * math.cos(b),
                d * math.sin(b),
                rng.uniform(-math.pi, math.pi),
                rng.choice([0.0, 1.0]) * rng.uniform(0, 10),
                length=rng.uniform(0.5, 10),
                width=rng.uniform(0.5, 2.5),
            )
            for d, b in rng.uniform([5.0, -math.pi], [40.0, math.pi], (int(rng.integers(1, 6)), 2))
        ]
        scene = make_scene(others, y=rng.uniform(-4, 4), psi=rng.uniform(-0.2, 0.2), v=rng.uniform(0, 10))
        scene = _near(scene, filter.config, 10.0 ** rng.uniform(-3, 1.5))
        if _safe(scene, filter) and not filter.filter(scene, adversary(scene)).infeasible:
            return scene


def _near(scene: Scene, config: FilterConfig, wanted: float) -> Scene:
    """The scene with its nearest vehicle moved towards the ego until its h is `wanted` m2."""
    ego = np.array([scene.ego.x, scene.ego.y])
    place, psi = np.array([complex(*ego)]), np.array([scene.ego.psi])
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        position = scene.position.copy()
        position[0] = ego + middle * (position[0] - ego)
        moved_in = replace(scene, position=position)
        if barriers(config, moved_in, place, psi, np.zeros(1))[0, 0] > wanted:
            high = middle
        else:
            low = middle
    return moved_in


def _safe(scene: Scene, filter: SafetyFilter) -> bool:
    filter.reset()
    terms = filter.constraints(scene).terms(scene)
    z = math.tan(adversary(scene)[1])
    rule, falling = filter.config.rule_settings, terms.lf + terms.lg * z
    if isinstance(rule, Ecbf) and (falling + rule.rate2 * terms.h).min() <= 0:
        return False
    return bool(terms.h.min() > 0)


def run(config: FilterConfig, starts: int, seed: int) -> Figures:
    """Figures of `starts` runs."""
    figures, rng, filter = Figures(), np.random.default_rng(seed), SafetyFilter(config)
    for _ in range(starts):
        scene = start(rng, filter)
        for _ in range(round(DURATION / config.dt)):
            filter.reset()
            answer = filter.filter(scene, adversary(scene))
            if answer.infeasible:
                figures.ended += 1
                break
            figures.steps += 1
            figures.corrected += answer.status == "solved"
            u = np.array([max(answer.u[0], -scene.ego.v / config.dt), answer.u[1]])  # no driving backwards
            if not _look(figures, filter, scene, u, answer.h):
                break
            scene = moved(scene, u, config.dt)
    return figures


def _look(figures: Figures, filter: SafetyFilter, scene: Scene, u: Array, now: Array) -> bool:
    """Follow h, now (K,), through one step; whether it ends in the safe set."""
    config, problem = filter.config, filter.last_problem
    assert problem is not None
    t = config.dt * np.arange(1, INSIDE + 1) / INSIDE
    place, psi, _ = driven(scene, u, t)
    h = barriers(config, scene, place, psi, t)
    figures.deepest_inside = min(figures.deepest_inside, float(h.min()))
    figures.deepest_sample = min(figures.deepest_sample, float(h[-1].min()))
    figures.samples_below += bool(h[-1].min() < 0)
    figures.inside_below += bool(h.min() < 0)
    rule = config.rule_settings
    if isinstance(rule, Ttcbf):
        excess = problem.A @ (u[0], math.tan(u[1])) - problem.b
        road = np.arange(len(now)) >= scene.count
        rate = np.where(road, rule.road_rate, rule.rate)
        predicted = (1.0 - rate) * now + excess + rule.gamma * config.dt**3
        remainder = (predicted - h[-1]) / config.dt**3
        figures.remainder = max(figures.remainder, float(remainder.max()))
        figures.broken += bool(((h[-1] < 0) & (remainder < rule.gamma)).any())
    return bool(h[-1].min() >= 0)


def report(title: str, figures: Figures) -> str:
    """One line of figures."""
    return (
        f"{title:<24} {figures.steps:7d} {figures.corrected:7d} {figures.ended:6d} "
        f"{figures.samples_below:8d} {figures.inside_below:8d} {figures.deepest_sample:10.4f} "
        f"{figures.deepest_inside:10.4f} {figures.remainder:10.1f} {figures.broken:7d}"
    )


def main(starts: int) -> None:
    """Print the study."""
    print(f"{starts} starts each, {DURATION:g} s, adversarial nominal action")
    print(
        f"{'':<24} {'steps':>7} {'solved':>7} {'ended':>6} {'h<0 smp':>8} {'h<0 any':>8} {'min h smp':>10} "
        f"{'min h any':>10} {'remainder':>10} {'broken':>7}"
    )
    for gamma in (100.0, 1000.0, 8000.0):
        config = FilterConfig.preset("ttcbf", constrained="all", last_resort=False, ttcbf_gamma=gamma)
        print(report(f"TTCBF Gamma {gamma:g}", run(config, starts, 0)))
    for dt in (0.4, 0.2, 0.1, 0.05):
        config = FilterConfig.preset("ecbf", constrained="all", last_resort=False, dt=dt)
        print(report(f"ECBF dt {dt:g}", run(config, starts, 0)))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
