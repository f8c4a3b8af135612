"""Every exception that RUDC raises on purpose; no solver's, SUMO's or pydantic's exception leaks to a user.

`exit_code` is the exit status of the command line: 2 when the input was wrong, 1 when the work failed.
"""


class RudcError(Exception):
    """Base of all RUDC's exceptions. Its text is one clear message: what is wrong, where, and what to do."""

    exit_code = 1


class InputError(RudcError):
    """What the user gave is wrong: a file, a name, a value."""

    exit_code = 2


class ScenarioError(InputError):
    """A scenario file is wrong; the text has a line `FILE:LINE:COLUMN: key.path: what` for each problem."""


class NetworkError(InputError):
    """A road network cannot be used; the text says what is missing."""


class JunctionError(NetworkError):
    """A network has no junction of the name that is asked for; the text names those that it has."""


class SeveralJunctionsError(NetworkError):
    """A network has several junctions, and none is chosen; the text names some of them."""


class AgentError(InputError):
    """There is no such agent or checkpoint, or its parts or settings do not fit together."""


class PartFailedError(RudcError):
    """A part that is not RUDC's (a barrier, a correction, an event, ...) raised an exception or returned
    something that cannot be used; the text says which part, when in the episode, and what it was.
    """


class AgentFailedError(PartFailedError):
    """An agent raised an exception or returned something that is no action. The text says when in the
    episode and, for an exception, where in the agent's code.
    """


class SweepError(InputError):
    """A sweep cannot start or resume; the text says what differs."""


class SimulationError(RudcError):
    """SUMO failed, or an episode could not be set up as its scenario asks."""


class WorldBusyError(RudcError):
    """A second world was asked for in one process (libsumo would silently destroy the first)."""


class SolverError(RudcError):
    """A QP was refused (input not finite) or its solver is not installed."""


class StorageError(RudcError):
    """Results could not be written, for example because the disk is full."""


class TrainingError(RudcError):
    """Training diverged, or a worker process failed; the last good checkpoint is kept."""
