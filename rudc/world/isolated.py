"""`IsolatedWorld`: a `World` in a process of its own, since libsumo allows only one world per process.

    this process                              the world's process
    starts it, with network and configuration ->  opens the world
    sends a method's name and arguments       ->  calls it; sends back its result and the new scenes
    closes the pipe, or has ended             ->  ends

A plain interpreter is started, not one that `multiprocessing` spawns: that one would run the user's script
once more, and a notebook has no script. Plans and scenes are sent pickled; networks and routes are sent by
name. Only if something arrives that the script itself defines (an event) is the script imported there, as in
the workers of a sweep: under another name than `__main__`.
"""

from __future__ import annotations

import contextlib
import io
import multiprocessing.spawn
import os
import pickle
import subprocess
import sys
import threading
import time
import traceback
import weakref
from functools import cache
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from rudc.errors import InputError, RudcError, SimulationError, WorldBusyError
from rudc.imports import import_first, imported_first, in_words
from rudc.world.config import EgoDriver, WorldConfig
from rudc.world.world import World

if TYPE_CHECKING:
    from rudc.arrays import Array
    from rudc.network.network import Network
    from rudc.scenario.plan import EpisodePlan
    from rudc.world.events import Happening
    from rudc.world.perception import Sensors
    from rudc.world.scene import Scene
    from rudc.world.world import Advance

MAIN = ("__main__", "__mp_main__")
"""names of the module that is the script; the second in processes that had to import it"""
CHANGING = ("reset", "advance", "put_ego")
"""methods that change the scene"""
ORPHAN_S = 2.0
"""s between two looks of the world's process at whether its parent still runs"""


class _Reply(NamedTuple):
    """What is sent back for one call; scenes and plan only after methods that change the scene."""

    value: Any
    """what the method returned, or the exception it raised"""
    scene: Scene | None = None
    perceived: Scene | None = None
    plan: EpisodePlan | None = None


def open_world(network: Network, config: WorldConfig, isolated: bool | None = None) -> AnyWorld:
    """A world, in this process or in one of its own.

    `isolated`: True for a process of its own, False for this one, None for a process of its own only if this
    process already has a world. Raises WorldBusyError if it has and `isolated` is False.
    """
    if isolated:
        return IsolatedWorld(network, config)
    try:
        return World(network, config)
    except WorldBusyError:
        if isolated is False:
            raise
        return IsolatedWorld(network, config)


class IsolatedWorld:
    """As `World` and with the same episodes, but run in a process of its own, which ends with this object.

    Raises the errors of `World`, and SimulationError if its process dies. If a call is interrupted, the
    process is ended; the next `reset` then starts another.
    """

    def __init__(self, network: Network, config: WorldConfig | None = None) -> None:
        self.network = network
        self.config = config or WorldConfig()
        if _script is not None:
            raise InputError(
                "the script makes environments while it is imported; put the code that makes them under "
                "`if __name__ == '__main__':`"
            )
        self._closed = False
        self._start()

    def _start(self) -> None:
        paths = [os.path.abspath(path) for path in sys.path]
        code = (  # imports make no garbage, and looking for it would take a tenth of their time
            f"import gc, sys; gc.disable(); sys.path[:] = {paths!r}; "
            f"from rudc.world.isolated import serve; gc.freeze(); gc.enable(); serve({script()!r})"
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            process_group=0,  # Ctrl-C is for the parent alone
        )
        self._end = weakref.finalize(self, _end, self._process, os.getpid())
        self._reply = _Reply(None)
        self._imported: tuple[str, ...] = ()
        try:
            self._ask("open", self.network, self.config)
        except BaseException:  # a process without a world is of no use
            self._end()
            raise

    def close(self) -> None:
        """End the world and its process."""
        self._closed = True
        self._end()

    def reset(
        self,
        plan: EpisodePlan,
        *,
        ego_driver: EgoDriver = "agent",
        options: tuple[str, ...] = (),
    ) -> Scene:
        """As `World.reset`."""
        self._reply = _Reply(None)
        if not self._end.alive and not self._closed:
            self._start()
        if (sources := imported_first()) != self._imported:
            self._ask("import", sources)
            self._imported = sources
        return self._ask("reset", plan, ego_driver=ego_driver, options=options)

    def advance(self, u: Array) -> Advance:
        """As `World.advance`."""
        return self._ask("advance", u)

    def put_ego(self, x: float, y: float, psi: float, v: float = 0.0) -> Scene:
        """As `World.put_ego`."""
        return self._ask("put_ego", x, y, psi, v)

    def happenings(self) -> tuple[Happening, ...]:
        """As `World.happenings`."""
        return self._ask("happenings")

    def sensors(self) -> Sensors:
        """As `World.sensors`."""
        return self._ask("sensors")

    def scene(self) -> Scene:
        """As `World.scene`."""
        return self._known(self._reply.scene)

    def perceived(self) -> Scene:
        """As `World.perceived`."""
        return self._known(self._reply.perceived)

    @property
    def plan(self) -> EpisodePlan:
        """As `World.plan`."""
        return self._known(self._reply.plan)

    def _known(self, value: Any) -> Any:
        if value is None:
            raise SimulationError("the world has no episode yet; call reset(plan) first")
        return value

    def _ask(self, method: str, *arguments: Any, **named: Any) -> Any:
        if self._closed:
            raise SimulationError("this world is closed; make another")
        if not self._end.alive:
            raise SimulationError("the world's own process has ended; reset the environment to start another")
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = _pickled((method, arguments, named))
        try:
            _write(self._process.stdin, request)
            reply: _Reply = _receive(self._process.stdout)
        except (OSError, EOFError):
            self._end()
            raise SimulationError(
                f"the world's own process has died (exit code {self._process.returncode}); "
                "reset the environment to start another"
            ) from None
        except BaseException:  # an interrupt: the late reply would be taken for that of the next call
            self._end()
            raise
        if isinstance(reply.value, RudcError):
            raise reply.value
        if reply.scene is not None:
            self._reply = reply
        return reply.value


AnyWorld = World | IsolatedWorld


def _end(process: subprocess.Popen[bytes], owner: int) -> None:
    """End the world's process at once, and leave no zombie. Does nothing in a fork of its parent."""
    if os.getpid() != owner:
        return
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()


def script() -> dict[str, str]:
    """Where this process's script can be imported from, as `multiprocessing.spawn.prepare` takes it; empty
    for a notebook, a console, or `python -c`.
    """
    main = sys.modules["__main__"]
    if main.__spec__ is not None:
        return {"init_main_from_name": main.__spec__.name}
    file = getattr(main, "__file__", None)
    return {"init_main_from_path": os.path.abspath(file)} if file and os.path.isfile(file) else {}


def serve(script: dict[str, str]) -> None:
    """Run the world's process, until its pipe closes or its parent has ended. `script`: of `script()`."""
    global _script
    _script = script
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed goes to stderr, not between the replies
    threading.Thread(target=_leave_with, args=(os.getppid(),), daemon=True).start()
    world: World | None = None
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            try:
                method, arguments, named = _receive(requests, _Arriving)
                if method == "import":
                    for source in arguments[0]:
                        import_first(source)
                    reply = _Reply(None)
                elif world is None:
                    world, reply = World(*arguments), _Reply(None)
                else:
                    reply = _Reply(getattr(world, method)(*arguments, **named))
                    if method in CHANGING:
                        reply = reply._replace(
                            scene=world.scene(), perceived=world.perceived(), plan=world.plan
                        )
                _send(answers, reply)
            except (EOFError, BrokenPipeError):
                raise
            except RudcError as error:
                _send(answers, _Reply(error))
            except Exception as error:
                _send(answers, _Reply(_translated(error)))


_script: dict[str, str] | None = None
"""in the world's process: where it can import its parent's script from; None in other processes"""


class _Arriving(pickle.Unpickler):
    """Reads requests; imports the script if it defines something in them."""

    def find_class(self, module_name: str, name: str) -> Any:
        """As in `pickle`. Raises InputError if the script cannot be imported or does not define `name`."""
        if module_name not in MAIN:
            return super().find_class(module_name, name)
        try:
            _import_script()
            return super().find_class("__main__", name)
        except (Exception, SystemExit) as error:
            cause = in_words(error) if _script else "a notebook or a console cannot be imported"
            guard = "the code that drives under `if __name__ == '__main__':`, or " if _script else ""
            raise InputError(
                f"the process that SUMO runs in for a second environment must import {name}, which stands in "
                f"the script itself: {cause}. Put {guard}{name} into a module that the script imports"
            ) from error


@cache
def _import_script() -> None:
    """Import the parent's script, once. It may start no processes while it is imported."""
    process: Any = multiprocessing.current_process()
    process._inheriting = True  # `multiprocessing` refuses to start processes then
    try:
        multiprocessing.spawn.prepare(dict(_script or {}))
    finally:
        del process._inheriting


def _translated(error: Exception) -> SimulationError:
    """A SimulationError for an error that is not RUDC's own, with its place, and its traceback as a note."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    ours = SimulationError(
        f"in the world's own process: {type(error).__name__}: {error} "
        f"({os.path.basename(last.filename)}:{last.lineno})"
    )
    ours.add_note("".join(traceback.format_exception(error)))
    return ours


def _leave_with(parent: int) -> None:
    """End this process soon after its parent, even if another process holds the pipe open."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_S)
    os._exit(0)


def _pickled(request: Any) -> bytes:
    """The request, pickled. Raises InputError if something of the user's in it cannot be pickled."""
    try:
        return pickle.dumps(request, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"what SUMO's own process needs cannot be sent there: {error}; an event of your "
            "own is a class at the top of a module"
        ) from error


def _send(pipe: IO[bytes], message: Any) -> None:
    _write(pipe, pickle.dumps(message, pickle.HIGHEST_PROTOCOL))


def _write(pipe: IO[bytes], data: bytes) -> None:
    """Write the length and the pickled message: one that cannot be unpickled is still read as a whole."""
    pipe.write(len(data).to_bytes(8, "big") + data)
    pipe.flush()


def _receive(pipe: IO[bytes], unpickler: type[pickle.Unpickler] = pickle.Unpickler) -> Any:
    """The next message. Raises EOFError if the pipe has ended."""
    head = pipe.read(8)
    size = int.from_bytes(head, "big")
    data = pipe.read(size) if len(head) == 8 else b""
    if not size or len(data) < size:
        raise EOFError
    return unpickler(io.BytesIO(data)).load()
