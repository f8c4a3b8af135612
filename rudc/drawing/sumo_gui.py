"""An episode in sumo-gui as it happens: a second SUMO, in which everybody is put where they are in ours.

    our SUMO (libsumo, a step)  --View-->  `SumoGui.show`  --TraCI-->  sumo-gui (draws, decides nothing)

libsumo has no window, hence the second one. Needs the extra `networks` (eclipse-sumo) and a display.
"""

from __future__ import annotations

import contextlib
import io
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from rudc.drawing.palette import EGO, EVENT, TRAFFIC, Colour
from rudc.errors import InputError
from rudc.world.scene import Kind
from rudc.world.sumo import sumo_pose

if TYPE_CHECKING:
    from rudc.drawing.view import View

EGO_NAME, VIEW = "ego", "View #0"
ZOOM = 600.0
"""percent: some 80 m of road in a window of usual size"""
TRIES_S = 30
"""s that sumo-gui may take to start; each second it is asked whether it has"""
OPTIONS = ("--no-step-log", "--no-warnings", "--collision.action", "none", "--time-to-teleport", "-1")
WINDOW = ("--start", "--quit-on-end", "--delay", "0", "--window-size", "1200,900")
SCHEME = "real world"
"""how it draws: cars as cars, with their lights; its usual scheme has triangles"""
SHAPES = {
    Kind.CAR: "passenger", Kind.TRUCK: "truck", Kind.BUS: "bus", Kind.MOTORCYCLE: "motorcycle",
    Kind.BICYCLE: "bicycle", Kind.PEDESTRIAN: "pedestrian", Kind.OBSTACLE: "unknown",
}  # fmt: skip


class SumoGui:
    """Shows views in sumo-gui, in real time, and follows the ego."""

    def __init__(self, program: Path, net_file: Path, frames_per_second: float) -> None:
        """Raises InputError where it does not start, as without a display. `program`: sumo-gui; another of
        SUMO's shows nothing, and nobody is followed.
        """
        import traci

        self._window = program.stem.endswith("gui")
        self._period, self._due = 1.0 / frames_per_second, time.monotonic()
        self._there: dict[str, Colour] = {}
        self._gone: tuple[type[Exception], ...] = (traci.FatalTraCIError, OSError)
        port, options = _free_port(), OPTIONS + (WINDOW if self._window else ())
        given = ("-n", str(net_file), "--step-length", str(self._period), "--remote-port", str(port))
        with tempfile.TemporaryFile() as told:
            process = subprocess.Popen([program, *given, *options], stdout=subprocess.DEVNULL, stderr=told)
            try:
                with contextlib.redirect_stdout(io.StringIO()):  # it counts its tries
                    self._traci: Any = traci.connect(port, TRIES_S, proc=process)
            except (traci.TraCIException, traci.FatalTraCIError) as error:
                process.kill()
                raise InputError(
                    f"{program.name} did not start ({_last_line(told) or error}); it needs a display. "
                    "Without one: --replay FILE.html or --video FILE.gif"
                ) from None

    def show(self, view: View) -> None:
        """Put everybody where they are, then wait until the next view is due. Once its user has closed the
        window, nothing more is shown.
        """
        with contextlib.suppress(*self._gone):
            self._show(view)
        now = time.monotonic()
        self._due = max(self._due + self._period, now)
        time.sleep(self._due - now)

    def _show(self, view: View) -> None:
        scene, numbers, vehicles = view.truth, view.numbers, self._traci.vehicle
        ego, body = scene.ego, scene.vehicle
        bodies = {EGO_NAME: (ego.x, ego.y, ego.psi, body.length, body.width, Kind.CAR, EGO, ego.v)}
        for i, name in enumerate(scene.ids):
            (x, y), (length, width) = scene.position[i].tolist(), scene.size[i].tolist()
            colour = EVENT if name in numbers else TRAFFIC
            speed = float(np.hypot(*scene.velocity[i]))
            heading, kind = float(scene.heading[i]), Kind(int(scene.kind[i]))
            bodies[f"sv {name}"] = (x, y, heading, length, width, kind, colour, speed)
        for name in self._there.keys() - bodies.keys():
            vehicles.remove(name)
            del self._there[name]
        for name, (x, y, psi, length, width, kind, colour, speed) in bodies.items():
            if name not in self._there:
                self._add(name, length, width, kind)
            if self._there.get(name) != colour:
                vehicles.setColor(name, (*colour[:3], 255))
                self._there[name] = colour
            front_x, front_y, angle = sumo_pose(x, y, psi, length)
            vehicles.moveToXY(name, "", -1, front_x, front_y, angle, keepRoute=2)
            vehicles.setSpeed(name, speed)
        self._traci.simulationStep()
        if self._window and self._traci.gui.getTrackedVehicle(VIEW) != EGO_NAME:
            self._traci.gui.setSchema(VIEW, SCHEME)
            self._traci.gui.setZoom(VIEW, ZOOM)
            self._traci.gui.trackVehicle(VIEW, EGO_NAME)

    def _add(self, name: str, length: float, width: float, kind: Kind) -> None:
        vehicles = self._traci.vehicle
        vehicles.add(name, "")
        vehicles.setLength(name, length)
        vehicles.setWidth(name, width)
        vehicles.setVehicleClass(name, "ignoring")
        vehicles.setShapeClass(name, SHAPES[kind])
        vehicles.setSpeedMode(name, 0)
        vehicles.setLaneChangeMode(name, 0)

    def close(self) -> None:
        """Close the window."""
        with contextlib.suppress(*self._gone):
            self._traci.close()


def _last_line(file: IO[bytes]) -> str:
    file.seek(0)
    return (file.read().decode(errors="replace").strip().splitlines() or [""])[-1]


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("localhost", 0))
        return int(found.getsockname()[1])
