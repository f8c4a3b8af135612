"""Our filter's call beside cbfpy's compiled one, on the same barriers, in turn.

    python -m tests.benchmarks.cbfpy_filter [--decisions 2000]

ECBF with twelve ellipses at constant velocity, no road, no last resort, corrections as large as limits
allow, in two kinds of scenes: those of `rudc-t`'s left turns through dense traffic, with what its policy
proposed, and such with vehicles at random places and actions at random, of which nearly all have to be
corrected. Both take numpy arrays and answer with one. cbfpy takes derivatives of h by jax and solves a
relaxed QP each time; ours also finds out who is where, passes on what satisfies all rows, linearises again
about its solution, and certifies it. cbfpy's rows leave out what steering does to h' itself (a relative
degree of 2), so their columns of the acceleration and their right sides, about u = 0, are the same: this is
checked first.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # these, as cbfpy advises
os.environ["JAX_ENABLE_X64"] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import cbfpy
import jax.numpy as jnp
import numpy as np

from rudc.agents.base import Decision
from rudc.agents.registry import make_agent
from rudc.arrays import Array, Complex
from rudc.env.episode import Episode
from rudc.evaluation.rollout import run_episode
from rudc.network.network import load_network
from rudc.safety.filter import FilterConfig, SafetyFilter
from rudc.safety.rows import affine_rows
from rudc.scenario import load_scenario
from rudc.vehicle import EgoVehicle
from rudc.world.scene import Scene
from rudc.world.world import World
from tests.benchmarks.filter_speed import random_scene

OTHERS, FAR = 12, 1e4
"""of which those that are not there are FAR m away"""
CONFIG = FilterConfig.preset(
    "ecbf",
    constrained="all",
    road=False,
    last_resort=False,
    max_steering_correction=np.inf,
    max_added_acceleration=np.inf,
)
WEIGHTS = CONFIG.row_weights(road=False)
SUM, PRODUCT = WEIGHTS.first / WEIGHTS.second, WEIGHTS.h / WEIGHTS.second
"""of the two rates lambda1 and lambda2"""


class Bicycle(cbfpy.CBFConfig):
    """rudc/safety/clearance.py once more: the state is x, y, psi, v of the ego, and x, y of each other; then
    come the others' velocities and headings, the parts of the support radii, and margins.
    """

    def __init__(self, body: EgoVehicle) -> None:
        self.wheelbase = body.wheelbase
        z_max = float(np.tan(body.delta_max))
        shapes = (OTHERS, 2), (OTHERS,), (2, OTHERS), (2, OTHERS), (OTHERS,)
        seed = tuple(np.ones(shape) for shape in shapes)
        low, high = np.array([body.a_min, -z_max]), np.array([body.a_max, z_max])
        super().__init__(n=4 + 2 * OTHERS, m=2, u_min=low, u_max=high, init_args=seed)

    def f(self, z: Any, velocity: Any, *_: Any) -> Any:
        """What moves on its own."""
        ego = jnp.array([z[3] * jnp.cos(z[2]), z[3] * jnp.sin(z[2]), 0.0, 0.0])
        return jnp.concatenate([ego, velocity.reshape(-1)])

    def g(self, z: Any, *_: Any) -> Any:
        """What acceleration and tan of the steering angle move."""
        return jnp.zeros((self.n, 2)).at[3, 0].set(1.0).at[2, 1].set(z[3] / self.wheelbase)

    def h_2(self, z: Any, velocity: Any, heading: Any, short: Any, stretch: Any, margin: Any) -> Any:
        """(OTHERS,) m2."""
        r = z[:2] - z[4:].reshape(-1, 2)
        bearing = jnp.arctan2(r[:, 1], r[:, 0])
        ours = jnp.sqrt(stretch[0] * jnp.cos(bearing - z[2]) ** 2 + short[0])
        theirs = jnp.sqrt(stretch[1] * jnp.cos(bearing - heading) ** 2 + short[1])
        return (r**2).sum(axis=1) - (ours + theirs + margin) ** 2

    def alpha(self, h: Any, *_: Any) -> Any:
        """By the larger of the two rates."""
        return (SUM + np.sqrt(SUM**2 - 4 * PRODUCT)) / 2 * h

    def alpha_2(self, h_2: Any, *_: Any) -> Any:
        """By the smaller."""
        return (SUM - np.sqrt(SUM**2 - 4 * PRODUCT)) / 2 * h_2

    def P(self, z: Any, u_des: Any, *_: Any) -> Any:
        """The filter's prices."""
        return jnp.diag(jnp.array([CONFIG.acceleration_weight, CONFIG.steering_weight]))

    def q(self, z: Any, u_des: Any, *_: Any) -> Any:
        """The nominal action costs least."""
        return -self.P(z, u_des) @ u_des


def for_cbfpy(scene: Scene, filter: SafetyFilter) -> tuple[Array, ...]:
    """The arguments of `Bicycle`'s functions in a scene."""
    ego, bodies = scene.ego, filter.constraints(scene).bodies
    count = len(bodies.margin)
    place, velocity, heading = np.full((OTHERS, 2), FAR), np.zeros((OTHERS, 2)), np.zeros(OTHERS)
    short, stretch, margin = np.ones((2, OTHERS)), np.zeros((2, OTHERS)), np.zeros(OTHERS)
    place[:count], velocity[:count] = in_plane(bodies.position), in_plane(bodies.velocity)
    heading[:count], margin[:count] = np.angle(bodies.direction), bodies.margin
    short[:, :count], stretch[:, :count] = bodies.short, bodies.stretch
    state = np.concatenate([[ego.x, ego.y, ego.psi, ego.v], place.reshape(-1)])
    return state, velocity, heading, short, stretch, margin


def in_plane(z: Complex) -> Array:
    """(n, 2) of (n,)."""
    return np.column_stack([z.real, z.imag])


def compare_rows(theirs: Any, filter: SafetyFilter, scenes: list[Scene]) -> float:
    """Largest difference between the rows' acceleration and right side, relative to the largest number."""
    worst = 0.0
    for scene in scenes:
        A, b = affine_rows(filter.constraints(scene).terms(scene), WEIGHTS, 0.0, 0.0)
        state, *others = for_cbfpy(scene, filter)
        G = np.asarray(theirs.G_qp(state, np.zeros(2), *others))[: len(b)]
        h = np.asarray(theirs.h_qp(state, np.zeros(2), *others))[: len(b)]
        for ours, other in ((A[:, 0], -G[:, 0]), (b, -h)):
            worst = max(worst, float(np.abs(ours / WEIGHTS.second - other).max() / np.abs(other).max()))
    return worst


def driven(count: int) -> tuple[list[Scene], Array]:
    """Scenes of `rudc-t`'s episodes, and what its policy proposed in each, (count, 2)."""
    scenes, proposed = list[Scene](), list[Array]()

    def keep(scene: Scene, decision: Decision, _: object) -> None:
        if scene.count and decision.corrected is not None:
            scenes.append(scene)
            proposed.append(decision.corrected.u - decision.corrected.correction)

    agent, scenario = make_agent("rudc-t"), load_scenario("dense_left_turn")
    world = World(load_network(scenario.network, scenario.junction))
    seed = 0
    while len(scenes) < count:
        run_episode(Episode(world), scenario.plan(seed), agent, watch=keep)
        seed += 1
    world.close()
    return scenes[:count], np.array(proposed[:count])


def at_random(count: int) -> tuple[list[Scene], Array]:
    """Scenes with vehicles at random places, and random actions (count, 2)."""
    rng = np.random.default_rng(0)
    scenes = [random_scene(rng, OTHERS) for _ in range(count)]
    return scenes, np.column_stack([rng.uniform(-3, 3, count), rng.uniform(-0.1, 0.1, count)])


def measure(scenes: list[Scene], nominal: Array) -> None:
    """Compare the rows, then both calls in turn, and print."""
    filter, theirs = SafetyFilter(CONFIG), cbfpy.CBF.from_config(Bicycle(scenes[0].vehicle))
    print(f"rows: largest relative difference {compare_rows(theirs, filter, scenes[:200]):.1e}")
    inputs = [for_cbfpy(scene, filter) for scene in scenes]
    spent, statuses = np.empty((len(scenes), 2)), list[str]()
    for number in (200, len(scenes)):  # the first few compile and warm up
        statuses.clear()
        for i in range(number):
            state, *others = inputs[i]
            began = time.perf_counter()
            np.asarray(theirs.safety_filter(state, nominal[i], *others))
            between = time.perf_counter()
            statuses.append(filter.filter(scenes[i], nominal[i]).status)
            spent[i] = between - began, time.perf_counter() - between
    for status in ("all", *sorted(set(statuses))):
        of = np.array([status in ("all", found) for found in statuses])
        (a, b), (late_a, late_b) = 1e3 * np.percentile(spent[of], [50, 99], axis=0)
        print(
            f"    {status:8s} {of.sum():5d} decisions: cbfpy {a:.3f} ms (p99 {late_a:.3f}), "
            f"ours {b:.3f} ms (p99 {late_b:.3f}), {a / b:.2f} times as fast"
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--decisions", type=int, default=2000)
    count = parser.parse_args().decisions
    for what, (scenes, nominal) in (("driven", driven(count)), ("at random", at_random(count))):
        print(f"{what}: ", end="")
        measure(scenes, nominal)


if __name__ == "__main__":
    main()
