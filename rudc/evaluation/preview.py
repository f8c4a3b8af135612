"""A picture of what a scenario says: the road, the ego's path, what happens, and one seed's traffic."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from rudc.errors import StorageError
from rudc.network.network import Network, load_network
from rudc.scenario.poses import Pose
from rudc.world.draw import draw_network, draw_rectangles, draw_route, new_axes, polygon_of, save
from rudc.world.scene import Kind, Scene
from rudc.world.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rudc.scenario.events import Event
    from rudc.scenario.model import Scenario

EGO, TRAFFIC, PEOPLE, TROUBLE, WALL = "#ffd23f", "#8fb8de", "#ff9f68", "#e4572e", "#3a3f47"
REACH_M = 70.0
"""m shown each way from the junction's centre"""


def draw_preview(scenario: Scenario, seed: int, path: Path) -> Path:
    """Set up the seed's episode and draw its first scene to an image file. Errors: those of `World.reset`."""
    plan = scenario.plan(seed)
    network = load_network(scenario.network, scenario.junction)
    with World(network) as world:
        scene = world.reset(plan)
        boxes, plan = world.stage.sensors.occluders, world.plan
    axes = draw_network(network, new_axes(9.0, 110), extent=min(REACH_M, network.half_extent), arrows=True)
    draw_route(axes, scene.route, edges=False)
    _draw_road_users(axes, scene)
    draw_rectangles(axes, [polygon_of(*(float(v) for v in box)) for box in boxes], WALL, zorder=8.0)
    for k, event in enumerate(plan.events, start=1):
        _mark_places(axes, network, event, str(k))
    _write(axes, scenario, plan.events, f"seed {seed}, {scene.route.origin} to {scene.route.destination}")
    try:
        return save(axes, path)
    except (OSError, ValueError) as error:  # no such folder, no permission, unknown kind of image
        raise StorageError(f"cannot write {path}: {error}") from None


def _draw_road_users(axes: Axes, scene: Scene) -> None:
    colours = {Kind.PEDESTRIAN: PEOPLE, Kind.OBSTACLE: TROUBLE}
    for i in range(scene.count):
        x, y = (float(v) for v in scene.position[i])
        length, width = (float(v) for v in scene.size[i])
        rectangle = polygon_of(x, y, float(scene.heading[i]), length, width)
        special = scene.path[i] < 0 and scene.kind[i] != Kind.PEDESTRIAN
        colour = TROUBLE if special else colours.get(Kind(int(scene.kind[i])), TRAFFIC)
        draw_rectangles(axes, [rectangle], colour)
    ego, body = scene.ego, scene.vehicle
    draw_rectangles(axes, [polygon_of(ego.x, ego.y, ego.psi, body.length, body.width)], EGO, zorder=11.0)


def _mark_places(axes: Axes, network: Network, event: Event, label: str) -> None:
    """The event's number where it takes place, as far as it says so."""
    for x, y in _places(network, event):
        axes.text(
            x, y, label, color="white", fontsize=8, ha="center", va="center", zorder=20,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": TROUBLE, "edgecolor": "white"},
        )  # fmt: skip


def _places(network: Network, event: Event) -> list[tuple[float, float]]:
    parts: Any = getattr(event, "vehicles", None) or getattr(event, "boxes", None) or [event]
    places = []
    for part in parts:
        # the `position` of `sensor_noise` is no place
        position = getattr(part, "position", None) if isinstance(part, Pose) else None
        lane, arm_name, at = (getattr(part, name, None) for name in ("lane", "arm", "at"))
        if position is not None:
            x, y = (float(v) for v in position)
            places.append((float(network.center[0]) + x, float(network.center[1]) + y))
        elif lane is not None:
            places.append(network.place_on_lane(lane, float(at or 0.0))[:2])
        elif arm_name is not None:
            arm = network.arm(arm_name)
            lanes = [*arm.in_lanes, *arm.out_lanes]
            spots = np.array([network.place_on_lane(lane, float(at or 0.0))[:2] for lane in lanes])
            x, y = spots.mean(axis=0)
            places.append((float(x), float(y)))
    return places


def _write(axes: Axes, scenario: Scenario, events: tuple[Event, ...], where: str) -> None:
    lines = [f"{scenario.name}: {where}"]
    lines += [f"{k}  {_described(event)}" for k, event in enumerate(events, start=1)]
    text = "\n".join(part for line in lines for part in wrap(line, 100, subsequent_indent="   "))
    axes.text(
        0.01, 0.99, text, transform=axes.transAxes, fontsize=8, va="top", family="monospace", zorder=30,
        bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none"},
    )  # fmt: skip


def _described(event: Event) -> str:
    """An event in a line, its places left out: they are marked."""
    data: dict[str, Any] = event.model_dump(mode="json", by_alias=True, exclude_none=True)
    when = data.pop("when", None)
    for name in ("kind", "vehicles", "boxes", "lane", "at"):
        data.pop(name, None)
    words = [event.kind, *(f"{key} {_value(value)}" for key, value in data.items())]
    if when:
        words.append("when " + " and ".join(f"{key} {_value(value)}" for key, value in when.items()))
    return ", ".join(words)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(f"{key} {_value(inner)}" for key, inner in value.items())
    return f"{value:.3g}" if isinstance(value, float) else str(value)
