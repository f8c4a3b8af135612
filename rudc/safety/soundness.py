"""Whether the filter can use a scene: one that somebody made may have arrays of other shapes or types.

Compiled code looks at no shape, so it would read what is not there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rudc.errors import SolverError
from rudc.safety.kernels import all_sound

if TYPE_CHECKING:
    from rudc.world.scene import Scene

PAIRS, NUMBERS, WHOLE = (
    ("position", "velocity", "size"),
    ("heading", "path_s", "acceleration"),
    ("path", "kind"),
)
"""arrays of a scene that the filter reads: (N, 2) and (N,) of floats, (N,) of whole numbers"""


def refuse_unsound(scene: Scene) -> None:
    """Raise SolverError, which names the field, if the arrays of a scene do not fit together, or a number
    that the filter uses is not finite or cannot be.
    """
    ego = scene.ego
    if not math.isfinite(ego.x + ego.y + ego.psi + ego.v + scene.ego_s):
        raise SolverError(f"the filter was given an ego state that is not finite: {ego}")
    position, heading, velocity, size = scene.position, scene.heading, scene.velocity, scene.size
    path, path_s, rows = scene.path, scene.path_s, scene.network.paths.count
    pairs, one = (count := len(scene.ids), 2), (count,)
    fits = (
        position.shape == velocity.shape == size.shape == pairs
        and heading.shape == path_s.shape == scene.acceleration.shape == path.shape == scene.kind.shape == one
        and position.dtype == velocity.dtype == size.dtype == heading.dtype == np.float64
        and path_s.dtype == scene.acceleration.dtype == np.float64
        and path.dtype == scene.kind.dtype == np.int64
    )
    if fits and all_sound(position, heading, velocity, path_s, scene.acceleration, size, path, rows):
        return
    wanted = dict.fromkeys(PAIRS, (pairs, np.float64))
    wanted |= dict.fromkeys(NUMBERS, (one, np.float64)) | dict.fromkeys(WHOLE, (one, np.int64))
    for name, (shape, dtype) in wanted.items():
        array = getattr(scene, name)
        if array.shape != shape or array.dtype != dtype:
            raise SolverError(
                f"the filter was given a scene of {count} others (ids) whose {name} has shape {array.shape} "
                f"and type {array.dtype}; it must have shape {shape} and type {np.dtype(dtype)}"
            )
        if not np.isfinite(array).all():
            raise SolverError(f"the filter was given a scene whose {name} is not finite")
    if not (size > 0.0).all():
        raise SolverError("the filter was given a scene with a length or width that is not above 0 m")
    raise SolverError(
        f"the filter was given a scene whose path is not -1 to {rows - 1}, rows of network.paths"
    )
