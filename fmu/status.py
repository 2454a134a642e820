"""What a call of a unit ends with, the phases that a unit goes through, and what a call may ask."""

from __future__ import annotations

from enum import Enum, IntEnum

from lcmchain.errors import LcmchainError


class Status(IntEnum):
    """Outcome of a call; the numbers are those of FMI."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3


class Phase(Enum):
    """Where a unit is in its life; the values stand in messages and saved states."""

    INSTANTIATED = "instantiated"
    INITIALIZING = "in initialization mode"
    STEPPING = "between steps"
    TERMINATED = "terminated"


class StepOutcome(IntEnum):
    """Values of the output ``status`` of every unit."""

    READY = 0  # initialized, or the last step was done
    UNDONE = 1  # the last step was undone
    INTERRUPTED = 2  # the user stopped the unit
    NOT_READY = 3  # not initialized, or that failed


#: Categories of log messages, and what they hold.
CATEGORIES = {
    "logEvents": "What the unit does: compiling, files written.",
    "logStatusWarning": "What is allowed but probably not meant.",
    "logStatusDiscard": "Steps that were stopped and undone.",
    "logStatusError": "Calls that were refused; the unit is as before.",
    "logAll": "All messages.",
}

CATEGORY_OF = {
    Status.OK: "logEvents",
    Status.WARNING: "logStatusWarning",
    Status.DISCARD: "logStatusDiscard",
    Status.ERROR: "logStatusError",
}


class Refused(LcmchainError):
    """A call that the standard forbids, or whose values make no sense; nothing has changed."""
