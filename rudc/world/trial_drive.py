"""What the child process of trial.py does: cars drive on a network. It imports no more than it needs, since
each network is tried out by a new process.
"""

from __future__ import annotations

import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from rudc.errors import SimulationError

TRIAL_S = 40.0
"""s of simulated time for which the cars drive"""
STEP_S = 0.1
"""s, one simulation step"""
MEMORY = 4 * 2**30
"""bytes of address space that the child may use"""
REFUSED = 3
"""exit code of a child whose network SUMO refuses; it then prints why"""
_CAR = '<additional><vType id="car" vClass="passenger" carFollowModel="IDM" speedDev="0"/></additional>'


def drive() -> None:
    """Run the child: read its orders, let the cars drive, and exit with 0 or REFUSED."""
    from rudc.world.sumo import Sumo  # the parent, which needs REFUSED only, does not load SUMO

    with contextlib.suppress(ImportError, OSError, ValueError):  # no such limits on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    cars: list[Any] = json.load(sys.stdin)
    sumo = Sumo(Path(sys.argv[1]), STEP_S)
    try:
        sumo.load(0, _CAR)
        for i, (edges, lane, front) in enumerate(cars):
            sumo.add_route(f"route{i}", edges)
            sumo.add(f"car{i}", f"route{i}", "car", lane, front, 0.0)
        for _ in range(round(TRIAL_S / STEP_S)):
            sumo.step()
        sumo.close()
    except SimulationError as error:
        print(error)
        sys.exit(REFUSED)
