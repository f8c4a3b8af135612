"""Networks for tests: four_way with other speed limits, arms of several edges, a two-lane roundabout."""

import re
import subprocess
from collections.abc import Callable
from itertools import cycle, pairwise
from pathlib import Path

import numpy as np

from rudc.network.build import build_network, find_netconvert
from rudc.network.network import shipped_networks

PIECES = {
    "east": (0.0, 15.0, 70.0, 150.0),
    "north": (0.0, 40.0, 150.0),
    "west": (0.0, 150.0),
    "south": (0.0, 60.0, 120.0),
}
"""m from the centre at which the edges of each arm meet"""
AWAY = {"east": (1, 0), "north": (0, 1), "west": (-1, 0), "south": (0, -1)}


def with_limits(folder: Path, limits: Callable[[str], float], node_type: str = "priority") -> Path:
    """four_way, with a limit (m/s) for each edge's name, and another type of junction."""
    text = shipped_networks()["four_way"].read_text(encoding="utf-8")
    edge, lines = "", []
    for line in text.splitlines():
        found = re.search(r'<edge id="([^"]+)"', line)
        edge = found.group(1) if found else edge
        if "<lane" in line:
            line = re.sub(r'speed="[0-9.]+"', f'speed="{limits(edge):.2f}"', line)
        lines.append(re.sub(r'(<junction id="centre" type=")\w+', rf"\g<1>{node_type}", line))
    path = folder / "limited.net.xml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def _built(folder: Path, name: str, nodes: list[str], edges: list[str]) -> Path:
    """The network of these nodes and edges, as netconvert reads them."""
    _write(folder, name, nodes, edges)
    return build_network(folder)


def _write(folder: Path, name: str, nodes: list[str], edges: list[str]) -> None:
    for ending, tag, parts in ((".nod.xml", "nodes", nodes), (".edg.xml", "edges", edges)):
        (folder / f"{name}{ending}").write_text(f"<{tag}>{''.join(parts)}</{tag}>", encoding="utf-8")


def bent(folder: Path, node_type: str = "priority") -> Path:
    """Four arms that meet at right angles; 30 m out the north arm bends by 60 degrees."""
    nodes = [f'<node id="centre" x="0" y="0" type="{node_type}"/>']
    edges = []
    for arm, (x, y) in AWAY.items():
        far = (86.6, 80.0) if arm == "north" else (130.0 * x, 130.0 * y)
        nodes.append(f'<node id="{arm}" x="{far[0]}" y="{far[1]}"/>')
        middle = f"{30 * x},{30 * y}"
        for way, start, end in (("in", arm, "centre"), ("out", "centre", arm)):
            shape = f"{far[0]},{far[1]} {middle} 0,0" if way == "in" else f"0,0 {middle} {far[0]},{far[1]}"
            edges.append(
                f'<edge id="{arm}_{way}" from="{start}" to="{end}" numLanes="1" speed="13.9" '
                f'priority="{2 if x else 1}" shape="{shape}"/>'
            )
    return _built(folder, "bent", nodes, edges)


def single_track(folder: Path) -> Path:
    """Three arms; on the west one both directions drive on the same 3.2 m."""
    nodes, edges = ['<node id="centre" x="0" y="0" type="priority"/>'], []
    for arm in ("east", "north", "west"):
        x, y = AWAY[arm]
        nodes.append(f'<node id="{arm}" x="{130 * x}" y="{130 * y}"/>')
        spread = "center" if arm == "west" else "right"
        edges += [
            f'<edge id="{arm}_{way}" from="{start}" to="{end}" speed="10" spreadType="{spread}"/>'
            for way, start, end in (("in", arm, "centre"), ("out", "centre", arm))
        ]
    _write(folder, "track", nodes, edges)
    net = folder / "track.net.xml"
    sources = ["-n", "track.nod.xml", "-e", "track.edg.xml", "-o", net.name]
    still = ["--offset.disable-normalization", "--geometry.avoid-overlap", "false"]
    subprocess.run([find_netconvert(), *sources, *still], cwd=folder, check=True, capture_output=True)
    return net


def by_heading(folder: Path) -> Path:
    """Arms to the north (150 m), south (60 m) and east, the first two with edges named by heading: what comes
    from the south is `north_in`, and its lane's id is the name of a lane of the north arm."""
    nodes, edges = ['<node id="centre" x="0" y="0" type="priority"/>'], []
    for arm, away, named in (("north", 150, "south"), ("south", 60, "north"), ("east", 150, "east")):
        x, y = AWAY[arm]
        other = {"north": "south", "south": "north"}.get(named, named)
        nodes.append(f'<node id="{arm}" x="{away * x}" y="{away * y}"/>')
        edges.append(f'<edge id="{named}_in" from="{arm}" to="centre" speed="10"/>')
        edges.append(f'<edge id="{other}_out" from="centre" to="{arm}" speed="10"/>')
    return _built(folder, "heading", nodes, edges)


def in_pieces(folder: Path) -> Path:
    """Four arms of several edges each, as imported maps have them, every one with another limit."""
    nodes = ['<node id="centre" x="0" y="0" type="priority"/>']
    edges, limits = [], cycle((5.0, 8.33, 13.9, 27.8))
    for arm, places in PIECES.items():
        names = ["centre", *(f"{arm}{i}" for i in range(1, len(places)))]
        for name, away in zip(names[1:], places[1:], strict=True):
            nodes.append(f'<node id="{name}" x="{AWAY[arm][0] * away}" y="{AWAY[arm][1] * away}"/>')
        for i, (inner, outer) in enumerate(pairwise(names)):
            for way, (start, end) in {"in": (outer, inner), "out": (inner, outer)}.items():
                edges.append(
                    f'<edge id="{arm}_{way}{i}" from="{start}" to="{end}" numLanes="1" '
                    f'speed="{next(limits)}" priority="{2 if AWAY[arm][0] else 1}"/>'
                )
    return _built(folder, "pieces", nodes, edges)


def with_pockets(folder: Path, lanes: int = 1, pocket: int = 1) -> Path:
    """Four arms of `lanes` each way; within 40 m of the junction `pocket` more lead in and one more out."""
    nodes, edges = ['<node id="centre" x="0" y="0" type="priority"/>'], []
    for arm, (x, y) in AWAY.items():
        nodes += [
            f'<node id="{arm}" x="{140 * x}" y="{140 * y}"/>',
            f'<node id="{arm}_widens" x="{40 * x}" y="{40 * y}"/>',
        ]
        for name, start, end, more in (
            ("in_far", arm, f"{arm}_widens", 0),
            ("in", f"{arm}_widens", "centre", pocket),
            ("out", "centre", f"{arm}_widens", 1),
            ("out_far", f"{arm}_widens", arm, 0),
        ):
            edges.append(
                f'<edge id="{arm}_{name}" from="{start}" to="{end}" numLanes="{lanes + more}" speed="13.9" '
                f'priority="{2 if x else 1}"/>'
            )
    return _built(folder, "pockets", nodes, edges)


def two_lane_ring(folder: Path, lanes: int = 1) -> Path:
    """A roundabout of radius 25 m with two lanes and four arms: if these have one, nobody turns into the
    inner lane."""
    names = list(AWAY)
    nodes, edges = [], []
    for k, arm in enumerate(names):
        x, y = AWAY[arm]
        nodes.append(f'<node id="{arm}" x="{25 * x}" y="{25 * y}" type="priority"/>')
        nodes.append(f'<node id="{arm}_far" x="{130 * x}" y="{130 * y}"/>')
        turn = np.linspace(k * np.pi / 2, (k + 1) * np.pi / 2, 12)
        arc = " ".join(f"{25 * np.cos(a):.2f},{25 * np.sin(a):.2f}" for a in turn)
        edges.append(
            f'<edge id="ring_{arm}" from="{arm}" to="{names[(k + 1) % 4]}" numLanes="2" speed="8" '
            f'priority="9" shape="{arc}"/>'
        )
        edges += [
            f'<edge id="{arm}_{way}" from="{start}" to="{end}" numLanes="{lanes}" speed="10" priority="1"/>'
            for way, start, end in (("in", f"{arm}_far", arm), ("out", arm, f"{arm}_far"))
        ]
    ring = " ".join(f"ring_{arm}" for arm in names)
    edges.append(f'<roundabout nodes="{" ".join(names)}" edges="{ring}"/>')
    return _built(folder, "ring", nodes, edges)
