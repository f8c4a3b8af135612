"""Every decision of an episode as a row of a CSV file: what was proposed, what was done, what it led to."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rudc.agents.conduct import Conduct
from rudc.evaluation.record import as_text
from rudc.evaluation.store import format_row
from rudc.files import make_folder_of, write_atomically

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.env.episode import StepResult
    from rudc.vehicle import Actuation
    from rudc.world.config import EgoDriver
    from rudc.world.scene import Scene


class Trace:
    """Keeps the decisions of one episode; `watch` is for `run_episode`."""

    def __init__(self, ego_driver: EgoDriver = "agent") -> None:
        """`ego_driver`: who drives the ego. If SUMO does, there are no commands: their cells stay empty."""
        self._ego_driver = ego_driver
        self._rows: list[dict[str, object]] = []
        self._conduct = Conduct()

    def watch(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Keep a decision: the scene it was taken in, and what came of it."""
        ego, corrected = scene.ego, decision.corrected
        x, y = (scene.ego_position - scene.network.center).tolist()
        unsure, by_route = decision.uncertainty, decision.by_route
        commands = np.append(decision.u_rl, decision.u)
        if self._ego_driver == "sumo":
            commands = np.full(4, math.nan)
        unusual = np.flatnonzero(self._conduct.look(scene)).tolist()
        row: dict[str, object] = {
            "time_s": scene.time_s,
            "x_m": x,
            "y_m": y,
            "heading_rad": ego.psi,
            "speed_mps": ego.v,
            "ego_acceleration_mps2": ego.acceleration,
            "route_s_m": scene.ego_s,
            "route_offset_m": scene.ego_offset,
            "proposed_acceleration_mps2": commands[0],
            "proposed_steering_rad": commands[1],
            "acceleration_mps2": commands[2],
            "steering_rad": commands[3],
            "sigma": decision.sigma,
            "sigma_epi": float(unsure.epistemic) if unsure else math.nan,
            "sigma_ale": float(unsure.aleatoric) if unsure else math.nan,
            "sigma_total": float(unsure.total) if unsure else math.nan,
            "sigma_by_route": float(by_route.total) if by_route else math.nan,
            "slack": corrected.slack if corrected else math.nan,
            "filter_status": corrected.status if corrected else "",
            "filter_active": " ".join(corrected.active) if corrected else "",
            "filter_least_h_m2": float(np.min(corrected.h)) if corrected and len(corrected.h) else math.nan,
            "filter_violation": corrected.violation if corrected else math.nan,
            "filter_optimality_gap": corrected.optimality_gap if corrected else math.nan,
            "filter_ms": corrected.solve_ms if corrected else math.nan,
            **_car("", decision.plant.actuation if decision.plant else None),
            **_car("true_", scene.actuation),
            "asks_grip": decision.asks_grip,
            "unusual": " ".join(scene.ids[i] for i in unusual),
            "gap_m": result.advance.min_dtc_m,
            "reward": result.reward,
            "cost": result.cost,
            "events": " ".join(result.advance.events),
        }
        row |= {f"reward_{name}": value for name, value in result.terms.items()}
        self._rows.append(row)

    def save(self, path: Path) -> None:
        """Write the rows. Raises InputError for a folder that cannot be made, StorageError."""
        columns = list(dict.fromkeys(name for row in self._rows for name in row))
        lines = [columns, *([_cell(row.get(name)) for name in columns] for row in self._rows)]
        make_folder_of(path)
        write_atomically(path, "".join(map(format_row, lines)))


def _car(prefix: str, car: Actuation | None) -> dict[str, float | None]:
    """Friction, dead time and lag of the car, as identified or as it is; None for what is not known."""
    parts = (None, None, None) if car is None else (car.friction, car.delay_s, car.lag_s)
    return dict(zip((f"{prefix}friction", f"{prefix}delay_s", f"{prefix}lag_s"), parts, strict=True))


def _cell(value: object) -> str:
    """A number to six decimals, anything else as text."""
    if isinstance(value, float):
        return as_text(round(float(value), 6)) if math.isfinite(value) else ""
    return as_text(value)
