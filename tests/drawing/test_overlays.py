"""The shade behind boxes is what the sensors do not see."""

import dataclasses

import numpy as np

from rudc.drawing.overlays import shadow
from rudc.geometry import rectangle_corners
from rudc.network.polyline import inside
from rudc.world.perception import visible


def test_shadows_hide_what_the_sensors_miss(make_scene):
    rng = np.random.default_rng(0)
    scene = make_scene(others=[(-1, (0.0, 0.0, 0.0), 0.0, 0.0)], size=(0.01, 0.01))
    places = scene.ego_position + rng.uniform(-25, 25, (40, 2))
    boxes = np.column_stack([places, rng.uniform(-3, 3, 40), rng.uniform(2, 15, (40, 2))])
    tried = hidden = 0
    for box in boxes:
        eye = scene.ego_position
        corners = rectangle_corners(box[:2], box[2], box[3:])
        if inside(corners, eye[None]).any():
            continue
        shade = shadow(eye, corners)
        for point in eye + rng.uniform(-120, 120, (25, 2)):
            seen = bool(visible(dataclasses.replace(scene, position=point[None]), box[None])[0])
            covered = bool(inside(shade, point[None])[0] or inside(corners, point[None])[0])
            tried, hidden = tried + 1, hidden + covered
            assert covered == (not seen)
    assert tried > 800
    assert hidden > 40
