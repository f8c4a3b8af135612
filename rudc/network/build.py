"""Builds a .net.xml with SUMO's netconvert, from plain sources or an OpenStreetMap map: the same sources
always give the same file.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from rudc.errors import NetworkError
from rudc.files import check_place, make_folder_of, write_atomically
from rudc.hints import install_command, listed

SOURCES = {".nod.xml": "--node-files", ".edg.xml": "--edge-files"}
"""files that a network needs, with netconvert's option for each"""
MORE_SOURCES = {".con.xml": "--connection-files", ".typ.xml": "--type-files", ".tll.xml": "--tllogic-files"}
"""files that a network may have besides, with netconvert's option for each"""
OSM = ".osm"
"""ending of an OpenStreetMap file"""
SIGNS = {
    "traffic_signals": "lights are taken away, and the junction has none",
    "stop": "who goes first is netconvert's guess from the types of the roads",
    "give_way": "who goes first is netconvert's guess from the types of the roads",
    "mini_roundabout": "it becomes a plain junction",
}
"""`highway=...` of a map's nodes -> what becomes of it"""
ON_FOOT = "footway", "cycleway", "path", "steps", "pedestrian", "bridleway", "corridor", "track"
"""ways of a map that are left out, since no car drives on them"""
PLAIN_OPTIONS = ("--offset.disable-normalization",)  # coordinates stay those of the sources
OSM_OPTIONS = (
    "--keep-edges.by-vclass=passenger",
    "--remove-edges.isolated",
    "--geometry.remove",  # nodes that only bend a road
    "--junctions.join",
    "--roundabouts.guess",
    "--tls.discard-loaded",
    "--default.junctions.radius=7",  # m; netconvert's default of 4 m is tighter than a car can turn
)
OPTIONS = (
    "--no-turnarounds",
    "--junctions.corner-detail=10",  # points per rounded kerb
    "--junctions.internal-link-detail=15",  # points per lane inside a node
    "--xml-validation=never",  # schemas would be fetched from the network
)


def build_network(folder: str | Path, out: str | Path | None = None) -> Path:
    """Builds NAME.net.xml from NAME.nod.xml, NAME.edg.xml (and NAME.con.xml, NAME.typ.xml, NAME.tll.xml) in a
    folder, or from its NAME.osm; traffic lights of a map are left out.

    `out`: the file to write, by default beside the sources. It holds no date and no path of this machine.
    Raises NetworkError, StorageError, InputError (a folder that cannot be made).
    """
    source = Path(folder)
    name, arguments = _arguments(source)
    target = Path(out) if out is not None else source / f"{name}.net.xml"
    check_place(target, "a network", ".net.xml")
    with tempfile.TemporaryDirectory() as scratch:
        built = Path(scratch) / "net.xml"
        command = [str(find_netconvert()), *arguments, *OPTIONS, f"--output-file={built}"]
        result = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
        if result.returncode != 0 or not built.is_file():
            said = (result.stderr.strip() or result.stdout.strip()).replace("\n", "\n  ")
            raise NetworkError(f"{source}: netconvert failed:\n  {said}")
        text = re.sub(r"<!--.*?-->\s*", "", built.read_text(encoding="utf-8"), flags=re.DOTALL)
    make_folder_of(target)
    write_atomically(target, text)
    return target


def unused_signs(folder: str | Path) -> list[str]:
    """What a map's nodes say of right of way and is not used: a text for each kind; plain sources: none."""
    if list(Path(folder).glob("*.nod.xml")):
        return []
    nodes, used = {sign: list[str]() for sign in SIGNS}, set[str | None]()
    for file in Path(folder).glob(f"*{OSM}"):
        for _, element in ElementTree.iterparse(file):
            if element.tag not in ("node", "way"):
                continue
            tags = {tag.get("k"): tag.get("v") for tag in element.iter("tag")}
            if element.tag == "node":
                nodes.get(tags.get("highway") or "", []).append(element.get("id", "?"))
            elif tags.get("highway", "footway") not in ON_FOOT:
                used |= {point.get("ref") for point in element.iter("nd")}
            element.clear()
    return [
        f"{sign} at {listed([f'node {number}' for number in ids])}: {SIGNS[sign]}"
        for sign, every in nodes.items()
        if (ids := [number for number in every if number in used])
    ]


def lost_edges(folder: str | Path, built: Path) -> list[str]:
    """Ids of the edges in plain sources that are not in the network built from them, since netconvert left
    them out without a word. Those between nodes that it joined into one are not among them.
    """
    nodes = sorted(Path(folder).glob("*.nod.xml"))
    if not nodes:
        return []
    net = ElementTree.parse(built)
    there = {edge.get("id") for edge in net.iter("edge")}
    junctions = {junction.get("id") for junction in net.iter("junction")}
    source = nodes[0].with_name(nodes[0].name.replace(".nod.xml", ".edg.xml"))
    return [
        edge.get("id", "")
        for edge in ElementTree.parse(source).iter("edge")
        if edge.get("id") not in there and {edge.get("from"), edge.get("to")} & junctions
    ]


def find_netconvert() -> Path:
    """SUMO's netconvert. Raises NetworkError where it is not installed."""
    found = find_program("netconvert")
    if found is None:
        raise NetworkError(
            f"netconvert, which builds networks, is not installed: {install_command('networks')}"
        )
    return found


def find_program(name: str) -> Path | None:
    """The absolute path of one of SUMO's programs, from the Python package `eclipse-sumo`, from SUMO_HOME or
    from the PATH.
    """
    homes = []
    spec = importlib.util.find_spec("sumo")
    if spec is not None and spec.submodule_search_locations:
        homes += list(spec.submodule_search_locations)
    if "SUMO_HOME" in os.environ:
        homes.append(os.environ["SUMO_HOME"])
    for folders in (*(str(Path(home) / "bin") for home in homes), None):  # None: those of the PATH
        found = shutil.which(name, path=folders)
        if found:
            return Path(found).absolute()
    return None


def _arguments(folder: Path) -> tuple[str, list[str]]:
    """The network's name and netconvert's arguments for the sources in the folder."""
    if not folder.is_dir():
        raise NetworkError(f"{folder}: no such folder")
    nodes, maps = sorted(folder.glob("*.nod.xml")), sorted(folder.glob(f"*{OSM}"))
    if not nodes and len(maps) == 1:
        return maps[0].name.removesuffix(OSM), [f"--osm-files={maps[0].name}", *OSM_OPTIONS]
    if len(nodes) != 1:
        found = ", ".join(path.name for path in (*nodes, *maps)) or "none"
        raise NetworkError(
            f"{folder}: exactly one NAME.nod.xml (or one NAME.osm) is needed here, found {found}"
        )
    name = nodes[0].name.removesuffix(".nod.xml")
    missing = [name + ending for ending in SOURCES if not (folder / (name + ending)).is_file()]
    if missing:
        raise NetworkError(f"{folder}: {', '.join(missing)} is missing")
    present = {e: option for e, option in (SOURCES | MORE_SOURCES).items() if (folder / (name + e)).is_file()}
    return name, [f"{option}={name}{ending}" for ending, option in present.items()] + [*PLAIN_OPTIONS]
