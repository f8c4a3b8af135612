"""One cause at a time, up to the numbers that scenario files allow: what breaks a driver, and where.

    python -m tests.benchmarks.one_cause DIR
    cd DIR; rudc sweep *.yaml --agent rudc-t --agent planner --episodes 4 --seed 870000 --out ../driven

Each file has one event (or traffic, or a start) at one strength and a random route, and is swept over the
shipped networks. Not all can be won: where grip falls to 0.06 shortly before a bend, or the leader on a road
with one lane stops for good, nobody arrives. So a rate says little by itself; what counts is which files
fail, and whether they should.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

NETWORKS = ["four_way", "four_way_equal", "roundabout", "skewed_four_way", "t_junction"]
VEHICLES = ("leader", "follower", "oncoming", "crossing", "nearest", "all")


def before_junction(metres: float) -> dict[str, Any]:
    """The trigger that the ego is nearer than that to its stop line; beyond it if negative."""
    return {"ego_distance_to_junction": {"below": metres}}


def causes() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name of each, and what its file says besides route and networks."""
    for name, event in (*_car(), *_sensors(), *_vehicles(), *_crossing()):
        yield name, {"events": [event]}
    for name, event in _in_lanes():
        yield name, {"events": [event], "ego": {"may_cross_centre": True}}
    yield from _traffic()


def _car() -> Iterator[tuple[str, dict[str, Any]]]:
    for delay in (0.3, 0.8, 1.5):
        yield f"delay_{delay}", {"kind": "actuator_delay", "delay": delay}
    for lag in (0.5, 1.0, 2.0, 3.0):
        yield f"lag_{lag}", {"kind": "actuator_delay", "lag": lag}
    yield "delay_and_lag", {"kind": "actuator_delay", "delay": 0.5, "lag": 1.0}
    late = {"kind": "actuator_delay", "delay": 0.8, "lag": 0.5}
    yield "delay_and_lag_late", {**late, "when": before_junction(25)}
    for friction in (0.03, 0.06, 0.15, 0.25, 0.4, 0.55, 0.65, 0.75):
        yield f"grip_{friction}", {"kind": "low_friction", "friction": friction}
    for friction in (0.06, 0.15, 0.3):
        event = {"kind": "low_friction", "friction": friction}
        yield f"grip_{friction}_before", {**event, "when": before_junction(15)}
        yield f"grip_{friction}_inside", {**event, "when": before_junction(-2)}


def _sensors() -> Iterator[tuple[str, dict[str, Any]]]:
    for key, sizes in {
        "position": (1, 2, 4),
        "speed": (2, 4),
        "heading": (20, 60),
        "own_acceleration": (3,),
    }.items():
        for size in sizes:
            yield f"noise_{key}_{size}", {"kind": "sensor_noise", key: size}
    all_of_them = {"position": 1.5, "speed": 2, "heading": 15, "own_acceleration": 1}
    yield "noise_all", {"kind": "sensor_noise", **all_of_them}
    for share in (0.3, 0.6, 0.9):
        yield f"dropout_{share}", {"kind": "sensor_dropout", "probability": share}
    yield "blind", {"kind": "sensor_dropout", "probability": 1, "duration": 4, "when": before_junction(20)}
    for metres in (5, 12, 20):
        yield f"range_{metres}", {"kind": "sensor_dropout", "range": metres}


def _vehicles() -> Iterator[tuple[str, dict[str, Any]]]:
    for vehicle in VEHICLES:
        brake = {"kind": "hard_brake", "vehicle": vehicle, "deceleration": 9}
        yield f"brakes_{vehicle}", {**brake, "when": before_junction(20)}
        slow = {"kind": "slow_vehicle", "vehicle": vehicle, "speed": 2}
        yield f"crawls_{vehicle}", {**slow, "when": before_junction(25)}
        heedless = {"kind": "priority_violation", "vehicle": vehicle}
        yield f"heedless_{vehicle}", {**heedless, "when": before_junction(30)}
        yield f"speeds_{vehicle}", {"kind": "speeding", "vehicle": vehicle, "factor": 2}
        stalled = {"kind": "stalled_vehicle", "vehicle": vehicle}
        yield f"stalls_{vehicle}", {**stalled, "when": before_junction(20)}


def _crossing() -> Iterator[tuple[str, dict[str, Any]]]:
    for arm in ("ego_in", "ego_out"):
        for at in (3, 15):
            place = {"arm": arm, "at": at}
            for side in ("left", "right"):
                walk = {"kind": "pedestrian_crossing", **place, "count": 3, "from_side": side}
                yield f"walk_{arm}_{at}_{side}", {**walk, "when": before_junction(25)}
            run = {"kind": "pedestrian_crossing", **place, "count": 2, "speed": 5}
            yield f"run_{arm}_{at}", {**run, "when": before_junction(25)}
            for kind, count, speed, beyond in (
                ("truck", 1, 4, 4),
                ("motorcycle", 1, 10, 0),
                ("bicycle", 4, 5, 0),
            ):
                ride = {"kind": "vehicle_crossing", "arm": arm, "at": at + beyond, "type": kind}
                ride |= {"count": count, "speed": speed}
                yield f"{kind}_{arm}_{at}", {**ride, "when": before_junction(30)}


def _in_lanes() -> Iterator[tuple[str, dict[str, Any]]]:
    """Where the ego may cross the centre line, so that one lane is enough to get past."""
    for lane in ("ego_in", "ego_out"):
        for at in (4, 14):
            place = {"lane": lane, "at": at}
            for body, more in {
                "car": {},
                "truck": {"type": "truck"},
                "kerb": {"lateral": -1.2},
                "centre": {"lateral": 1.4},
                "slant": {"heading_offset": 40},
                "across": {"heading_offset": 90},
            }.items():
                crash = {"kind": "accident", "vehicles": [{**place, **more}]}
                yield f"crash_{body}_{lane}_{at}", crash
            closed = {"kind": "lane_closure", **place, "length": 6}
            yield f"closed_{lane}_{at}", closed
            yield f"closed_late_{lane}_{at}", {**closed, "when": before_junction(45)}
        for friction in (0.1, 0.3):
            oil = {"kind": "slippery_patch", "lane": lane, "at": 2, "length": 12, "friction": friction}
            yield f"oil_{lane}_{friction}", oil
        box = {"lane": lane, "at": 12, "lateral": -7.0, "size": [14, 3]}
        yield f"hidden_{lane}", {"kind": "occlusion", "boxes": [box]}
    for body, speed in (("car", 6), ("truck", 4), ("bicycle", 4), ("motorcycle", 12)):
        ghost = {"kind": "wrong_way", "type": body, "speed": speed}
        yield f"wrong_way_{body}_out", {**ghost, "lane": "ego_out", "at": 45, "when": before_junction(30)}
        yield f"wrong_way_{body}_in", {**ghost, "lane": "ego_in", "at": 3, "when": before_junction(60)}


def _traffic() -> Iterator[tuple[str, dict[str, Any]]]:
    surge = {"kind": "density_surge", "density": 90, "when": before_junction(30)}
    yield "surge", {"events": [surge]}
    for name, traffic in {
        "dense": {"density": 60},
        "lorries": {"density": 25, "mix": {"truck": 1, "bus": 1}},
        "bicycles": {"density": 25, "mix": {"bicycle": 1}},
        "motorcycles": {"density": 25, "mix": {"motorcycle": 1}, "speed_factor": 1.3},
        "polite": {"density": 30, "impatience": 0, "minor_gap": 2},
        "pushy": {"density": 30, "impatience": 1, "minor_gap": 0.2, "idm": {"headway": 0.4, "min_gap": 1.0}},
        "fast": {"density": 15, "speed_factor": 1.8},
        "slow": {"density": 25, "speed_factor": 0.4},
    }.items():
        yield name, {"traffic": traffic}
    for name, speed, distance in (("start_fast", 16, 40), ("start_near", 8, 12), ("start_from_rest", 0, 5)):
        yield name, {"ego": {"speed": speed, "distance": distance}}


def write(folder: Path) -> list[Path]:
    """Write a scenario file for each cause into a folder, which is made. Returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, says in causes():
        data = {"name": name.replace(".", "_"), "network": NETWORKS[0], "traffic": {"density": 20}, **says}
        data["ego"] = {"route": "random", **says.get("ego", {})}
        data["sweep"] = {"network": NETWORKS}
        path = folder / f"{data['name']}.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        files.append(path)
    return files


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m tests.benchmarks.one_cause DIR")
    print(f"{len(write(Path(sys.argv[1])))} scenarios in {sys.argv[1]}")
