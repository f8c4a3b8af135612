"""A picture of what a scenario says: the road, the ego's path, what happens, and one seed's traffic.

It shows a scene of the seed's episode, usually the first, drawn as its frames are; the caption lists the
events by their numbers in the file, and says since when each is in effect, or why it is not, or why there is
nothing of it to be seen.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from rudc.drawing.caption import GAP, describe, probability, remark
from rudc.drawing.frames import draw_view
from rudc.drawing.map import finished, name_arms, new_map
from rudc.drawing.palette import EGO, EVENT_TEXT, FAINT_TEXT, TEXT, TRAFFIC
from rudc.drawing.picture_file import save_picture
from rudc.drawing.text import Line
from rudc.drawing.view import Driving, View, view_of
from rudc.network.network import load_network
from rudc.world.world import World

if TYPE_CHECKING:
    from rudc.scenario.model import Scenario

REACH_M = 70.0
"""m shown each way from the junction's centre, more where the ego or an event is farther out"""
AROUND_M = 8.0
"""m shown around those"""


def draw_preview(scenario: Scenario, seed: int, path: Path) -> Path:
    """Set up the seed's episode and draw its first scene to an image file. Errors: those of `World.reset`."""
    return save_picture(preview_picture(scenario, seed), path)


def preview_picture(scenario: Scenario, seed: int) -> Image.Image:
    """The picture itself. Errors: those of `World.reset`."""
    network = load_network(scenario.network, scenario.junction)
    with World(network) as world:
        world.reset(scenario.plan(seed))
        view = view_of(world)
    return picture_of(scenario, view)


def picture_of(scenario: Scenario, view: View) -> Image.Image:
    """The picture of a scene of an episode of the scenario."""
    network, reach = view.truth.network, _reach(view)
    canvas = new_map(network, reach).copy(shaded=view.sensors_limited)
    draw_view(canvas, view, Driving())
    name_arms(canvas, network, reach)
    return finished(canvas, reach, caption(scenario, view))


def _reach(view: View) -> float:
    """m to be shown each way from the junction's centre."""
    network, scene = view.truth.network, view.truth
    where = [scene.ego_position, *(np.array(place) for event in view.events for place in event.places)]
    where += [corner for event in view.events for piece in event.patch for corner in piece]
    where += [scene.position[i] for i, name in enumerate(scene.ids) if name in view.numbers]
    farthest = max(float(np.abs(place - network.center).max()) for place in where)
    return min(max(REACH_M, farthest + AROUND_M), max(network.half_extent, REACH_M))


def caption(scenario: Scenario, view: View) -> list[Line]:
    """What stands above the picture."""
    scene = view.truth
    route = f"ego (yellow) from {scene.route.origin} to {scene.route.destination}"
    before = scene.route.stop_line_s - scene.ego_s - 0.5 * scene.vehicle.length
    side = "before" if before >= 0.0 else "beyond"
    start = f"at {scene.ego.v:.1f} m/s, {abs(before):.0f} m {side} the stop line"
    time = f"{GAP}{scene.time_s:.1f} s after the start" if scene.time_s else ""
    time += f", {view.outcome.replace('_', ' ')}" if view.outcome else ""
    lines: list[Line] = [
        ((f"{scenario.name}{GAP}seed {view.seed}{time}", TEXT),),
        ((f"{route}, {start}", EGO),),
        ((others(view), TRAFFIC),),
    ]
    shown = {event.number: event for event in view.events}
    for number, event in enumerate(scenario.events, start=1):
        if number in shown:
            there, said = shown[number], remark(shown[number])
            text = describe(there.event) + (f" - {said}" if said else "")
            acts = not (there.waits or there.is_over)
        else:
            never = f"does not happen with this seed (probability {probability(event)})"
            text, acts = f"{event.kind.replace('_', ' ')} - {never}", False
        lines.append(((f"({number}) {text}", EVENT_TEXT if acts else FAINT_TEXT),))
    return lines


def others(view: View) -> str:
    """How many others there are, and how they are drawn."""
    numbered = "; orange and numbered: part of an event" if view.numbers else ""
    count = view.truth.count
    parts = [f"{count} other{'s' * (count != 1)} (blue{numbered})"]
    away = np.abs(view.truth.position - view.truth.network.center).max(axis=1, initial=0.0)
    if beyond := int((away > _reach(view)).sum()):
        parts.append(f"{beyond} of them beyond the picture's edges")
    if view.hidden:
        parts.append(f"{len(view.hidden)} hidden from the ego (pale)")
    if view.misplaced:
        parts.append("white outlines: where the ego's sensors show those whom they misplace")
    if any(event.patch for event in view.events):
        parts.append("orange stretch of a lane: slippery")
    return ", ".join(parts)
