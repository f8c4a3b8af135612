import re
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

import pytest
import yaml
from typer.testing import CliRunner

from rudc.cli.commands import app
from rudc.data import data_folder
from rudc.errors import NetworkError
from rudc.evaluation.preflight import never_happening
from rudc.network import build as network_build
from rudc.network.build import build_network, find_program, lost_edges
from rudc.network.check import check_network
from rudc.network.network import load_network, shipped_networks
from rudc.scenario import load_scenario


def built_by() -> str:
    """Version of the installed eclipse-sumo, empty if there is none."""
    try:
        return version("eclipse-sumo")
    except PackageNotFoundError:
        return ""


needs_netconvert = pytest.mark.skipif(
    find_spec("sumo") is None and shutil.which("netconvert") is None, reason="netconvert is not installed"
)


@pytest.mark.skipif(built_by() != "1.28.0", reason="the shipped files are built by eclipse-sumo 1.28.0")
@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_shipped_networks_are_what_their_sources_give(name, tmp_path):
    shipped = shipped_networks()[name]
    assert build_network(shipped.parent, tmp_path / "x.net.xml").read_bytes() == shipped.read_bytes()


@pytest.mark.parametrize("name", sorted(shipped_networks()))
def test_built_files_carry_no_date_and_no_path(name):
    text = shipped_networks()[name].read_text()
    assert "<!--" not in text
    assert re.search(r"20\d\d-\d\d-\d\d", text) is None
    assert re.search(r"=\"(/|[A-Za-z]:\\)", text) is None


@needs_netconvert
def test_a_copy_of_the_sources_builds_anywhere(tmp_path):
    folder = tmp_path / "a folder with spaces"
    shutil.copytree(shipped_networks()["t_junction"].parent, folder)
    (folder / "t_junction.net.xml").unlink()
    built = build_network(folder)
    assert built == folder / "t_junction.net.xml"
    assert [arm.name for arm in load_network(built).arms] == ["east", "west", "south"]
    assert sorted(path.name for path in folder.iterdir()) == [
        "t_junction.con.xml",
        "t_junction.edg.xml",
        "t_junction.net.xml",
        "t_junction.nod.xml",
        "t_junction.typ.xml",
    ]


@needs_netconvert
def test_wrong_sources_are_refused_with_netconverts_words(tmp_path):
    with pytest.raises(NetworkError, match="no such folder"):
        build_network(tmp_path / "absent")
    with pytest.raises(NetworkError, match=r"exactly one NAME.nod.xml .* is needed here, found none"):
        build_network(tmp_path)
    for name in ("a.osm", "b.osm"):
        (tmp_path / name).touch()
    with pytest.raises(NetworkError, match=r"exactly one .* is needed here, found a.osm, b.osm"):
        build_network(tmp_path)
    (tmp_path / "own.nod.xml").write_text('<nodes><node id="a" x="0" y="0"/></nodes>')
    with pytest.raises(NetworkError, match=r"own.edg.xml is missing"):
        build_network(tmp_path)
    (tmp_path / "own.edg.xml").write_text('<edges><edge id="e" from="a" to="nowhere"/></edges>')
    with pytest.raises(NetworkError, match=r"netconvert failed:(.|\n)*nowhere"):
        build_network(tmp_path)
    assert not (tmp_path / "own.net.xml").exists()


@needs_netconvert
def test_edges_that_netconvert_leaves_out_are_named(tmp_path):
    (tmp_path / "own.nod.xml").write_text(
        '<nodes><node id="A" x="0" y="0"/><node id="B" x="20" y="0"/><join nodes="A B"/>'
        '<node id="east" x="150" y="0"/><node id="west" x="-150" y="0"/><node id="south" x="0" y="-150"/>'
        "</nodes>"
    )
    ways = [
        ("west_in", "west", "A"), ("west_out", "A", "west"), ("middle", "A", "B"), ("east_in", "east", "B"),
        ("east_out", "B", "east"), ("south_in", "south", "A"), ("south_out", "A", "south"),
    ]  # fmt: skip
    edges = "".join(f'<edge id="{name}" from="{a}" to="{b}" speed="9"/>' for name, a, b in ways)
    (tmp_path / "own.edg.xml").write_text(f"<edges>{edges}</edges>")
    assert lost_edges(tmp_path, build_network(tmp_path)) == []
    wrong = edges.replace('to="B" speed="9"/><edge id="east_out"', 'to="B" speed="-9"/><edge id="east_out"')
    (tmp_path / "own.edg.xml").write_text(f"<edges>{wrong}</edges>")
    assert lost_edges(tmp_path, build_network(tmp_path)) == ["east_in"]
    told = CliRunner().invoke(app, ["network", "build", str(tmp_path)])
    assert "netconvert left out edge east_in" in told.stderr
    assert told.stdout == f"{tmp_path / 'own.net.xml'}\n"


@pytest.mark.parametrize(("variable", "value"), [("SUMO_HOME", "sumo"), ("PATH", "sumo/bin")])
def test_a_program_in_a_relative_folder_is_found_from_anywhere(tmp_path, monkeypatch, variable, value):
    program = tmp_path / "sumo" / "bin" / "netconvert"
    program.parent.mkdir(parents=True)
    program.touch(mode=0o755)
    monkeypatch.setattr(network_build.importlib.util, "find_spec", lambda name: None)
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setenv(variable, value)
    monkeypatch.chdir(tmp_path)
    assert find_program("netconvert") == program


def test_without_netconvert_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(network_build.importlib.util, "find_spec", lambda name: None)
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setattr(network_build.shutil, "which", lambda *args, **kwargs: None)
    monkeypatch.setattr(subprocess, "run", None)
    with pytest.raises(NetworkError, match=r"pip install .*\[networks\]"):
        build_network(shipped_networks()["four_way"].parent)


@needs_netconvert
def test_a_lane_that_leads_only_round_a_ring_is_named_with_what_helps(tmp_path):
    source, folder = data_folder("results") / "held-out-39/networks/two_lane_ring", tmp_path / "ring"
    folder.mkdir()
    for end in ("nod", "edg"):
        text = (source / f"two_lane_ring.{end}.xml").read_text(encoding="utf-8")
        both = re.sub(r'(id="ring_[^>]*numLanes=)"1"', r'\1"2"', text)  # all round; no .con.xml
        (folder / f"ring.{end}.xml").write_text(both, encoding="utf-8")
    (told,) = (w for w in check_network(build_network(folder), "RE").warnings if "nowhere" in w)
    assert told.startswith("lane west_in_1 leads nowhere")
    assert "do not change lanes on a ring" in told


MAP = """<osm version="0.6">
<node id="1" lat="0.0" lon="0.0"/><node id="2" lat="0.001" lon="0.0"/>
<node id="3" lat="0.0" lon="0.001"/><node id="4" lat="0.0" lon="-0.001"/>
<node id="5" lat="0.0003" lon="0.0"><tag k="highway" v="{sign}"/></node>
<node id="6" lat="0.01" lon="0.0"><tag k="highway" v="{sign}"/></node><node id="7" lat="0.01" lon="0.01"/>
<way id="1"><nd ref="6"/><nd ref="7"/><tag k="highway" v="footway"/></way>
{ways}
</osm>"""
WAYS = "".join(
    f'<way id="{k}"><nd ref="{a}"/><nd ref="{b}"/><tag k="highway" v="tertiary"/></way>'
    for k, (a, b) in enumerate([(2, 5), (5, 1), (1, 3), (1, 4)], 10)
)


@needs_netconvert
@pytest.mark.parametrize(
    ("sign", "said"),
    [
        ("traffic_signals", "traffic_signals at node 5: lights are taken away"),
        ("stop", "stop at node 5: who goes first is netconvert's guess"),
        ("crossing", None),
    ],
)
def test_signs_of_a_map_that_are_not_used_are_named(tmp_path, sign, said):
    """A crossroads with lights became one without, and nothing was said."""
    (tmp_path / "own.osm").write_text(MAP.format(sign=sign, ways=WAYS))
    told = CliRunner().invoke(app, ["network", "build", str(tmp_path)])
    assert told.exit_code == 0
    assert ("warning" in told.stderr) == (said is not None)
    assert (said or "") in told.stderr


@needs_netconvert
@pytest.mark.parametrize(("y", "sharp"), [(-60, True), (-130, False)])
def test_a_turn_so_sharp_that_it_leads_over_the_oncoming_lane_is_named(tmp_path, y, sharp):
    """Whoever followed its path there drove the wrong way, and all agents were charged with a violation."""
    ends = {"e": (150, 0), "w": (-150, 0), "d": (130, y)}
    nodes = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in ends.items())
    (tmp_path / "own.nod.xml").write_text(f'<nodes><node id="C" x="0" y="0" type="priority"/>{nodes}</nodes>')
    ways = [
        (f"{name}_{way}", *pair) for name in ends for way, pair in (("in", (name, "C")), ("out", ("C", name)))
    ]
    edges = "".join(
        f'<edge id="{name}" from="{a}" to="{b}" priority="{1 if "d" in name else 3}" speed="13.9"/>'
        for name, a, b in ways
    )
    (tmp_path / "own.edg.xml").write_text(f"<edges>{edges}</edges>")
    built = build_network(tmp_path)
    told = [text for text in check_network(str(built)).warnings if "opposite direction" in text]
    route = "from southeast to east" if sharp else ""
    assert [route in text for text in told] == [True] * sharp
    turn = {"from": "southeast", "turn": "right"}
    file = tmp_path / "own.yaml"
    for over, expected in ((False, sharp), (True, False)):
        ego = {"route": turn, "may_cross_centre": over}
        file.write_text(yaml.safe_dump({"name": "own", "network": str(built), "ego": ego}))
        found = [text for text in never_happening(load_scenario(file)) if "opposite direction" in text]
        assert len(found) == expected
