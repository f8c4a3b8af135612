"""What `scaling` measured, as CSV and a page, and the model of many cores that follows from it.

The model. An episode takes `e` seconds of a core, as one local worker drives them one after the other, and
`d` of the driver (it is given out, its record taken in, its row written; processor time). Workers share
nothing, so N cores give

    rate(N) = min(N / e, 1 / d)        rows a second

Up to e / d cores more cores help; from there on the driver is what stops them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rudc.files import make_folder, write_atomically

Found = Mapping[str, Mapping[str, float]]
"""what was measured of what"""
CORES = (1, 2, 16, 64, 256, 1000, 4000)
"""for which the model is asked"""


class Point(NamedTuple):
    """What so many cores give, by the model."""

    cores: int
    rows_per_s: float
    driver_percent: float
    """of a core, that the driver needs"""
    network_mb_per_s: float
    """tasks to the workers, records back"""
    disk_mb_per_s: float
    million_min: float
    """minutes that a million episodes take"""


def model(found: Found) -> tuple[list[Point], float]:
    """The points, and the cores up to which more help."""
    one, stubs = found["local 1"], found["stubs local"]
    episode_s = 1.0 / one["rate"]
    driver_s = 1e-3 * max(found[name]["driver_ms"] for name in found if name.startswith("stubs"))
    points = []
    for cores in CORES:
        rate = min(cores / episode_s, 1.0 / driver_s)
        sent = stubs["task_bytes"] + stubs["record_bytes"]
        points.append(
            Point(
                cores,
                rate,
                100.0 * rate * driver_s,
                1e-6 * rate * sent,
                1e-6 * rate * one["bytes"],
                1e6 / rate / 60.0,
            )
        )
    return points, episode_s / driver_s


def write_page(folder: Path, found: Found, machine: str) -> None:
    """Write `scaling.csv`, `model.csv` and `README.md`."""
    points, limit = model(found)
    make_folder(folder)
    told = [(of, name, f"{value:.6g}") for of, values in found.items() for name, value in values.items()]
    write_atomically(folder / "scaling.csv", _csv([("of", "quantity", "value"), *told]))
    write_atomically(folder / "model.csv", _csv([Point._fields, *([f"{v:.6g}" for v in p] for p in points)]))
    write_atomically(folder / "README.md", _page(found, machine, points, limit))


def _csv(lines: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def _markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "".join(f"| {' | '.join(line)} |\n" for line in (head, rule, *lines))


def _page(found: Found, machine: str, points: Sequence[Point], limit: float) -> str:
    driven = [name for name in found if name.split()[0] in ("local", "ray")]
    stubs = [name for name in found if name.startswith("stubs")]
    slowest = max(found[name]["driver_ms"] for name in stubs)
    ends, table, one = found["finished"], found["table"], found["local 1"]
    many = [
        f"| {what} | {of['rows']:,.0f} | {of['s']:.1f} | {of['cpu_s']:.1f} | {of['mb']:.0f} |\n"
        for what, of in (("`rudc table`", table), ("the sweep's driver, nothing left to drive", ends))
    ]
    rates = _markdown(
        ("engine and workers", "rows/s", "of its one worker", "first row after (s)"),
        [
            (
                name,
                f"{found[name]['rate']:.2f}",
                f"{found[name]['rate'] / found[name.split()[0] + ' 1']['rate']:.2f}",
                f"{found[name]['first_s']:.1f}",
            )
            for name in driven
        ],
    )  # fmt: skip
    ceilings = _markdown(
        ("engine", "rows/s, driver and two workers on two cores", "driver (ms of processor time a row)",
         "rows/s of a driver with a core of its own"),
        [
            (
                name.split()[1], f"{found[name]['rate']:.0f}", f"{found[name]['driver_ms']:.3f}",
                f"{1e3 / found[name]['driver_ms']:.0f}",
            )
            for name in stubs
        ],
    )  # fmt: skip
    modelled = _markdown(
        ("cores", "rows/s", "driver (% of a core)", "network (MB/s)", "disk (MB/s)",
         "a million episodes (min)"),
        [
            (f"{p.cores}", f"{p.rows_per_s:.4g}", f"{p.driver_percent:.3g}", f"{p.network_mb_per_s:.2g}",
             f"{p.disk_mb_per_s:.2g}", f"{p.million_min:.4g}")
            for p in points
        ],
    )  # fmt: skip
    last = found[stubs[-1]]
    return f"""# Scaling

Made by `python -m tests.benchmarks.scaling --out results/scaling`; `scaling.csv` and `model.csv` have the
figures in full. The machine: {machine}.
Where that load is not near 0, rates are lower bounds, and their ratios are rough.

## Measured

Real episodes (`dense_left_turn` and `random_destination`; `rudc-t` and `gap-acceptance+ttcbf`), from the
first row to the last:

{rates}
A row of `episodes.csv` takes {one["bytes"]:.0f} bytes. An episode goes out as {last["alone_bytes"]:.0f}
bytes, in a batch, in which its scenario travels once, as {last["task_bytes"]:.0f};
{last["record_bytes"]:.0f} come back.

The driver, with episodes that take no time:

{ceilings}
Many rows in one folder:

| | rows | s | of processor time | MB |
|---|---:|---:|---:|---:|
{many[0]}{many[1]}
## A thousand cores, by the model

N cores give min(N / e, 1 / d) rows a second. e = {1.0 / one["rate"]:.2f} s: an episode, as one local
worker drives them; d = {slowest:.3f} ms: what a row takes of the driver, with the engine that takes more.

{modelled}
**First bottleneck: the driver**, one process on one core, from {limit:,.0f} cores on. Network and disk are
far from their ends. Workers share nothing, so nothing else grows with their number; with the number of
episodes grows the driver's memory, {(ends["mb"] - ends["before_mb"]) / ends["rows"] * 1e3:.2f} GB for a
million.

**What was ours is mended.** Rows were flushed to the disk one by one, and are now five times a second at
most. Ray got one episode a call, and the driver asked for one answer at a time; now episodes travel in
batches of about 2 s, and all answers that are there are taken at once. `rudc table` and the end of a sweep
held every cell of every row; now they hold a block of rows at a time.

**What would remove what is left**: several sweeps, split by `--seed` and `--episodes`, each with a folder
and a driver of its own; their rows are those of one sweep ([Scaling
out](../../docs/tutorials/scaling_out.md)). The model knows nothing of how long a thousand workers take to
start (each imports RUDC and loads agents and networks once, from its own disk), nor of the last long
episode, for which all others wait.
"""
