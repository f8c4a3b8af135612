"""`rudc network`: list, check, build."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rudc.cli.console import AsJson, print_json, print_table, warn

if TYPE_CHECKING:
    from rudc.network.check import ArmReport, NetworkReport

app = typer.Typer(
    no_args_is_help=True, help="Road networks: what is there, what is understood of yours, building one."
)


@app.command("list")
def list_(as_json: AsJson = False) -> None:
    """The shipped networks."""
    from rudc.network.check import check_network
    from rudc.network.network import shipped_networks

    reports = {name: check_network(name) for name in shipped_networks()}
    if as_json:
        print_json([_values(report) for report in reports.values()])
        return
    rows = []
    for name, report in reports.items():
        arms = ", ".join(arm.name + (" (major)" if arm.major else "") for arm in report.arms)
        lanes = max(arm.in_lanes for arm in report.arms)
        rows.append([name, report.kind, arms, str(lanes), f"{1000 * report.road_km:.0f}"])
    print_table(["name", "kind", "arms", "lanes in", "road (m)"], rows, right=(3, 4))


@app.command()
def check(
    source: Annotated[
        str, typer.Argument(metavar="FILE", help="A .net.xml, or the name of a shipped network.")
    ],
    junction: Annotated[str | None, typer.Option(help="Which junction, where there are several.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="F.png", help="Draw what was understood.")
    ] = None,
    lanes: Annotated[
        bool, typer.Option("--lanes", help="List the names of lanes that scenario files may use.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Say what is understood of a network: arms, lanes, movements, right of way; and what may go wrong.

    Of a network with several junctions it lists them, until `--junction` says which to check.

    Of arms: `bearing`, where the arm lies 20 m out as seen from the junction's centre, 0 is east, 90 north;
    `length`, the largest `at` on its lanes.
    Of movements: `length` from stop line to exit; `radius` of the tightest bend; `waits inside`, how far
    beyond the stop line somebody who yields may come to wait.

    **Example**: `rudc network check town.net.xml --junction J12 --out town.png`
    """
    from rudc.errors import SeveralJunctionsError
    from rudc.network.check import check_network
    from rudc.world.trial import refuse_untried

    try:
        report = check_network(source, junction)
    except SeveralJunctionsError:
        _show_junctions(Path(source), as_json)
        raise
    written = None
    if out is not None:  # first, since whoever reads the tables may stop reading
        from rudc.drawing.network_picture import draw_network
        from rudc.drawing.picture_file import check_picture, save_picture

        check_picture(out)
        written = save_picture(draw_network(report.network), out)
    if as_json:
        print_json(_values(report))
    else:
        _show(report, lanes)
        for warning in report.warnings:
            warn(f"warning: {warning}")
        if written is not None:
            typer.echo(f"\n{written}")
    refuse_untried(report.network)


def _show_junctions(path: Path, as_json: bool) -> None:
    """A table of the junctions among which one must be chosen."""
    from rudc.network.junctions import list_junctions

    found = list_junctions(path)
    if as_json:
        print_json({"junctions": [vars(junction) for junction in found]})
        return
    rows = [[j.id, str(j.arms), j.kind, f"{j.x_m:.0f}", f"{j.y_m:.0f}", j.unusable or ""] for j in found]
    print_table(["junction", "arms", "kind", "x (m)", "y (m)", "unusable"], rows, right=(1, 3, 4))


def _values(report: NetworkReport) -> dict[str, Any]:
    """All that a report says, and the names of lanes."""
    told = {f.name: getattr(report, f.name) for f in fields(report) if f.name != "network"}
    named = report.network.named_stretches
    return {
        **told,
        "arms": [vars(arm) for arm in report.arms],
        "movements": [vars(movement) for movement in report.movements],
        "lanes": [
            {"name": name, "id": found.lane.id, "length_m": found.reach, "at_counts_from": found.counts_from}
            for name, found in named.items()
        ],
    }


def _show(report: NetworkReport, lanes: bool) -> None:
    """Tables of arms and movements, and of lanes if wanted."""
    road = f"{report.road_km:.3f} km of two-way road"
    typer.echo(f"{report.name}: junction {report.junction} ({report.kind}), {road}\n")
    entered = {a.major for a in report.arms if a.in_lanes}
    alike = report.kind != "roundabout" and len(entered) == 1

    def priority(arm: ArmReport) -> str:
        if not arm.in_lanes:
            return "-"
        return "equal" if alike else "major" if arm.major else "minor"

    arms = [
        [a.name, f"{a.bearing_deg:z.0f}", f"{a.length_m:.0f}", str(a.in_lanes), str(a.out_lanes),
         f"{a.lane_width_m:.2f}", f"{a.speed_mps:.1f}", priority(a)]
        for a in report.arms
    ]  # fmt: skip
    headings = [
        "arm",
        "bearing (deg, 0 is east)",
        "length (m)",
        "lanes in",
        "out",
        "width (m)",
        "limit (m/s)",
        "priority",
    ]
    print_table(headings, arms, right=range(1, 7))
    typer.echo()
    movements = [
        [m.origin, m.destination, m.turn, " ".join(map(str, m.lanes)), "yields" if m.yields else "",
         f"{m.length_m:.0f}", _radius(m.least_radius_m), "" if m.waiting_m is None else f"{m.waiting_m:.1f}"]
        for m in report.movements
    ]  # fmt: skip
    print_table(
        ["from", "to", "turn", "from lanes", "", "length (m)", "radius (m)", "waits inside (m)"],
        movements,
        right=(5, 6, 7),
    )
    if lanes:
        typer.echo()
        named = report.network.named_stretches
        rows = [
            [name, found.lane.id, f"{found.reach:.0f}", found.counts_from] for name, found in named.items()
        ]
        print_table(["lane", "SUMO's id", "length (m)", "`at` counts from"], rows, right=(2,))


@app.command()
def build(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with the sources of one network.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="F.net.xml", help="Default: NAME.net.xml beside the sources."),
    ] = None,
) -> None:
    """Build a .net.xml from plain sources, or from a map of OpenStreetMap, with SUMO's netconvert (extra
    `networks`).

    Plain sources are NAME.nod.xml and NAME.edg.xml, and where they are there NAME.con.xml (connections),
    NAME.typ.xml (types of edges) and NAME.tll.xml (traffic lights). A map is NAME.osm.

    **Example**: `rudc network build my_networks/ring`
    """
    from rudc.network.build import build_network, lost_edges, unused_signs

    built = build_network(folder, out)
    for sign in unused_signs(folder):
        warn(f"warning: {sign}; `rudc network check` shows what came of it")
    for edge in lost_edges(folder, built):
        warn(f"warning: netconvert left out edge {edge} of the sources; look at its numbers, such as `speed`")
    typer.echo(built)


def _radius(radius_m: float) -> str:
    return "straight" if radius_m > 1e3 else f"{radius_m:.1f}"
