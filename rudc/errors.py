"""Every exception that RUDC raises on purpose; no solver's, SUMO's or pydantic's exception leaks to a user.

`exit_code` is what the command line leaves with: 2 when the input was wrong, 1 when the work failed.
"""


class RudcError(Exception):
    """Base of all of them. Its text is one clear message: what is wrong, where, and what to do."""

    exit_code = 1


class InputError(RudcError):
    """What the user gave is wrong: a file, a name, a value."""

    exit_code = 2


class ScenarioError(InputError):
    """A scenario file is wrong; the text has a line `FILE:LINE:COLUMN: key.path: what` for each problem."""


class NetworkError(InputError):
    """A road network cannot be used; the text says what is missing."""


class AgentError(InputError):
    """No such agent or checkpoint, or it does not fit."""


class PartFailedError(RudcError):
    """A part that is not RUDC's (a barrier, a correction, an event, ...) raised an exception, or answered
    what cannot be used; the text says which part, when, and what it was.
    """


class AgentFailedError(PartFailedError):
    """An agent raised an exception, or answered what is no action; the text says when, and where in it."""


class SweepError(InputError):
    """A sweep cannot start or resume; the text says what differs."""


class SimulationError(RudcError):
    """SUMO failed, or an episode could not be set up as its scenario asks."""


class WorldBusyError(RudcError):
    """A second world was asked for in one process (libsumo would silently destroy the first)."""


class SolverError(RudcError):
    """A QP was refused (input not finite) or its solver is not installed."""


class StorageError(RudcError):
    """Results could not be written though the place had been tried: a disk that is full."""


class TrainingError(RudcError):
    """Training went astray, or lost a worker; the last good checkpoint is kept."""
