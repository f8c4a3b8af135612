"""Networks and scenarios that nobody has chosen: what drivers do where all is left to chance.

    python -m tests.benchmarks.by_chance DIR [--networks 100] [--first 0] [--roundabouts]
    cd DIR; rudc sweep *.yaml --agent rudc-t --agent planner --episodes 1 --out ../driven

Each network is a junction of three to five arms at any angles, of other widths, bends, lanes, speeds and
rules of right of way, made by SUMO's netconvert (extra `networks`); with `--roundabouts` a roundabout of so
many arms, of one or two lanes and 10 to 25 m in radius. On each drive four scenarios, with
any traffic and one to three of the events that RUDC knows, drawn alike. A network and its scenarios come
from their number alone. What `rudc scenario validate` refuses is not written, and counted at the end.

Nothing sees to it that a scenario can be won: bodies close whole roads. So a rate says little by itself; it
is compared between agents, on numbers that nobody has looked at.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml

from rudc.errors import RudcError
from rudc.evaluation.preflight import validated
from rudc.network.build import build_network

EACH = 4
"""scenarios on a network"""
LEAST_ANGLE = 38.0
"""deg between neighbouring arms"""
RULES = ("priority", "priority", "priority", "priority_stop", "right_before_left", "allway_stop")
KINDS = ("car", "truck", "bus", "motorcycle", "bicycle")
PIECES = 8
"""straight pieces of an arm that bends"""

Event = dict[str, Any]
Maker = Callable[[random.Random, Path], Path]


def write_network(rng: random.Random, folder: Path) -> Path:
    """FOLDER/NAME.net.xml, of its nodes and edges beside it, NAME being the folder's."""
    angles = _angles(rng, rng.choice((3, 3, 4, 4, 4, 5)))
    major = _straightest(angles)
    nodes = [f'<node id="centre" x="0" y="0" type="{rng.choice(RULES)}" radius="{rng.uniform(3, 12):.1f}"/>']
    edges = list[str]()
    for i, angle in enumerate(angles):
        length, bend = rng.uniform(70, 160), rng.choice((0.0, 0.0, rng.uniform(-12, 12)))
        towards = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        end, middle = _at(towards, length, 0.0), _at(towards, 0.5 * length, bend)
        nodes.append(f'<node id="end{i}" x="{end[0]:.1f}" y="{end[1]:.1f}"/>')
        alike = (
            f'numLanes="{rng.choice((1, 1, 2))}" width="{rng.choice((2.8, 3.0, 3.2, 3.5, 3.75))}" '
            f'speed="{rng.choice((8.33, 8.33, 11.11, 13.89, 13.89, 16.67))}" '
            f'priority="{3 if i in major else 1}"'
        )
        way = [_on_the_bend(end, middle, k / PIECES) for k in range(PIECES + 1)]
        for edge, ends, points in (
            (f"in{i}", f'from="end{i}" to="centre"', way),
            (f"out{i}", f'from="centre" to="end{i}"', way[::-1]),
        ):
            shape = " ".join(f"{x:.2f},{y:.2f}" for x, y in points)
            edges.append(f'<edge id="{edge}" {ends} {alike} shape="{shape}"/>')
    return _built(folder, nodes, edges)


def write_roundabout(rng: random.Random, folder: Path) -> Path:
    """FOLDER/NAME.net.xml of a roundabout, as `write_network`."""
    angles = _angles(rng, rng.choice((3, 4, 4, 5)))
    radius, lanes = rng.uniform(10, 25), rng.choice((1, 1, 2))
    speed = f'speed="{rng.uniform(6, 9):.2f}"'
    ring = f'numLanes="{lanes}" width="{rng.choice((3.5, 4.0, 4.5))}" {speed} priority="3"'
    nodes, edges, around = list[str](), list[str](), list[str]()
    for i, angle in enumerate(angles):
        towards = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        (x, y), (far_x, far_y) = _at(towards, radius, 0.0), _at(towards, radius + rng.uniform(70, 140), 0.0)
        nodes.append(f'<node id="ring{i}" x="{x:.2f}" y="{y:.2f}" type="priority"/>')
        nodes.append(f'<node id="end{i}" x="{far_x:.2f}" y="{far_y:.2f}"/>')
        alike = (
            f'numLanes="{rng.choice((1, lanes))}" width="{rng.choice((3.0, 3.2, 3.5, 3.75))}" '
            f'speed="{rng.choice((8.33, 11.11, 13.89, 13.89))}" priority="1"'
        )
        edges.append(f'<edge id="in{i}" from="end{i}" to="ring{i}" {alike}/>')
        edges.append(f'<edge id="out{i}" from="ring{i}" to="end{i}" {alike}/>')
        after = (i + 1) % len(angles)
        turn = (angles[after] - angle) % 360
        points = (math.radians(angle + turn * k / PIECES) for k in range(PIECES + 1))
        shape = " ".join(f"{radius * math.cos(at):.2f},{radius * math.sin(at):.2f}" for at in points)
        around.append(f"ring{i}_{after}")
        edges.append(f'<edge id="{around[-1]}" from="ring{i}" to="ring{after}" {ring} shape="{shape}"/>')
    named = " ".join(f"ring{i}" for i in range(len(angles)))
    edges.append(f'<roundabout nodes="{named}" edges="{" ".join(around)}"/>')
    return _built(folder, nodes, edges)


def _built(folder: Path, nodes: list[str], edges: list[str]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for kind, tag, lines in (("nod", "nodes", nodes), ("edg", "edges", edges)):
        text = "\n".join([f"<{tag}>", *lines, f"</{tag}>", ""])
        (folder / f"{folder.name}.{kind}.xml").write_text(text, encoding="utf-8")
    return build_network(folder)


def scenario(rng: random.Random, name: str, network: str) -> dict[str, Any]:
    """What stands in a scenario's file."""
    mix = {"car": 1.0}
    if rng.random() < 0.5:
        mix = {"car": 0.6, "truck": _any(rng, 0, 0.2), "bus": _any(rng, 0, 0.1)}
        mix |= {"motorcycle": _any(rng, 0, 0.2), "bicycle": _any(rng, 0, 0.2)}
    turn = rng.choice(("left", "right", "straight", "random"))
    return {
        "name": name,
        "network": network,
        "ego": {
            "route": {"from": "random", "turn": turn},
            "speed": {"uniform": [5, 9]},
            "distance": {"uniform": [32, 55]},
            "may_cross_centre": True,
        },
        "traffic": {"density": _any(rng, 8, 28), "mix": mix, "impatience": _any(rng, 0.2, 0.9)},
        "events": [rng.choice(EVENTS)(rng) for _ in range(rng.choice((1, 1, 2, 2, 3)))],
        "episode": {"timeout": 60},
    }


def _accident(rng: random.Random) -> Event:
    kind = rng.choice(KINDS)
    if rng.random() < 0.5:
        inside = {"position": [_any(rng, -7, 7), _any(rng, -7, 7)], "heading": _any(rng, -180, 180)}
        return {"kind": "accident", "vehicles": [{**inside, "type": kind}]}
    askew = {"heading_offset": _any(rng, -40, 40), "lateral": _any(rng, -1.5, 0.5)}
    return {"kind": "accident", "vehicles": [{**_lane(rng, 8, 28), **askew, "type": kind}]}


def _stalled(rng: random.Random) -> Event:
    if rng.random() < 0.5:
        return {"kind": "stalled_vehicle", **_lane(rng, 6, 25), "type": rng.choice(KINDS)}
    return {"kind": "stalled_vehicle", "vehicle": _whom(rng), "when": _near(rng)}


def _closure(rng: random.Random) -> Event:
    return {"kind": "lane_closure", **_lane(rng, 8, 20), "length": _any(rng, 4, 15)}


def _hard_brake(rng: random.Random) -> Event:
    strength = {"deceleration": _any(rng, 5, 9), "duration": _any(rng, 1, 6)}
    return {"kind": "hard_brake", "vehicle": _whom(rng), **strength, "when": _near(rng)}


def _violation(rng: random.Random) -> Event:
    who = rng.choice(("crossing", "oncoming"))
    return {"kind": "priority_violation", "vehicle": who, "duration": _any(rng, 4, 12), "when": _near(rng)}


def _speeding(rng: random.Random) -> Event:
    who = rng.choice(("crossing", "oncoming"))
    return {"kind": "speeding", "vehicle": who, "factor": _any(rng, 1.2, 2), "when": _near(rng)}


def _slow(rng: random.Random) -> Event:
    return {"kind": "slow_vehicle", "vehicle": _whom(rng), "speed": _any(rng, 1, 5)}


def _wrong_way(rng: random.Random) -> Event:
    how = {"at": _any(rng, 20, 50), "speed": _any(rng, 2, 8), "type": rng.choice(("car", *KINDS[3:]))}
    return {"kind": "wrong_way", "lane": "ego_out", **how, "when": _in_time(rng)}


def _pedestrians(rng: random.Random) -> Event:
    return {"kind": "pedestrian_crossing", **_across(rng, 0.8, 2.5), "count": rng.randint(1, 6)}


def _riders(rng: random.Random) -> Event:
    who = {"type": rng.choice(KINDS[3:]), "count": rng.randint(1, 3)}
    return {"kind": "vehicle_crossing", **_across(rng, 3, 6), **who}


def _occlusion(rng: random.Random) -> Event:
    boxes = [
        {"position": [_any(rng, -20, 20), _any(rng, -20, 20)], "heading": _any(rng, -90, 90),
         "size": [_any(rng, 4, 15), _any(rng, 2, 8)]}
        for _ in range(rng.randint(1, 3))
    ]  # fmt: skip
    return {"kind": "occlusion", "boxes": boxes}


def _noise(rng: random.Random) -> Event:
    others = {"position": _any(rng, 0.1, 0.6), "speed": _any(rng, 0.1, 0.8), "heading": _any(rng, 1, 6)}
    return {"kind": "sensor_noise", **others, "own_acceleration": 0.15}


def _dropout(rng: random.Random) -> Event:
    return {"kind": "sensor_dropout", "probability": _any(rng, 0.05, 0.4), "range": _any(rng, 25, 60)}


def _friction(rng: random.Random) -> Event:
    return {"kind": "low_friction", "friction": _any(rng, 0.15, 0.6)} | _now_or_later(rng)


def _delay(rng: random.Random) -> Event:
    late = {"delay": _any(rng, 0.05, 0.3), "lag": _any(rng, 0, 0.3)}
    return {"kind": "actuator_delay", **late} | _now_or_later(rng)


def _surge(rng: random.Random) -> Event:
    return {"kind": "density_surge", "density": _any(rng, 25, 45), "when": _near(rng)}


EVENTS: tuple[Callable[[random.Random], Event], ...] = (
    _accident, _stalled, _closure, _hard_brake, _violation, _speeding, _slow, _wrong_way, _pedestrians,
    _riders, _occlusion, _noise, _dropout, _friction, _delay, _surge,
)  # fmt: skip


def _any(rng: random.Random, low: float, high: float) -> float:
    return round(rng.uniform(low, high), 2)


def _whom(rng: random.Random) -> str:
    return rng.choice(("leader", "oncoming", "crossing", "nearest", "follower"))


def _lane(rng: random.Random, low: float, high: float) -> Event:
    return {"lane": rng.choice(("ego_in", "ego_out")), "at": _any(rng, low, high)}


def _across(rng: random.Random, low: float, high: float) -> Event:
    side, arm = rng.choice(("left", "right")), rng.choice(("ego_in", "ego_out"))
    how = {"at": _any(rng, 2, 12), "speed": _any(rng, low, high), "from_side": side}
    return {"arm": arm, **how, "when": _in_time(rng)}


def _near(rng: random.Random) -> Event:
    return {"ego_distance_to_junction": {"below": _any(rng, 3, 30)}}


def _in_time(rng: random.Random) -> Event:
    """For what is not to appear where the ego cannot stop any more."""
    return {"ego_distance_to_junction": {"below": _any(rng, 26, 40)}}


def _now_or_later(rng: random.Random) -> Event:
    return {"when": _near(rng)} if rng.random() < 0.5 else {}


def _angles(rng: random.Random, number: int) -> list[float]:
    """(number) deg, directions of arms."""
    while True:
        angles = sorted(rng.uniform(0, 360) for _ in range(number))
        between = [(angles[(i + 1) % number] - angles[i]) % 360 for i in range(number)]
        if min(between) > LEAST_ANGLE:
            return angles


def _straightest(angles: list[float]) -> tuple[int, int]:
    """The two arms that are most nearly one road."""
    pairs = ((i, j) for i in range(len(angles)) for j in range(i))
    return min(pairs, key=lambda pair: abs(180 - abs(angles[pair[0]] - angles[pair[1]])))


def _at(towards: tuple[float, float], far: float, beside: float) -> tuple[float, float]:
    return far * towards[0] - beside * towards[1], far * towards[1] + beside * towards[0]


def _on_the_bend(end: tuple[float, float], middle: tuple[float, float], t: float) -> tuple[float, float]:
    """A point of the curve (quadratic, by Bezier) from the arm's end, pulled to its middle, to the centre."""
    x, y = ((1 - t) ** 2 * e + 2 * t * (1 - t) * m for e, m in zip(end, middle, strict=True))
    return x, y


def write(folder: Path, numbers: range, make: Maker = write_network) -> Iterator[tuple[Path, list[str]]]:
    """Each scenario's file, and why it is refused: such a file is removed again."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        rng = random.Random(number)
        network = make(rng, folder / f"network{number:05d}").relative_to(folder).as_posix()
        for which in range(EACH):
            name = f"chance{number:05d}_{which}"
            path = folder / f"{name}.yaml"
            path.write_text(yaml.safe_dump(scenario(rng, name, network), sort_keys=False), "utf-8")
            wrong = validated(path)[1]
            if wrong:
                path.unlink()
            yield path, wrong


def main() -> int:
    """Write them; the exit status."""
    parser = argparse.ArgumentParser(description="Networks and scenarios made by chance.")
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--networks", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--roundabouts", action="store_true")
    asked = parser.parse_args()
    numbers = range(asked.first, asked.first + asked.networks)
    make = write_roundabout if asked.roundabouts else write_network
    written = refused = 0
    try:
        for _, wrong in write(asked.folder, numbers, make):
            written, refused = written + (not wrong), refused + bool(wrong)
    except (RudcError, OSError) as error:
        parser.exit(2, f"{error}\n")
    print(f"{written} scenarios on {asked.networks} networks in {asked.folder}; {refused} refused")
    return 0


if __name__ == "__main__":
    sys.exit(main())
