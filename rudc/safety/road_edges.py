"""The barrier towards road edges: reference points on the ego's axis and their projections on the edges (see
road_points.py).
"""

from __future__ import annotations

import cmath
import math
from typing import Annotated, ClassVar, Literal

import numpy as np

from rudc.arrays import Array
from rudc.env.tracking import close_to_path
from rudc.network.paths import SPACING
from rudc.network.road_edges import BESIDE
from rudc.safety.barrier import STEP, BarrierSettings, Found
from rudc.safety.barrier_kernels import on_edges
from rudc.safety.clearance import Bodies, Clearance
from rudc.safety.road_points import NAMES, RoadPoints
from rudc.safety.rules import NotNegative
from rudc.settings import within
from rudc.world.scene import Scene


class RoadSettings(BarrierSettings):
    """Settings of the barrier towards road edges."""

    points: Literal["sliding", "fixed"] = "sliding"
    """whether a projection on the road's edge moves along with the ego (`sliding`, ours) or stands still
    (`fixed`, as in the paper)
    """
    d_safe: Annotated[NotNegative, within(0, 20, "wider than half a road it leaves no way")] = 0.2
    """m, buffer in addition to half the vehicle's width (dbar) (ours): a lane has no room for the buffer that
    is kept towards vehicles
    """


class RoadBarrier(Clearance):
    """The barrier towards the edges of the road along the ego's route. Keeps the reference points and
    edges of the last route.
    """

    name: ClassVar[str] = "road"
    at_work: ClassVar[bool] = True
    as_road: ClassVar[bool] = True
    inputs: ClassVar[tuple[str, ...]] = (
        "reference point",
        "buffer",
        "path's curvature * 10",
        "distance one step straight on / 20",
    )
    """the last one tells where the edge leads, since the row takes the edge for straight"""
    Settings: ClassVar[type[BarrierSettings]] = RoadSettings

    def __init__(self, settings: RoadSettings) -> None:
        self.settings = settings
        self._points: RoadPoints | None = None

    def find(self, scene: Scene) -> Found:
        """See `Barrier`: six points, left edge first."""
        points = self._points
        route, body = scene.route, scene.vehicle
        same = points is not None and (points.vehicle is body or points.vehicle == body)
        if points is None or points.route is not route or not same:
            points = self._points = RoadPoints(route, body)
        return Found(NAMES, data=points)

    def fill(self, scene: Scene, found: Found, to: Bodies) -> None:
        """See `Clearance`."""
        ego, points = scene.ego, found.data
        position, heading = complex(ego.x, ego.y), cmath.exp(1j * ego.psi)
        away = points.away(position, heading, scene.ego_s)
        motion = 0j if self.settings.points == "fixed" else ego.v * heading
        on_edges(
            away, points.offset, position, heading, motion,
            0.5 * scene.vehicle.width + self.settings.d_safe,
            to.position, to.velocity, to.direction, to.offset, to.margin,
        )  # fmt: skip

    def on_path(self, scene: Scene) -> Scene | None:
        """See `Barrier`: an ego that follows the path stays off the edges (rudc/network/road_edges.py), even
        where they bend or come nearer to the path before a corner. The rows take the edges for straight
        there. None with `points` fixed: the paper has no such exception.
        """
        settings = self.settings
        if settings.points == "fixed":
            return None
        return close_to_path(scene, max(BESIDE - settings.d_safe, 0.0))

    def features(self, scene: Scene, found: Found, part: Bodies, xi: Array) -> None:
        """See `Barrier`."""
        ego, path = scene.ego, scene.route.path
        heading = complex(math.cos(ego.psi), math.sin(ego.psi))
        at = min(max(int(scene.ego_s / SPACING), 0), len(path.curvature) - 1)
        xi[:, 8], xi[:, 9] = part.offset, part.margin
        xi[:, 10] = 10 * path.curvature[at]
        way = ego.v * STEP
        there = complex(ego.x, ego.y) + way * heading
        xi[:, 11] = np.abs(found.data.away(there, heading, scene.ego_s + way)) / 20
