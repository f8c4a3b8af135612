"""Samples for the residual predictor: the change of h over one step as the filter predicts it, and as it was.

Episodes are driven by random actions (paper, Appx. "Validation of CBF residual predictor") or by an agent. Of
each decision a few constraints are kept, drawn at random: xi (see rudc/safety/residual.py), the true change
of h, and the residual w, which is the true change less the predicted one, at the action that was executed.
Buffers are drawn anew for each decision, so that a predictor learns to work with any.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from rudc.agents.base import Agent, Decision
from rudc.arrays import Array, Floats
from rudc.env.action import ActionKind
from rudc.env.episode import Episode
from rudc.env.tracking import steering
from rudc.errors import InputError, SimulationError
from rudc.files import write_atomically
from rudc.network.network import load_network
from rudc.safety.barrier import STEP
from rudc.safety.barriers import BARRIERS
from rudc.safety.config import FilterConfig
from rudc.safety.constraints import ConstraintBuilder, Constraints
from rudc.safety.residual import features, predicted_change
from rudc.scenario.plan import EpisodePlan
from rudc.training.collect import DRAWS
from rudc.training.config import Curriculum
from rudc.training.curriculum import make_mixture
from rudc.world.scene import Scene
from rudc.world.world import World

BUFFERS = {"vehicle": (0.0, 0.8), "road": (0.0, 0.5)}
"""barriers that samples are taken of -> m, between which d_safe is drawn"""
KEPT = 2
"""constraints of each head that are kept of a decision"""
NEAR = 40.0
"""m, vehicles farther away are left out: their rows are never active"""
LONGEST_HOLD = 10
"""decisions for which a random action is held at most"""
LONGEST_WAIT = 40
"""the same for standing still: long enough for others that give way to stop beside it"""
STARTING = 0.3
"""share of random actions that do not brake: uniform ones would soon stand still"""
STEERED = 0.8
"""share of episodes in which kinds that do not follow the path are kept near it"""
ASTRAY = (0.02, 0.2)
"""rad, limits between which the largest difference from steering along the path is drawn then"""
WAITING = 0.25
"""share of the draws at a standstill that stay there"""


class Samples(NamedTuple):
    """M samples of one head."""

    xi: Floats
    """(M, F) features"""
    change: Floats
    """(M,) m2, h(x_next) - h(x)"""
    w: Floats
    """(M,) m2, what of it was not predicted"""
    episode: NDArray[np.int32]
    """(M,) which episode each is from"""


Dataset = dict[str, Samples]
"""head -> its samples"""


SLOW = 1.0
"""m/s, below which a wait or a start is drawn: twice STANDING, since random actions seldom come to rest"""


class RandomActions:
    """Random actions of a kind, each held for a while. With a kind that does not follow the path by itself,
    uniform steering leaves the road within two seconds. So in most episodes its steering differs from
    steering along the path by no more than a bound, which is drawn for the episode.
    """

    def __init__(self, rng: np.random.Generator, kind: ActionKind) -> None:
        self._rng, self._kind = rng, kind
        self._action, self._left = np.zeros(2), 0
        self._astray: float | None = None

    def reset(self, scene: Scene, seed: int) -> None:
        """Draw how an episode is steered."""
        self._astray = None
        if not self._kind.follows_path and self._rng.random() < STEERED:
            self._astray = float(self._rng.uniform(*ASTRAY))

    def act(self, scene: Scene) -> Decision:
        """What was drawn last, or a new draw."""
        if self._left == 0:
            slow = scene.ego.v < SLOW
            waits = slow and self._rng.random() < WAITING
            self._action = self._rng.uniform(-1.0, 1.0, 2)
            self._left = int(self._rng.integers(1, (LONGEST_WAIT if waits else LONGEST_HOLD) + 1))
            if waits:
                self._action[0] = -1.0
            elif slow or self._rng.random() < STARTING:
                self._action[0] = abs(self._action[0])
        self._left -= 1
        u = self._kind.u_of(self._action, scene)
        if self._astray is not None:
            most = scene.vehicle.delta_max
            u[1] = min(max(steering(scene) + self._astray * self._action[1], -most), most)
        return Decision(u, u)


def collect(
    samples: int, seed: int, driver: Agent | ActionKind, advance: Callable[[int, int], None]
) -> Dataset:
    """`samples` samples of each head from random destinations. `driver`: an agent, or the kind of random
    actions; `advance` is told how many samples there are, and how many episodes were left out because they
    could not be set up or driven to their end. Raises SimulationError after `DRAWS` of those in a row.
    """
    rng = np.random.default_rng((seed, 77))
    mixture = make_mixture("random_destination", Curriculum())
    first = mixture.scenarios[0]
    network = load_network(first.network, first.junction)
    world = World(network)
    keepers = {head: _Keeper(samples) for head in BUFFERS}
    number = left_out = failed = 0
    try:
        while not all(keeper.full for keeper in keepers.values()):
            plan = mixture.draw(rng)
            who = RandomActions(rng, driver) if isinstance(driver, ActionKind) else driver
            kept = {head: _Keeper(samples) for head in BUFFERS}
            try:
                _drive(Episode(world), plan, who, rng, kept, number)
            except SimulationError as error:
                left_out, failed = left_out + 1, failed + 1
                if failed == DRAWS:
                    raise SimulationError(f"{DRAWS} episodes in a row cannot be driven: {error}") from error
                world.close()
                world = World(network)
            else:
                failed = 0
                for head, keeper in keepers.items():
                    keeper.take(kept[head])
            number += 1
            advance(min(samples, *(keeper.count for keeper in keepers.values())), left_out)
    finally:
        world.close()
    return {head: keeper.samples() for head, keeper in keepers.items()}


def _drive(
    episode: Episode,
    plan: EpisodePlan,
    driver: Agent | RandomActions,
    rng: np.random.Generator,
    keepers: Mapping[str, _Keeper],
    number: int,
) -> None:
    """Drive an episode, and keep some of it."""
    scene = episode.reset(plan)
    driver.reset(scene, plan.seed)
    others = {name: False for name in BARRIERS if name not in BUFFERS}
    every = FilterConfig.preset(
        "ttcbf", constrained="all", d_safe=0.0, max_vehicles=None, road_d_safe=0.2, **others
    )
    before_builder, after_builder = ConstraintBuilder(every), ConstraintBuilder(every)
    while episode.outcome is None:
        decision = driver.act(scene)
        constraints = _buffered(before_builder.build(scene), rng)
        result = episode.step(decision.u)
        _keep(scene, result.scene, decision, constraints, after_builder, rng, keepers, number)
        scene = result.scene


def _buffered(constraints: Constraints, rng: np.random.Generator) -> Constraints:
    extra = np.where(
        constraints.mode > 0, rng.uniform(*BUFFERS["vehicle"]), rng.uniform(*BUFFERS["road"]) - 0.2
    )
    return _with_margin(constraints, constraints.bodies.margin + extra)


def _with_margin(constraints: Constraints, margin: Array) -> Constraints:
    return replace(constraints, bodies=constraints.bodies._replace(margin=margin))


def _keep(
    scene: Scene,
    after: Scene,
    decision: Decision,
    constraints: Constraints,
    builder: ConstraintBuilder,
    rng: np.random.Generator,
    keepers: Mapping[str, _Keeper],
    number: int,
) -> None:
    """Add what is worth keeping of one decision, which led from `scene` to `after`; `constraints`: those of
    `scene`.
    """
    body, u = scene.vehicle, decision.u
    later = builder.build(after)
    where = {name: i for i, name in enumerate(later.names)}
    met = [i for i, name in enumerate(constraints.names) if name in where]
    matched = [where[constraints.names[i]] for i in met]
    later = _with_margin(later, _at(later.bodies.margin, matched, constraints.bodies.margin[met]))
    terms = constraints.terms(scene)
    a = max(float(u[0]), -scene.ego.v / STEP)
    change = np.full(constraints.count, np.nan)
    change[met] = later.terms(after).h[matched] - terms.h[met]
    w = change - predicted_change(terms, min(max(a, body.a_min), body.a_max), float(np.tan(u[1])))
    near = np.abs(constraints.bodies.position - complex(scene.ego.x, scene.ego.y)) < NEAR
    seen = features(scene, constraints, decision.u_rl)
    for head, part in ((part.barrier.name, part.rows) for part in constraints.parts):
        xi = seen[head]
        able = np.flatnonzero(np.isfinite(w[part]) & near[part])
        chosen = rng.permutation(able)[:KEPT]
        keepers[head].add(xi[chosen], change[part][chosen], w[part][chosen], number)


def _at(values: Array, index: list[int], new: Array) -> Array:
    changed = values.copy()
    changed[index] = new
    return changed


class _Keeper:
    """Samples of one head as they come."""

    def __init__(self, wanted: int) -> None:
        self._wanted, self.count = wanted, 0
        self._parts: list[tuple[Array, Array, Array, NDArray[np.int32]]] = []

    @property
    def full(self) -> bool:
        return self.count >= self._wanted

    def add(self, xi: Array, change: Array, w: Array, episode: int) -> None:
        if not self.full and len(w):
            self._parts.append((xi, change, w, np.full(len(w), episode, np.int32)))
            self.count += len(w)

    def take(self, other: _Keeper) -> None:
        """Add all samples of another."""
        self._parts += other._parts
        self.count += other.count

    def samples(self) -> Samples:
        xi, change, w, episode = (
            np.concatenate(part)[: self._wanted] for part in zip(*self._parts, strict=True)
        )
        return Samples(xi.astype(np.float32), change.astype(np.float32), w.astype(np.float32), episode)


def save_dataset(path: Path, dataset: Dataset) -> None:
    """Write samples to a file. Raises StorageError."""
    arrays = {f"{head}/{k}": v for head, samples in dataset.items() for k, v in samples._asdict().items()}
    write_atomically(path, save({k: np.ascontiguousarray(v) for k, v in arrays.items()}))


def load_dataset(path: Path) -> Dataset:
    """Read samples. Raises InputError."""
    try:
        arrays = load_file(path)
        return {head: Samples(*(arrays[f"{head}/{k}"] for k in Samples._fields)) for head in BUFFERS}
    except FileNotFoundError:
        raise InputError(
            f"no samples in {path}: `rudc residual collect --out {path}` collects them"
        ) from None
    except (OSError, SafetensorError, KeyError) as error:
        raise InputError(f"{path} holds no samples of residuals: {error}") from None
