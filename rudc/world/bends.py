"""Vehicles that SUMO drives slow down for bends as the road's grip asks.

SUMO knows no lateral grip: its vehicles drive a bend at their lane's limit, even on ice. So a lane whose
limit would take more than SHARE of the grip in its tightest bend, of radius R, gets a lower limit v:

    v^2 / R = SHARE * grip

No road has more grip than a dry one.

Limits are for all who drive on a lane: who has a speed factor f takes f^2 times SHARE.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rudc.network.paths import SPACING
from rudc.world.ego import DRY, GRAVITY

if TYPE_CHECKING:
    from collections.abc import Container, Mapping

    from rudc.network.network import Network
    from rudc.network.road import Lane
    from rudc.world.sumo import Sumo

SHARE = 0.75
"""of the grip, that a bend may take; as RUDC's ego plans (rudc/agents/adaptation.py)"""
OVER_M = 4.0
"""m of lane over which a bend is measured: lanes are drawn with corners"""


class Bends:
    """The lanes' limits in one episode."""

    def __init__(self, sumo: Sumo, network: Network) -> None:
        self._sumo, self._network = sumo, network
        self._curvature: dict[str, float] | None = None
        self._limits: dict[str, float] = {}

    def forget(self) -> None:
        """SUMO has loaded the network anew."""
        self._limits = {}

    def slow(self, grip: float, entered: Container[str] = ()) -> bool:
        """From now on the road allows `grip` m/s2 across a vehicle's direction, or as much as a dry road if
        that is less.

        `entered`: edges onto which a vehicle is about to come with a speed that their present limits allow;
        SUMO ends the simulation over one that comes faster, so these limits stay. Returns whether
        any limit stayed for that reason.
        """
        if self._curvature is None:
            self._curvature = curvatures(self._network)
        stay = False
        for name, most in limits_in_bends(self._curvature, min(grip, DRY * GRAVITY)).items():
            lane = self._network.lanes[name]
            limit = min(lane.speed, most)
            if limit < self.limit(lane) and lane.edge in entered:
                stay = True
            elif limit != self.limit(lane):
                self._limits[name] = limit
                self._sumo.limit_lane(name, limit)
        return stay

    def limit(self, lane: Lane) -> float:
        """m/s, the limit on a lane now."""
        return self._limits.get(lane.id, lane.speed)

    def edge_limit(self, edge: str) -> float:
        """m/s, the lowest limit among the lanes of an edge now."""
        return min(self.limit(lane) for lane in self._network.lanes.values() if lane.edge == edge)


def limits_in_bends(curvature: Mapping[str, float], grip: float) -> dict[str, float]:
    """m/s, what a road that gives `grip` m/s2 allows in the tightest bend of each lane (`curvatures`)."""
    return {name: math.sqrt(SHARE * grip / bend) for name, bend in curvature.items()}


def curvatures(network: Network) -> dict[str, float]:
    """1/m, the tightest bend of each lane that is not straight and that a way through the junction uses."""
    paths, half, found = network.paths, round(0.5 * OVER_M / SPACING), dict[str, float]()
    for row in range(paths.count):
        heading = np.pad(paths.heading[row], half, mode="edge")
        turned = np.abs(heading[2 * half :] - heading[: -2 * half])
        for name in paths.lane_ids[row]:
            if name in network.lanes:
                begin, end = (round(at / SPACING) for at in network.span(row, name))
                if end - begin > 2 * half + 2:  # else it is a short piece of a bend
                    begin, end = begin + half + 1, end - half - 1
                bend = float(turned[begin : max(end, begin) + 1].max()) / OVER_M
                found[name] = max(found.get(name, 0.0), bend)
    return {name: bend for name, bend in found.items() if bend > 0.0}
