"""What the ego's sensors show of the world, given occlusion by opaque boxes, Gaussian noise, missed
detections and limited range."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rudc.arrays import Array, Flags
from rudc.world.scene import Scene


@dataclass(slots=True)
class Sensors:
    """Flaws of the ego's perception; none by default."""

    occluders: Array = field(default_factory=lambda: np.zeros((0, 5)))
    """(K, 5) opaque boxes: centre x, y (m), heading (rad), length, width (m)"""
    position_std: float = 0.0
    """m"""
    speed_std: float = 0.0
    """m/s"""
    heading_std: float = 0.0
    """rad"""
    own_acceleration_std: float = 0.0
    """m/s2, of the ego's own acceleration"""
    miss: float = 0.0
    """probability that one of the others is not seen at a decision"""
    range_m: float = np.inf
    """m, others whose centre and corners are all farther away are not seen"""

    @property
    def perfect(self) -> bool:
        """Whether the ego perceives the world as it is."""
        noise = self.position_std, self.speed_std, self.heading_std, self.own_acceleration_std
        flawless = not any(noise) and self.miss == 0
        return flawless and not len(self.occluders) and self.range_m == np.inf

    def perceive(self, scene: Scene, rng: np.random.Generator) -> Scene:
        """The scene as the ego sees it; misses and noise are drawn from `rng`."""
        if self.perfect:
            return scene
        boxes = self.occluders if len(self.occluders) else None
        scene = replace(scene, hidden_by=boxes, sight_m=self.range_m)
        if scene.count:
            scene = self._others(scene, rng)
        if self.own_acceleration_std:
            measured = scene.ego.acceleration + self.own_acceleration_std * float(rng.standard_normal())
            scene = replace(scene, ego=replace(scene.ego, acceleration=measured))
        return scene

    def _others(self, scene: Scene, rng: np.random.Generator) -> Scene:
        """The scene with the others as the ego sees them."""
        seen = rng.random(scene.count) >= self.miss
        if self.range_m < np.inf or len(self.occluders):
            seen &= visible(scene, self.occluders, self.range_m)
        return self._noisy(scene.only(np.flatnonzero(seen)), rng)

    def _noisy(self, scene: Scene, rng: np.random.Generator) -> Scene:
        """The scene with noise, the others in the order of their distances as they seem."""
        n = scene.count
        shift = self.position_std * rng.standard_normal((n, 2))
        turn = self.heading_std * rng.standard_normal(n)
        faster = self.speed_std * rng.standard_normal(n)
        along = np.stack([np.cos(scene.heading), np.sin(scene.heading)], axis=1)
        noisy = replace(
            scene,
            position=scene.position + shift,
            heading=scene.heading + turn,
            velocity=scene.velocity + faster[:, None] * along,
            path_s=scene.path_s + np.einsum("ij,ij->i", shift, along),
        )
        return noisy.nearest_first()


def visible(scene: Scene, occluders: Array, range_m: float = np.inf) -> Flags:
    """(N,) whether the ego sees the centre or a corner of each of the others from its own centre: at most
    `range_m` m away, with none of the boxes (K, 5) on the straight line to it."""
    along = 0.5 * scene.size[:, :1] * np.stack([np.cos(scene.heading), np.sin(scene.heading)], axis=1)
    across = 0.5 * scene.size[:, 1:] * np.stack([-np.sin(scene.heading), np.cos(scene.heading)], axis=1)
    signs = np.array([(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)])
    points = scene.position[:, None] + signs[:, :1] * along[:, None] + signs[:, 1:] * across[:, None]
    eye = scene.ego.x, scene.ego.y
    near = np.hypot(points[..., 0] - eye[0], points[..., 1] - eye[1]) <= range_m
    return np.any(near & in_sight(eye, points, occluders), axis=1)


def in_sight(eye: tuple[float, float], points: Array, occluders: Array) -> Flags:
    """(...) whether the line from the eye (m, m) to each of the points (..., 2) m meets none of the boxes
    (K, 5).
    """
    start = np.array(eye)
    clear = np.ones(points.shape[:-1], dtype=bool)
    for x, y, heading, length, width in occluders:
        rotation = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        a = rotation @ (start - (x, y))
        b = (points - (x, y)) @ rotation.T
        clear &= ~_segment_meets_box(a, b, 0.5 * np.array([length, width]))
    return clear


def _segment_meets_box(a: Array, b: Array, half: Array) -> Flags:
    """Whether segments from a (2,) to b (..., 2) meet the box |x| <= half[0], |y| <= half[1] (slab
    method)."""
    step = b - a
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    first, second = (-half - a) / step, (half - a) / step
    enter = np.minimum(first, second).max(axis=-1)
    leave = np.maximum(first, second).min(axis=-1)
    return np.logical_and.reduce([enter <= leave, leave >= 0, enter <= 1])
