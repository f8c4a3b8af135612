"""An episode as plain numbers, small enough for a page: road, tracks, what the driver thought, what happened.

    data = Recording(episode, agent); run_episode(..., watch=recording.watch); recording.data(record)

Frame k is the world after the decision k, counted from 0, together with that decision. Numbers are whole
multiples of a step: a length of 0.01 m, an angle of 0.001 rad, a series' own `step`. Coordinates are relative
to the junction's centre. Of the places along a track the first is kept, and then differences.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.agents.base import layers
from rudc.arrays import Array
from rudc.drawing.bodies import BRAKES_MPS2, STANDS_MPS
from rudc.drawing.palette import ASPHALT, MARK, PAVEMENT, RESERVED, VERGE, Colour
from rudc.drawing.road_picture import Brush, paint_road
from rudc.drawing.view import View, view_of
from rudc.evaluation.moments import Step, moments
from rudc.network.paths import SPACING
from rudc.network.polyline import straightened
from rudc.world.ego import GRAVITY, grip_of
from rudc.world.events import event_lines
from rudc.world.scene import Kind, Scene
from rudc.world.who_yields import who_yields

if TYPE_CHECKING:
    from rudc.agents.base import Agent, Decision
    from rudc.env.episode import Episode, StepResult
    from rudc.evaluation.record import EpisodeRecord
    from rudc.network.network import Network
    from rudc.scenario.plan import EpisodePlan

LENGTH, ANGLE = 0.01, 0.001
"""m and rad, of which coordinates and headings are multiples"""
BRAKES, HIDDEN, CONSTRAINED, ACTIVE = 1, 2, 4, 8
"""bits of a body's state at a frame: brake lights, not seen by the ego, constrained, acted on"""
PATH_STRIDE = 3
"""of the stations of others' ways, one in so many is kept"""
BLINKS_M, LEAVES_M = 30.0, 15.0
"""m before the stop line from which a vehicle that turns blinks; m before the exit, on leaving a
roundabout"""
SERIES: dict[str, float] = {
    "time_s": 0.01, "speed_mps": 0.01, "route_s_m": 0.01, "offset_m": 0.01,
    "acceleration_mps2": 0.01, "nominal_acceleration_mps2": 0.01, "safe_acceleration_mps2": 0.01,
    "steering_rad": 0.0001, "nominal_steering_rad": 0.0001, "safe_steering_rad": 0.0001,
    "sigma": 0.001, "sigma_epi": 0.001, "sigma_ale": 0.001,
    "least_h_m2": 0.01, "slack": 0.0001, "gap_m": 0.01, "reward": 0.001, "cost": 0.001,
    "friction": 0.001, "delay_s": 0.001, "true_friction": 0.001, "true_delay_s": 0.001,
}  # fmt: skip
"""what is kept of every frame -> the step that its values are multiples of"""
_LAYERS = {VERGE: "verge", RESERVED: "reserved", PAVEMENT: "pavement", ASPHALT: "asphalt", MARK: "mark"}


class Recording:
    """Keeps one episode; `watch` is for `run_episode`."""

    def __init__(self, episode: Episode, agent: Agent) -> None:
        self._episode, self._agent = episode, agent
        self._steps: list[Step] = []
        self._ego: list[tuple[float, float, float]] = []
        self._tracks: list[dict[str, Any]] = []
        self._open: dict[str, dict[str, Any]] = {}
        self._decisions: list[dict[str, Any]] = []
        self._sensors: list[dict[str, Any]] = []
        self._events: dict[int, dict[str, Any]] = {}
        self._courses: list[Any] = []

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision and what it led to."""
        view, k = view_of(self._episode.world, result.outcome), len(self._steps)
        truth, center = view.truth, self._episode.world.network.center
        done = decision.corrected
        step = Step(
            _series(truth, decision, result),
            "" if done is None else done.status,
            done is not None and done.infeasible,
            result.outcome or "",
            (float(decision.bounded[0]), float(decision.bounded[1])),
        )
        self._steps.append(step)
        self._ego.append((truth.ego.x - center[0], truth.ego.y - center[1], truth.ego.psi))
        self._decisions.append({**_told(decision, self._course()), "sensed": _sensed(view)})
        self._follow(view, decision, k)
        self._note_events(view, k)
        self._note_sensors(view, k)

    def data(self, record: EpisodeRecord) -> dict[str, Any]:
        """Everything that was kept, ready to be written as JSON. `record`: what became of the episode."""
        world, center = self._episode.world, self._episode.world.network.center
        low, high = _percentiles(self._agent)
        body, route = world.scene().vehicle, world.scene().route
        events = [self._events[number] for number in sorted(self._events)]
        return {
            "scenario": record.scenario,
            "agent": record.agent,
            "seed": record.seed,
            "outcome": record.outcome or "failed",
            "row": {name: record.text(name) for name in record.values if record.text(name)},
            "decision_s": world.config.decision_s,
            "timeout_s": _number(world.scene().timeout_s),
            "road": road_shapes(world.network),
            "arms": [_arm(world.network, arm) for arm in world.network.arms],
            "vehicle": [body.length, body.width],
            "limits": {"a": [body.a_min, body.a_max], "delta": body.delta_max},
            "frames": len(self._steps),
            "ego": _poses(self._ego),
            "route": {
                "path": _flat(route.path.xy[::2] - center),
                "left": _flat(route.left_edge[::2] - center),
                "right": _flat(route.right_edge[::2] - center),
                "spacing_m": 2 * SPACING,
                "blinks": _blinks(world.network, route.turn, route.stop_line_s, route.exit_s),
                "goal_m": _number(world.scene().goal_s),
            },
            "paths": {str(row): _path(world.network, row, route.row) for row in self._rows()},
            "courses": [_flat(course.path.xy[::2] - center) for course in self._courses],
            "tracks": [_closed(track, center) for track in self._tracks],
            "series": {name: _stepped(self._steps, name, step) for name, step in SERIES.items()},
            "status": [step.status for step in self._steps],
            "decisions": self._decisions,
            "sensors": self._sensors,
            "events": events,
            "absent": _absent(world.plan),
            "event_lines": event_lines(world.plan, world.happenings()),
            "sigma_low": low,
            "sigma_high": high,
            "moments": moments(self._steps, events, body, record.text("hit"), record.text("fault")),
        }

    def _course(self) -> int | None:
        """Which of the courses noted so far the agent drives; None for its route, or if it has none."""
        courses = next((found.courses for found in _outlooks(self._agent) if found.courses), None)
        course = getattr(courses, "course", None)
        if course is None:
            return None
        if not any(course is known for known in self._courses):
            self._courses.append(course)
        return next(i for i, known in enumerate(self._courses) if known is course)

    def _follow(self, view: View, decision: Decision, k: int) -> None:
        """Add a frame to the tracks of all who are there."""
        scene, hidden, numbers = view.truth, view.hidden, view.numbers
        done = decision.corrected
        active = set(done.active) if done else set()
        constrained = set(done.names) if done else set()
        speed, yielding = scene.speed, who_yields(scene, view.heedless)
        still: dict[str, dict[str, Any]] = {}
        for i, name in enumerate(scene.ids):
            track = self._open.get(name) or self._begin(scene, i, k)
            still[name] = track
            flags = BRAKES * bool(scene.acceleration[i] < BRAKES_MPS2 or speed[i] < STANDS_MPS)
            flags += HIDDEN * (name in hidden)
            flags += CONSTRAINED * (f"veh:{name}" in constrained) + ACTIVE * (f"veh:{name}" in active)
            x, y = scene.position[i]
            track["poses"].append((x, y, scene.heading[i]))
            now = {"path": int(scene.path[i]), "yields": yielding.get(name), "events": numbers.get(name)}
            for kept, value in now.items():
                if value != (track[kept][-1][1] if track[kept] else None):
                    track[kept].append((k, value))
            track["speed"].append(round(float(speed[i]), 1))
            track["state"].append(flags)
        self._open = still

    def _begin(self, scene: Scene, i: int, k: int) -> dict[str, Any]:
        track: dict[str, Any] = {
            "name": scene.ids[i], "kind": Kind(int(scene.kind[i])).name.lower(), "from": k,
            "size": [round(float(v), 2) for v in scene.size[i]],
            "path": [], "yields": [], "events": [], "poses": [], "speed": [], "state": [],
        }  # fmt: skip
        self._tracks.append(track)
        return track

    def _rows(self) -> list[int]:
        """Rows of `network.paths` that anybody drives on."""
        return sorted({row for track in self._tracks for _, row in track["path"] if row >= 0})

    def _note_events(self, view: View, k: int) -> None:
        center = self._episode.world.network.center
        for event in view.events:
            noted = self._events.setdefault(
                event.number,
                {
                    "number": event.number,
                    "kind": event.event.kind,
                    "places": [_rounded(np.array(place) - center) for place in event.places],
                    "patch": list[list[int]](),
                    "way": None if event.way is None else _flat(event.way - center),
                    "over": list[list[int | None]](),
                },
            )
            if event.patch:
                noted["patch"] = [_flat(corners - center) for corners in event.patch]
            noted["begun_s"], noted["visible_s"] = event.begun_s, event.visible_s
            open_span = bool(noted["over"]) and noted["over"][-1][1] is None
            if event.is_over and not open_span:
                noted["over"].append([k, None])
            elif open_span and not event.is_over:  # what replaced it has passed
                noted["over"][-1][1] = k

    def _note_sensors(self, view: View, k: int) -> None:
        center = np.array([*self._episode.world.network.center, 0.0, 0.0, 0.0])
        reach = {
            "range_m": _number(view.range_m),
            "boxes": [[round(float(v), 3) for v in box - center] for box in view.occluders],
        }
        if not self._sensors or {**reach, "from": 0} != {**self._sensors[-1], "from": 0}:
            self._sensors.append({"from": k, **reach})


class _Shapes(Brush):
    """Keeps shapes as [layer, width in LENGTH or 0 for an area, x, y, dx, dy, ...]."""

    def __init__(self, center: Array) -> None:
        self._center = center
        self.shapes: list[list[Any]] = []

    def area(self, polygon: Array, colour: Colour) -> None:
        self.shapes.append([_LAYERS[colour], 0, *_flat(polygon - self._center)])

    def line(self, xy: Array, width_m: float, colour: Colour) -> None:
        self.shapes.append([_LAYERS[colour], round(width_m / LENGTH), *_flat(xy - self._center)])

    def pieces(self, segments: Array, width_m: float, colour: Colour) -> None:
        super().pieces(straightened(segments), width_m, colour)


def road_shapes(network: Network) -> list[list[Any]]:
    """The road as areas and lines: [layer, width (0: an area), x, y, dx, dy, ...] in steps of LENGTH."""
    shapes = _Shapes(network.center)
    paint_road(network, shapes)
    return shapes.shapes


def _arm(network: Network, arm: Any) -> dict[str, Any]:
    lanes = [network.lanes[name].xy for name in arm.in_lanes]
    end = lanes[-1][-1] if lanes else network.center
    return {
        "name": arm.name.replace("_", " "),
        "major": arm.major,
        "bearing": round(float(arm.bearing), 3),
        "entry": _rounded(end - network.center),
    }


def _path(network: Network, row: int, own: int) -> dict[str, Any]:
    """A way through the junction, where it leaves it, and who yields where the ego is on the row `own`."""
    paths = network.paths
    until = int(paths.length[row] / SPACING) + 1
    before, after = bool(paths.yields[own, row]), bool(paths.yields[row, own])
    return {
        "xy": _flat(paths.xy[row, :until:PATH_STRIDE] - network.center),
        "spacing_m": PATH_STRIDE * SPACING,
        "exit_m": round(float(paths.exit_s[row]), 1),
        "blinks": _blinks(network, _turn(network, row), paths.stop_s[row], paths.exit_s[row]),
        "yields": "ego" if before else "other" if after else "",
    }


def _turn(network: Network, row: int) -> str:
    return next((m.turn for m in network.movements if row in m.rows), "straight")


def _blinks(network: Network, turn: str, stop_m: float, exit_m: float) -> list[Any] | None:
    """Side, and from where to where (m) along a way somebody who drives on it blinks; None if nowhere. Out of
    a roundabout everybody turns right.
    """
    if network.is_roundabout:
        return ["right", round(float(exit_m) - LEAVES_M, 1), round(float(exit_m), 1)]
    if turn == "straight":
        return None
    side = "right" if turn == "right" else "left"
    return [side, round(float(stop_m) - BLINKS_M, 1), round(float(exit_m), 1)]


def _absent(plan: EpisodePlan) -> list[dict[str, Any]]:
    """Events of the scenario's file that are no part of the episode."""
    scripted = enumerate(plan.scripted, start=1)
    return [{"number": k, "kind": event.kind} for k, event in scripted if k not in plan.event_numbers]


def _series(truth: Scene, decision: Decision, result: StepResult) -> dict[str, float]:
    ego, done, unsure = truth.ego, decision.corrected, decision.uncertainty
    known, real = decision.plant.actuation if decision.plant else None, truth.actuation
    return {
        "time_s": truth.time_s, "speed_mps": ego.v, "route_s_m": truth.ego_s, "offset_m": truth.ego_offset,
        "acceleration_mps2": ego.acceleration, "steering_rad": ego.steering,
        "nominal_acceleration_mps2": float(decision.u_rl[0]), "safe_acceleration_mps2": float(decision.u[0]),
        "nominal_steering_rad": float(decision.u_rl[1]), "safe_steering_rad": float(decision.u[1]),
        "sigma": decision.sigma,
        "sigma_epi": math.nan if unsure is None else float(unsure.epistemic),
        "sigma_ale": math.nan if unsure is None else float(unsure.aleatoric),
        "least_h_m2": float(np.min(done.h)) if done is not None and len(done.h) else math.nan,
        "slack": math.nan if done is None else float(done.slack),
        "gap_m": result.advance.min_dtc_m, "reward": result.reward, "cost": result.cost,
        "friction": _or_nan(getattr(known, "friction", None)),
        "delay_s": _or_nan(getattr(known, "delay_s", None)),
        "true_friction": math.nan if real is None else grip_of(real) / GRAVITY,
        "true_delay_s": _or_nan(getattr(real, "delay_s", None)),
    }  # fmt: skip


def _told(decision: Decision, course: int | None) -> dict[str, Any]:
    """What a decision says besides numbers that are plotted; empty where there is nothing to say."""
    done = decision.corrected
    told: dict[str, Any] = {} if course is None else {"course": course}
    if done is not None:
        edges = [side for side in ("left", "right") if any(a.startswith(f"road:{side}") for a in done.active)]
        others = [name for name in done.active if not name.startswith(("veh:", "road:"))]
        told |= {key: value for key, value in (("edges", edges), ("others", others)) if value}
        if done.infeasible:
            told["infeasible"] = True
        if decision.bounded.any():
            told["bounded"] = [round(float(value), 4) for value in decision.bounded]
    if decision.asks_grip:
        told["asks_grip"] = True
    return told


def _sensed(view: View) -> list[list[str | int]]:
    """Name, and how far from its place the ego sees it: dx, dy, dpsi in steps; only of those seen
    elsewhere."""
    scene, seen = view.truth, view.perceived
    if seen is None:
        return []
    rows = {name: i for i, name in enumerate(scene.ids)}
    found = list[list[str | int]]()
    for k in view.misplaced:
        i = rows[seen.ids[k]]
        dx, dy = (round(float(v) / LENGTH) for v in seen.position[k] - scene.position[i])
        turn = math.remainder(float(seen.heading[k] - scene.heading[i]), 2 * math.pi)
        found.append([seen.ids[k], dx, dy, round(turn / ANGLE)])
    return found


def _outlooks(agent: Agent) -> Iterator[Any]:
    """The outlooks (courses, adaptation) of the agent and of the agents inside it."""
    found = (getattr(layer, "outlook", None) for layer in layers(agent))
    return (outlook for outlook in found if outlook is not None)


def _percentiles(agent: Agent) -> tuple[float | None, float | None]:
    """sigma_l and sigma_h of the agent's slack, if it has one."""
    for layer in layers(agent):
        slack = getattr(getattr(layer, "correction", None), "slack", None)
        if slack is not None:
            return round(slack.low, 4), round(slack.high, 4)
    return None, None


def _closed(track: dict[str, Any], center: Array) -> dict[str, Any]:
    """A track as it is written."""
    poses = [(x - center[0], y - center[1], psi) for x, y, psi in track["poses"]]
    state = "".join(f"{flags:x}" for flags in track["state"])
    speed = [round(10 * v) for v in track["speed"]]
    return {**track, "poses": _poses(poses), "speed": _differences(speed), "state": state}


def _poses(poses: Sequence[tuple[float, float, float]]) -> dict[str, list[int]]:
    """x, y, psi, each the first and then differences."""
    x, y, psi = np.array(poses).T if poses else np.zeros((3, 0))
    whole = (x / LENGTH, y / LENGTH, np.unwrap(psi) / ANGLE)
    return {
        name: _differences(np.rint(v).astype(int).tolist())
        for name, v in zip(("x", "y", "psi"), whole, strict=True)
    }


def _differences(values: Sequence[int]) -> list[int]:
    return [b - a for a, b in zip([0, *values], values, strict=False)]


def _flat(xy: Array) -> list[int]:
    """x, y, dx, dy, ... of a polyline (K, 2) m, in steps of LENGTH."""
    whole = np.rint(np.asarray(xy) / LENGTH).astype(int)
    return np.diff(whole, axis=0, prepend=np.zeros((1, 2), dtype=int)).ravel().tolist()


def _rounded(xy: Array) -> list[float]:
    return [round(float(v), 2) for v in xy]


def _stepped(steps: Sequence[Step], name: str, size: float) -> list[int | None]:
    values = [step.series[name] for step in steps]
    return [round(v / size) if math.isfinite(v) else None for v in values]


def _number(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
