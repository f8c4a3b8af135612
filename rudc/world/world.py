"""`World`: one episode at a time of an ego vehicle among SUMO's traffic.

    with World(load_network("four_way")) as world:
        scene = world.reset(load_scenario("random_destination").plan(seed=0))
        advance = world.advance(np.array([0.5, 0.0]))     # m/s2, rad
        scene = world.scene()

A decision lasts `decision_s` and is simulated in sub-steps. In each, the ego's plant moves, SUMO moves the
surrounding vehicles (SVs), props move, and the ego's rectangle is tested against what is near. Before the
first sub-step events act, and twice a second, or more often (`yielding.next_look`), the yielding layer brakes
SVs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rudc.arrays import Array
from rudc.errors import SimulationError
from rudc.world.borders import Borders
from rudc.world.brakes import Brakes
from rudc.world.casting import cast
from rudc.world.config import EgoDriver, WorldConfig
from rudc.world.contact import NOTHING, Nearest, nearest_of, survey
from rudc.world.detours import Detours
from rudc.world.ego import EgoPlant, grip_of, realised, refuse_no_action, within_limits
from rudc.world.entering import ego_against
from rudc.world.events import Happening, Script, WorldStage
from rudc.world.fault import IN_SIGHT_S, Collision, judge
from rudc.world.kernels import largest
from rudc.world.lane_keeping import LaneKeeping
from rudc.world.perception import Sensors
from rudc.world.reading import EgoView, Reader
from rudc.world.scene import STANDING, EgoState, Kind, Scene
from rudc.world.spawn import draw_route, entry, fastest_start, no_safe_start, safe_to_start, start_of
from rudc.world.sumo import Sumo
from rudc.world.traffic import Traffic
from rudc.world.trial import refuse_untried
from rudc.world.unblocking import Unblocking
from rudc.world.vehicle_types import EGO, type_file
from rudc.world.yielding import BRAKE_MOST, ego_must_yield, must_yield, next_look

if TYPE_CHECKING:
    from rudc.network.network import Network
    from rudc.scenario.plan import EpisodePlan

REDRAWS = 30
"""how often an unsafe start is drawn again before `reset` raises SimulationError"""
CLOSE_M = 2.0
"""m, gaps up to this size are measured in every sub-step, larger ones only at the end of a decision"""
FAR_M = 10_000.0
"""m, far off any road"""
OVERLAPS_EVERY = 5
"""decisions from one test for overlaps among SVs to the next"""


class Advance(NamedTuple):
    """What happened during one decision."""

    collision: Collision | None
    off_road: bool
    wrong_way: bool
    min_dtc_m: float
    """m, smallest gap between the ego's rectangle and any other during the decision; inf if alone"""
    sv_collisions: int
    """how many pairs began to overlap: two SVs, or an SV and a prop"""
    density: float
    """veh/km on the road at the end"""
    gap_m: float | None = None
    """m, smallest gap at the end of the decision; None if not measured"""
    events: tuple[str, ...] = ()
    """names of the events that took effect at the beginning of the decision"""


class World:
    """The simulation, ended by `close` or when no reference to it is left.

    Raises WorldBusyError if this process already has one open (`rudc.world.isolated` runs one in a process of
    its own), and NetworkError for a junction with traffic lights or a network over which SUMO crashes.
    """

    def __init__(self, network: Network, config: WorldConfig | None = None) -> None:
        network.refuse_lights()
        refuse_untried(network)
        self.network = network
        self.config = config or WorldConfig()
        self.vehicle = network.vehicle
        self._sumo = Sumo(network.path, self.config.substep_s)
        self.traffic = Traffic(self._sumo, network)
        self._plant = EgoPlant(self.vehicle)
        self._scene: Scene | None = None
        self._perceived: Scene | None = None

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the simulation, so that another world may be made in this process."""
        self._sumo.close()

    def reset(
        self, plan: EpisodePlan, *, ego_driver: EgoDriver = "agent", options: tuple[str, ...] = ()
    ) -> Scene:
        """Set up an episode and return its first scene.

        ego_driver "sumo" leaves the ego to SUMO's own driver; `advance` then ignores its argument, and the
        scene's `last_u` is what that driver did.
        `options` go to SUMO's command line for this episode (`--fcd-output FILE`). A plan in which the ego
        cannot start safely is drawn again, `self.plan.attempt` times; SimulationError when no draw is safe.
        """
        self.plan, self._scene, self._perceived = plan, None, None
        try:
            while not self._set_up(ego_driver, options):
                if self.plan.attempt >= REDRAWS:
                    raise no_safe_start(plan, 1 + REDRAWS)
                self.plan, self._scene = self.plan.redrawn(), None
        except BaseException:  # half an episode is none
            self._scene = None
            raise
        return self.scene()

    def scene(self) -> Scene:
        """The scene as it really is. Raises SimulationError before `reset`."""
        if self._scene is None:
            raise SimulationError("the world has no episode yet; call reset(plan) first")
        return self._scene

    def perceived(self) -> Scene:
        """The scene as the ego's sensors show it; the same object until the next `advance`."""
        if self._perceived is None:
            scene = self.scene()
            self._perceived = self.stage.sensors.perceive(scene, self._sensor_rng)
            self._script.look(self._perceived)
        return self._perceived

    def happenings(self) -> tuple[Happening, ...]:
        """The state of each event, in the order of `plan.events`; `perceived` notes what the ego sees."""
        self.scene()  # refuses where there is no episode yet
        return self._script.happenings()

    def sensors(self) -> Sensors:
        """The flaws of the ego's perception as they are now."""
        self.scene()
        return self.stage.sensors

    def advance(self, u: Array) -> Advance:
        """Apply u (2,), acceleration (m/s2) and front-wheel angle (rad), cut to the vehicle's limits, for one
        decision or up to a collision in it. Raises InputError unless u is two numbers."""
        scene = self.scene()
        refuse_no_action(u)
        began = self._script.step(scene)
        moving = any(prop.moves for prop in self.stage.props)
        every = next_look(self._nearest.gap, moving, self.config.decision_s)
        self._detours.move_aside(scene, self.stage, self.config.decision_s, self._sumo_ego())
        if self._decisions % every == 0 or self._brakes.are_over:
            self._brake(scene, every * self.config.decision_s)
        self._lane_keeping.step(scene, self.stage.props)
        if self.config.yielding and not self._driven_by_sumo:
            self._unblocking.step(scene, self._held, self.config.decision_s)
        self._decisions += 1
        self._last_u = np.array(within_limits(self.vehicle, float(u[0]), float(u[1])))
        reached = self._drive(scene, *self._last_u.tolist())
        if self._driven_by_sumo:
            passed_s = round(self._sumo.time() - self._time0 - scene.time_s, 6)
            self._last_u = np.array(realised(scene.ego, self._plant.state, passed_s, self.vehicle))
        before, scene = scene, self._refresh()
        if reached.touched is None:
            reached = min(reached, self._nearest, key=lambda found: found.gap)
        off_road, wrong_way = self._borders.left(self._plant.state)
        overlaps = self._reader.new_overlaps(scene) if self._decisions % OVERLAPS_EVERY == 0 else 0
        density = len(self._reader.names) / self.network.road_km
        hit = None if reached.touched is None else self._collision(reached.touched, scene, before)
        return Advance(hit, off_road, wrong_way, reached.gap, overlaps, density, self._nearest.gap, began)

    def put_ego(self, x: float, y: float, psi: float, v: float = 0.0) -> Scene:
        """Put the ego at a pose (m, m, rad) with a speed (m/s), for studies and tests; return the scene."""
        self.scene()
        length = self.vehicle.length
        # A vehicle that jumps within its lane keeps its rank in SUMO's list of that lane, and others would
        # change lanes into it. So it leaves the road for a step.
        self._sumo.place(EGO, x + FAR_M, y + FAR_M, psi, v, length)
        self._sumo.step()
        self._move_props()
        self._plant.reset(x, y, psi, v, self._plant.actuation)
        self.stage.feel_patches()
        self._sumo.place(EGO, x, y, psi, v, length)
        self._ego_s, self._waited, self._last_u = self.route.path.project(x, y)[0], 0.0, np.zeros(2)
        return self._refresh()

    # ---- one episode's set-up

    def _set_up(self, ego_driver: EgoDriver, options: tuple[str, ...]) -> bool:
        plan = self.plan
        traffic_rng, ego_rng, self._sensor_rng, event_rng = np.random.default_rng(plan.world_seed).spawn(4)
        self._driven_by_sumo = ego_driver == "sumo"
        self._sumo.load(int(traffic_rng.integers(2**31 - 1)), type_file(plan.traffic, self.vehicle), options)
        self._time0, self._waited, self._last_u = 0.0, 0.0, np.zeros(2)
        self._borders = Borders(self.network.surface, self.vehicle, plan.ego.may_cross_centre)
        self._decisions, self._ego_inside = 0, False
        self._place_ego(ego_rng)
        self._brakes = Brakes(self._sumo, self.traffic)
        self.stage = WorldStage(
            self._sumo, self.network, self.traffic, self._brakes, self._plant, self.route, event_rng,
            Sensors(), self.config.decision_s, self._ego_s,
        )  # fmt: skip
        self.traffic.begin(plan.traffic, traffic_rng)
        self._reader = Reader(self._sumo, self.network, self.traffic)
        self._held, self._for_ego = set[str](), set[str]()
        self._lane_keeping, self._unblocking = LaneKeeping(self._sumo), Unblocking(self._sumo, self.traffic)
        self._detours = Detours(self._sumo, self.network, self.traffic)
        self._script = Script(plan, self.stage)
        self._plant.slow_down(fastest_start(self.route, self._ego_s, grip_of(self._plant.actuation)))
        self.traffic.populate()
        self._warm_up(plan.traffic.warm_up_s)
        return safe_to_start(self.scene()) and self._enter_ego(event_rng)

    def _place_ego(self, rng: np.random.Generator) -> None:
        """Draw the route and put the plant where the ego starts."""
        plan, half = self.plan.ego, 0.5 * self.vehicle.length
        route = self.route = draw_route(self.network, plan, rng)
        self._ego_s = start_of(route, self.plan, self.vehicle.length)
        self._destination_s = min(route.exit_s + plan.destination_m, route.length - half - 1.0)
        x, y, psi = (float(value) for value in route.path.pose(self._ego_s))
        self._entry = entry(self.network, route, self._ego_s + half)
        self._plant.reset(x, y, psi, min(plan.speed_mps, self.network.speed_limit(self._entry.lane.edge)))

    def _warm_up(self, duration_s: float) -> None:
        last = max(round(duration_s / self.config.decision_s), 1) - 1
        for decision in range(last + 1):
            for _ in range(self.config.substeps):
                self._sumo.step()
                self._move_props()
            self._reader.meet()
            if decision == last or self.stage.props or self.traffic.missing > 0:
                self._refill()
            if self.stage.props:  # only these need a scene before the ego enters
                scene = self._look()
                self._detours.move_aside(scene, self.stage, self.config.decision_s)
                self._brake(scene, self.config.decision_s)
                for prop in self.stage.props:
                    prop.look_out(scene)
        if not self.stage.props:
            self._look()

    def _enter_ego(self, rng: np.random.Generator) -> bool:
        state, body = self._plant.state, self.vehicle
        together = {EGO, *cast(self.plan.events, self.scene(), self.stage, rng)}
        self._reader.relocate()
        self._sumo.add_route(EGO, self._entry.edges)
        v = min(state.v, self.traffic.bends.edge_limit(self._entry.lane.edge))
        self._sumo.add(EGO, EGO, EGO, self._entry.lane.index, self._entry.front, v)
        self._sumo.step()
        self._move_props()
        if not together <= set(self._sumo.vehicles()):
            return False
        self._ego_inside = True
        if self._driven_by_sumo:
            self.traffic.drive_ego()
            self._read_ego()
        else:
            self._sumo.take_over(EGO)
            self._sumo.place(EGO, state.x, state.y, state.psi, state.v, body.length)
        self._time0 = self._sumo.time()
        self._refresh()
        return self._nearest.touched is None

    # ---- one decision

    def _drive(self, scene: Scene, a: float, delta: float) -> Nearest:
        """Simulate the sub-steps, or those up to a contact, and return what was nearest before the last one.
        What is near after the last one is measured in the next scene."""
        last, reached = self.config.substeps - 1, NOTHING
        for prop in self.stage.props:
            prop.look_out(scene)
        for step in range(last + 1):
            self._move(a, delta)
            if step < last and self._close:
                reached = min(reached, self._nearest_now(scene), key=lambda found: found.gap)
                if reached.touched is not None:
                    break
        return reached

    def _move(self, a: float, delta: float) -> None:
        dt = self.config.substep_s
        if not self._driven_by_sumo:
            state = self._plant.step(a, delta, dt)
            self.stage.feel_patches()
            self._sumo.place(EGO, state.x, state.y, state.psi, state.v, self.vehicle.length)
        self._sumo.step()
        self._move_props()
        if self._driven_by_sumo:
            self._read_ego()
        self._waited = self._waited + dt if self._plant.state.v < STANDING else 0.0

    def _move_props(self) -> None:
        props = self.stage.props
        for prop in props:
            prop.step(self.config.substep_s)
        if any(prop.finished for prop in props):
            self.stage.props = [prop for prop in props if not prop.finished]

    def _read_ego(self) -> None:
        """Take the ego's state from SUMO, while it is on the road."""
        if EGO not in self._sumo.vehicles():
            self._ego_inside = False
            return
        x, y, psi = self._sumo.pose(EGO, self.vehicle.length)
        v, a = self._sumo.drive(EGO)
        turned = (psi - self._plant.state.psi + math.pi) % (2 * math.pi) - math.pi
        self._plant.state = EgoState(x, y, psi, v, 0.0, turned / self.config.substep_s, a, 0.0)

    def _nearest_now(self, scene: Scene) -> Nearest:
        """The nearest of the bodies that were close to the ego in the scene and are still on the road."""
        props = {prop.name: prop for prop in self.stage.props}
        present = self._sumo.vehicles()
        rows, poses = list[int](), list[tuple[float, float, float]]()
        for i, name in enumerate(scene.ids[: self._close]):
            known = props.get(name)
            if known or name in present:
                rows.append(i)
                poses.append(known.pose() if known else self._sumo.pose(name, scene.size.item(i, 0)))
        if not rows:
            return NOTHING
        pose, names, ego = np.array(poses), [scene.ids[i] for i in rows], self._plant.state
        return nearest_of(ego, self.vehicle, names, pose[:, :2], pose[:, 2], scene.size[rows])[0]

    def _collision(self, hit: str, scene: Scene, before: Scene) -> Collision:
        """The collision, judged in the scene after the contact, or in the one before if the other is gone."""
        scene, sudden = scene if hit in scene.ids else before, self.stage.is_sudden(hit)
        index, held = scene.ids.index(hit), hit in self._for_ego and self._sumo.stood(hit) < IN_SIGHT_S
        fault = judge(scene, index, hit in self.stage.unlawful, held, sudden)
        return Collision(hit, Kind(scene.kind[index]), fault, sudden)

    # ---- after the sub-steps

    def _refresh(self) -> Scene:
        """Read the SVs anew, let others enter where some have left, compose the scene."""
        self._refill()
        return self._look()

    def _refill(self) -> None:
        """Read the SVs anew, let others enter where some have left."""
        self._reader.read()
        if self.traffic.missing > 0:
            rears = [*self._reader.rears(), *ego_against(self.traffic, self._plant)]
            self.traffic.refill(rears)

    def _look(self) -> Scene:
        """Compose the scene from what was read, and find what is near the ego."""
        state = self._plant.state
        self._ego_s, offset = self.route.path.project(state.x, state.y, self._ego_s)
        ego = EgoView(
            round(self._sumo.time() - self._time0, 6), self.plan.timeout_s, state, self.vehicle, self.route,
            self._ego_s, offset, self._waited, self._last_u, self._destination_s,
            self._plant.actuation, self.plan.ego.may_cross_centre, self.stage.road_friction,
        )  # fmt: skip
        scene = self._scene = self._reader.scene(ego, self.stage.props)
        self._perceived = None
        self._nearest, self._close = NOTHING, 0
        if self._ego_inside:
            fastest = state.v + 1.5 * largest(scene.velocity) + 1.0
            reach = CLOSE_M + fastest * self.config.decision_s
            self._nearest, self._close = survey(scene, reach)
        return scene

    def _brake(self, scene: Scene, duration_s: float) -> None:
        """Make the SVs that must yield or wait brake for the next duration_s seconds."""
        if not self.config.yielding:
            return
        most = min(BRAKE_MOST, self.traffic.grip)
        must = must_yield(scene, ego_present=self._ego_inside, brake_most=most, heedless=self.stage.unlawful)
        self._held = {scene.ids[row] for row in must.rows}
        self._for_ego = {scene.ids[row] for row in must.for_ego}
        wanted = {
            scene.ids[row]: (math.hypot(*scene.velocity[row]), deceleration)
            for row, deceleration in zip(must.rows, must.deceleration, strict=True)
        }
        if self.stage.props or self._detours.round_something:
            for name, (speed, needed) in self._detours.step(scene).items():
                wanted[name] = speed, max(min(needed, most), wanted.get(name, (0.0, 0.0))[1])
            if self._detours.redirected:
                self._reader.relocate()
        ego = self._sumo_ego() if self.stage.props else None
        if ego and (deceleration := min(ego_must_yield(scene, *ego), most)) > 0:
            wanted[EGO] = scene.ego.v, deceleration
        self._brakes.apply(wanted, duration_s)

    def _sumo_ego(self) -> tuple[int, float] | None:
        """Where a SUMO-driven ego is, as `Reader.locate_ego`; None if an agent drives, or it is gone."""
        there = self._driven_by_sumo and self._ego_inside
        return self._reader.locate_ego(self.route, self.vehicle.length) if there else None
