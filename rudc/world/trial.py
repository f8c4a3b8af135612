"""Trying a network out in a process of its own, before SUMO runs it in ours.

SUMO trusts a .net.xml: one that contradicts itself can end the whole process, without an exception. So
cars first drive on a network that does not come with RUDC in a child process: one on every movement, from
every lane that permits it, for `TRIAL_S` of simulated time. A network that has passed is remembered by a
digest of its file, in this process and in the user's cache folder, and is not tried again.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rudc.errors import NetworkError
from rudc.files import user_cache
from rudc.network.network import shipped_networks
from rudc.world.trial_drive import REFUSED

if TYPE_CHECKING:
    from rudc.network.network import Network

PATIENCE_S = 30.0
"""s of wall time after which SUMO is taken to hang"""


def refuse_untried(network: Network) -> None:
    """Raise NetworkError if SUMO crashes over a network, hangs, or refuses it; shipped ones are not tried."""
    if network.path not in _shipped():
        _try_once(network.path, network.path.stat().st_mtime_ns, _orders(network))


@functools.cache
def _shipped() -> frozenset[Path]:
    return frozenset(path.resolve() for path in shipped_networks().values())


@functools.lru_cache(maxsize=64)
def _try_once(path: Path, _modified: int, orders: str) -> None:
    cache = user_cache()
    mark = None if cache is None else cache / "networks_tried" / _digest(path, orders)
    if mark is not None and os.path.exists(mark):
        return
    _try_out(path, orders)
    if mark is not None:
        with contextlib.suppress(OSError):  # where nothing can be stored, it is tried again next time
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.touch()


def _orders(network: Network) -> str:
    """What the child is asked to do, as JSON: edges, lane and first position (m) of each car."""
    cars = []
    for movement in network.movements:
        for lane in sorted({network.inbound_lane(row).index for row in movement.rows}):
            first = next((known for known in network.lanes.values() if known.edge == movement.edges[0]), None)
            alone = network.arm(movement.origin).in_edges == movement.edges[:1]
            front = 0.0 if first is None else min(first.length, max(5.0, 0.5 * first.length))
            cars.append((movement.edges, lane if alone or first is None else first.index, front))
    return json.dumps(cars)


def _digest(path: Path, orders: str) -> str:
    version = importlib.metadata.version("libsumo")
    return hashlib.sha256(path.read_bytes() + f"{orders}{version}".encode()).hexdigest()


def _try_out(path: Path, orders: str) -> None:
    code = f"import sys; sys.path[:] = {[os.path.abspath(p) for p in sys.path]!r}"
    child = [sys.executable, "-c", f"{code}; from rudc.world.trial_drive import drive; drive()", str(path)]
    try:
        done = subprocess.run(child, input=orders, capture_output=True, text=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        raise NetworkError(
            f"{path}: SUMO does not come to an end over this network within {PATIENCE_S:g} s, "
            "driving a car on each movement; build it anew with netconvert"
        ) from None
    if done.returncode == REFUSED:
        # SUMO may say why on stderr alone
        reasons = [f" ({line.strip()})" for line in done.stderr.splitlines() if line.startswith("Error:")]
        raise NetworkError(f"{path}: {done.stdout.strip()}{''.join(reasons[:1])}")
    if done.returncode != 0:
        how = f"signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
        said = f": {done.stderr.strip().splitlines()[-1]}" if done.stderr.strip() else ""
        raise NetworkError(
            f"{path}: SUMO crashes over this network ({how}{said}), driving a car on each movement; "
            "build it anew with netconvert, as a file changed by hand may contradict itself"
        )
