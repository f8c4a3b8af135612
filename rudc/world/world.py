"""`World`: one episode at a time of an ego vehicle among SUMO's traffic.

    with World(load_network("four_way")) as world:
        scene = world.reset(load_scenario("random_destination").plan(seed=0))
        advance = world.advance(np.array([0.5, 0.0]))     # m/s2, rad
        scene = world.scene()

A decision lasts `decision_s` and is simulated in sub-steps. In each: the ego's plant moves, SUMO moves the surrounding
vehicles (SVs), props move, and the ego's rectangle is tested against everything. Before the first sub-step, events
act and the yielding layer brakes SVs.
"""

from __future__ import annotations

import hashlib
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from rudc.errors import SimulationError
from rudc.world.config import WorldConfig
from rudc.world.ego import EgoPlant
from rudc.world.events import Script, Stage
from rudc.world.fault import Collision, judge
from rudc.world.geometry import overlapping_pairs, rectangle_corners, rectangle_gaps
from rudc.world.perception import Sensors
from rudc.world.scene import Array, EgoState, Kind, Scene
from rudc.world.spawn import draw_route, safe_to_start
from rudc.world.sumo import BRAKE_HARD, Motion, Sumo
from rudc.world.traffic import EGO, Traffic, type_file
from rudc.world.yielding import must_yield

if TYPE_CHECKING:
    from rudc.scenario.plan import EpisodePlan
    from rudc.world.network import Network, Route

REDRAWS = 30
"""how often an unsafe start is drawn again before giving up"""
MEET_M = 20.0
"""m between centres, beyond which nothing can touch the ego within a decision"""
OFF_ROAD_M = 0.3
"""m a corner of the ego may stick out of the drivable area"""


class Advance(NamedTuple):
    """What happened during one decision."""

    collision: Collision | None
    off_road: bool
    wrong_way: bool
    min_dtc_m: float
    """m, smallest gap between the ego's rectangle and any other at any sub-step; inf when alone"""
    sv_collisions: int
    """pairs of SVs that began to overlap"""
    density: float
    """veh/km on the road at the end"""


class World:
    """The simulation. Raises WorldBusyError when this process already has one open."""

    def __init__(self, network: Network, config: WorldConfig | None = None) -> None:
        self.network = network
        self.config = config or WorldConfig()
        self._sumo = Sumo(network.path, self.config.substep_s, self.config.sumo_options)
        self._folder = tempfile.TemporaryDirectory(prefix="rudc-")
        self.traffic = Traffic(self._sumo, network)
        self._plant = EgoPlant(self.config.vehicle)
        self._scene: Scene | None = None

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the simulation, so that another world may be made in this process."""
        self._sumo.close()
        self._folder.cleanup()

    def reset(
        self,
        plan: EpisodePlan,
        *,
        ego_driver: Literal["agent", "sumo"] = "agent",
        options: tuple[str, ...] = (),
    ) -> Scene:
        """Set up an episode and return its first scene.

        ego_driver "sumo" leaves the ego to SUMO's own driver, and `advance` then ignores its argument. `options` go to SUMO's
        command line for this episode (`--fcd-output FILE`). A plan in which the ego cannot start safely is drawn again;
        `self.plan.attempt` says how often. Raises SimulationError when no draw is safe.
        """
        self.plan = plan
        while not self._set_up(ego_driver, options):
            if self.plan.attempt >= REDRAWS:
                raise SimulationError(
                    f"scenario {plan.scenario}, seed {plan.seed}: no safe start for the ego in {REDRAWS} draws; "
                    "lower traffic.density or move ego.distance"
                )
            self.plan = self.plan.redrawn()
        return self.scene()

    def scene(self) -> Scene:
        """The world as it is. Raises SimulationError before `reset`."""
        if self._scene is None:
            raise SimulationError("the world has no episode yet; call reset(plan) first")
        return self._scene

    def perceived(self) -> Scene:
        """The world as the ego's sensors show it; the same object until the next `advance`."""
        if self._perceived is None:
            self._perceived = self.stage.sensors.perceive(self.scene(), self._sensor_rng)
        return self._perceived

    def advance(self, u: Array) -> Advance:
        """Apply u = (acceleration m/s2, front-wheel angle rad) for one decision, or up to the first violation."""
        scene = self.scene()
        self._script.step(scene)
        self._decisions += 1
        if self._decisions % 2:
            self._brake(scene, 2 * self.config.decision_s)
        self._last_u = np.array(u, dtype=float)
        close = self._close(scene)
        hit, min_dtc = None, math.inf
        for final in self._substeps():
            self._move(u)
            if final:
                self._refresh()
                now = self._scene
                gap, hit = self._nearest(now.ids, now.position, now.heading, now.size)
            else:
                gap, hit = self._nearest(*self._poses(close))
            min_dtc = min(min_dtc, gap)
            if hit is not None:
                break
        if hit is not None and not final:
            self._refresh()
        off_road, wrong_way = self._leaves_road()
        density = len(self._names) / self.network.road_km
        return Advance(self._collision(hit), off_road, wrong_way, min_dtc, self._sv_collisions(), density)

    # ---- one episode's set-up

    def _set_up(self, ego_driver: Literal["agent", "sumo"], options: tuple[str, ...]) -> bool:
        plan, config = self.plan, self.config
        streams = np.random.default_rng(plan.world_seed).spawn(4)
        traffic_rng, ego_rng, self._sensor_rng, event_rng = streams
        self._driven_by_sumo = ego_driver == "sumo"
        self._sumo.load(int(traffic_rng.integers(2**31 - 1)), self._types(), options)
        self.route = draw_route(self.network, plan.ego, ego_rng)
        self._held: set[str] = set()
        self._overlapping: set[frozenset[str]] = set()
        self._time0 = 0.0
        self._waited = 0.0
        self._last_u = np.zeros(2)
        self._decisions = 0
        self._ego_inside = False
        s = self.route.stop_line_s - plan.ego.distance_m - 0.5 * config.vehicle.length
        if s < 0.5 * config.vehicle.length:
            raise SimulationError(
                f"scenario {plan.scenario}: ego.distance {plan.ego.distance_m:.1f} m does not fit on the arm "
                f"{self.route.origin}, which has {self.route.stop_line_s:.1f} m before its stop line"
            )
        self._ego_s = s
        end = self.route.length - 0.5 * config.vehicle.length - 1.0
        self._destination_s = min(self.route.exit_s + plan.ego.destination_m, end)
        x, y, psi = (float(value) for value in self.route.path.pose(s))
        self._plant.reset(x, y, psi, plan.ego.speed_mps)
        self.stage = Stage(
            self._sumo, self.network, self.traffic, self._plant, self.route, event_rng,
            Sensors(np.zeros((0, 5))), config.decision_s, s,
        )  # fmt: skip
        self.traffic.begin(plan.traffic, traffic_rng)
        self._script = Script(plan.events, self.stage)
        self.traffic.populate()
        self._warm_up(plan.traffic.warm_up_s)
        if not safe_to_start(self.scene()):
            return False
        return self._enter_ego()

    def _types(self) -> Path:
        text = type_file(self.plan.traffic, self.config.vehicle)
        path = Path(self._folder.name) / f"{hashlib.sha1(text.encode()).hexdigest()[:12]}.add.xml"
        if not path.exists():
            path.write_text(text)
        return path

    def _warm_up(self, duration_s: float) -> None:
        steps = max(round(duration_s / self.config.decision_s), 1)
        for _ in range(steps):
            for _ in self._substeps():
                self._sumo.step()
                self._move_props()
            self._refresh()
            if self.stage.props:
                self._brake(self.scene(), self.config.decision_s)

    def _enter_ego(self) -> bool:
        plan, body = self.plan, self.config.vehicle
        s = float(self._ego_s) + 0.5 * body.length
        lane = self.network.lanes[self.network.paths.lane_ids[self.route.row][0]]
        self._sumo.add_route(EGO, self.route.edges)
        self._sumo.add(EGO, EGO, EGO, lane.index, s, plan.ego.speed_mps)
        self._sumo.step()
        self._move_props()
        if EGO not in self._sumo.vehicles():
            return False
        self._ego_inside = True
        if self._driven_by_sumo:
            self._read_ego()
        else:
            self._sumo.take_over(EGO)
            state = self._plant.state
            self._sumo.place(EGO, state.x, state.y, state.psi, state.v, body.length)
        self._time0 = self._sumo.time()
        self._refresh()
        now = self.scene()
        return self._nearest(now.ids, now.position, now.heading, now.size)[1] is None

    # ---- one sub-step

    def _substeps(self) -> list[bool]:
        return [False] * (self.config.substeps - 1) + [True]

    def _move(self, u: Array) -> None:
        dt = self.config.substep_s
        if not self._driven_by_sumo:
            state = self._plant.step(float(u[0]), float(u[1]), dt)
            self._sumo.place(EGO, state.x, state.y, state.psi, state.v, self.config.vehicle.length)
        self._sumo.step()
        self._move_props()
        if self._driven_by_sumo:
            self._read_ego()
        state = self._plant.state
        self._waited = self._waited + dt if state.v < 0.5 else 0.0

    def _move_props(self) -> None:
        for prop in self.stage.props:
            prop.step(self.config.substep_s)
        if any(prop.finished for prop in self.stage.props):
            self.stage.props = [prop for prop in self.stage.props if not prop.finished]

    def _read_ego(self) -> None:
        """Take the ego's state from SUMO, while it is on the road."""
        if EGO not in self._sumo.vehicles():
            return
        motion = self._sumo.motion([EGO], np.array([self.config.vehicle.length]))
        (x, y), psi, v = motion.position[0], float(motion.heading[0]), float(motion.speed[0])
        old = self._plant.state
        turned = (psi - old.psi + math.pi) % (2 * math.pi) - math.pi
        self._plant.state = EgoState(
            float(x),
            float(y),
            psi,
            v,
            0.0,
            turned / self.config.substep_s,
            float(motion.acceleration[0]),
            0.0,
        )

    def _close(self, scene: Scene) -> tuple[list[str], Array]:
        """Names of the SVs that can be met within a decision, and their sizes (n, 2) m."""
        away = scene.position - (scene.ego.x, scene.ego.y)
        reach = np.flatnonzero((np.hypot(away[:, 0], away[:, 1]) < MEET_M) & (scene.path >= 0))
        return [scene.ids[i] for i in reach], scene.size[reach]

    def _poses(self, close: tuple[list[str], Array]) -> tuple[list[str], Array, Array, Array]:
        """Names, centres (n, 2) m, headings (n,) rad and sizes (n, 2) m of those close by and of the props, now."""
        names, sizes = close
        present = set(self._sumo.vehicles())
        if not present.issuperset(names):
            stay = [i for i, name in enumerate(names) if name in present]
            names, sizes = [names[i] for i in stay], sizes[stay]
        position, heading = self._sumo.poses(names, sizes[:, 0])
        props = self.stage.props
        if props:
            poses = np.array([prop.pose() for prop in props])
            position, heading = (
                np.concatenate([position, poses[:, :2]]),
                np.concatenate([heading, poses[:, 2]]),
            )
            sizes = np.concatenate([sizes, [(prop.length, prop.width) for prop in props]])
            names = names + [prop.name for prop in props]
        return names, position, heading, sizes

    def _nearest(
        self, names: Sequence[str], position: Array, heading: Array, size: Array
    ) -> tuple[float, str | None]:
        """Smallest gap (m) between the ego and n rectangles, and the name of the one it touches, if any."""
        if not len(names):
            return math.inf, None
        ego, body = self._plant.state, self.config.vehicle
        distance = np.hypot(position[:, 0] - ego.x, position[:, 1] - ego.y)
        radius = 0.5 * (np.hypot(size[:, 0], size[:, 1]) + math.hypot(body.length, body.width))
        rows = np.flatnonzero(distance - radius <= distance.min())
        gaps = rectangle_gaps(
            ego.x, ego.y, ego.psi, body.length, body.width, position[rows], heading[rows], size[rows]
        )
        nearest = int(np.argmin(gaps))
        gap = float(gaps[nearest])
        return gap, None if gap > 0 else names[rows[nearest]]

    def _collision(self, hit: str | None) -> Collision | None:
        scene = self.scene()
        if hit is None or hit not in scene.ids:
            return None
        index = scene.ids.index(hit)
        return Collision(hit, Kind(scene.kind[index]), judge(scene, index, hit in self.stage.unlawful))

    def _leaves_road(self) -> tuple[bool, bool]:
        state, body = self._plant.state, self.config.vehicle
        centre = np.array([state.x, state.y])
        corners = rectangle_corners(centre, np.array(state.psi), np.array([body.length, body.width]))
        surface = self.network.surface
        off_road = bool(surface.signed_distance(corners).min() < -OFF_ROAD_M)
        direction = float(surface.lane_direction(centre))
        wrong_way = not math.isnan(direction) and math.cos(state.psi - direction) < 0
        return off_road, wrong_way

    # ---- after the sub-steps

    def _refresh(self) -> None:
        """Read the road anew, drop who has left, let others enter, compose the scene."""
        self._read()
        self.traffic.forget(self._active)
        self.traffic.refill(self._motion, self._lengths)
        self._scene = self._compose()
        self._perceived: Scene | None = None

    def _read(self) -> None:
        self._active = self._sumo.vehicles()
        drivers = self.traffic.drivers
        self._names = [name for name in self._active if name in drivers]
        known = [drivers[name].type for name in self._names]
        self._lengths = np.array([t.length for t in known])
        self._motion: Motion = self._sumo.motion(self._names, self._lengths)
        self._sizes = np.array([(t.length, t.width) for t in known]).reshape(-1, 2)
        self._kinds = np.array([int(t.kind) for t in known], dtype=np.int64)

    def _compose(self) -> Scene:
        motion, state, route = self._motion, self._plant.state, self.route
        self._ego_s, offset = route.path.project(state.x, state.y, self._ego_s)
        names, props = self._names, self.stage.props
        locate, drivers = self.network.paths.locate, self.traffic.drivers
        spots = [
            locate(drivers[name].origin, drivers[name].destination, lane, pos)
            for name, lane, pos in zip(names, motion.lane, motion.lane_pos, strict=True)
        ]
        path = np.array([spot[0] for spot in spots], dtype=np.int64)
        path_s = np.array([spot[1] for spot in spots]) - 0.5 * self._lengths
        course = np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=1)
        position, heading = motion.position, motion.heading
        velocity = motion.speed[:, None] * course
        acceleration, size, kind = motion.acceleration, self._sizes, self._kinds
        if props:
            poses = np.array([prop.pose() for prop in props])
            speeds = np.array([prop.speed for prop in props])
            course = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
            none = np.zeros(len(props))
            position = np.concatenate([position, poses[:, :2]])
            heading = np.concatenate([heading, poses[:, 2]])
            velocity = np.concatenate([velocity, speeds[:, None] * course])
            acceleration = np.concatenate([acceleration, none])
            size = np.concatenate([size, [(prop.length, prop.width) for prop in props]])
            kind = np.concatenate([kind, np.array([int(prop.kind) for prop in props])])
            path = np.concatenate([path, np.full(len(props), -1)])
            path_s = np.concatenate([path_s, none])
            names = names + [prop.name for prop in props]
        away = position - (state.x, state.y)
        order = np.argsort(np.einsum("ij,ij->i", away, away))
        return Scene(
            self._sumo.time() - self._time0, self.plan.timeout_s, state, self.config.vehicle, route, self._ego_s, offset,
            self._waited, self._last_u, self.network, tuple([names[i] for i in order]), position[order], heading[order],
            velocity[order], acceleration[order], size[order], kind[order], path[order], path_s[order], self._destination_s,
        )  # fmt: skip

    def _brake(self, scene: Scene, duration_s: float) -> None:
        """Let the yielding layer brake the SVs that must for the next duration_s, and release the others."""
        if not self.config.yielding:
            return
        braking, drivers = must_yield(scene, ego_present=self._ego_inside), self.traffic.drivers
        held = set()
        for index, deceleration in zip(braking.index, braking.deceleration, strict=True):
            name = scene.ids[index]
            if drivers[name].scripted:
                continue
            speed = math.hypot(*scene.velocity[index])
            self._sumo.command_speed(name, max(speed - deceleration * duration_s, 0.0), BRAKE_HARD)
            held.add(name)
        for name in self._held - held:
            if name in drivers and not drivers[name].scripted:
                self._sumo.release(name, drivers[name].mode)
        self._held = held

    def _sv_collisions(self) -> int:
        """New overlaps between SVs since last looked at, every second decision."""
        if self._decisions % 2:
            return 0
        pairs = overlapping_pairs(self._motion.position, self._motion.heading, self._sizes)
        now = {frozenset((self._names[i], self._names[j])) for i, j in pairs}
        new = len(now - self._overlapping)
        self._overlapping |= now
        return new
