"""Let no exception out of a unit: a refused call is told and changes nothing."""

from __future__ import annotations

import functools
import traceback
from collections.abc import Callable
from typing import Any

import numpy as np

from lcmchain.errors import LcmchainError
from lcmchain.fmu.interrupts import catching, outermost
from lcmchain.fmu.status import Status

# What a call answers that was refused; all others answer that there was an error.
_ANSWERS: dict[str, Callable[..., Any]] = {
    "get_numbers": lambda references: np.full(len(references), np.nan),
    "get_texts": lambda references: [""] * len(references),
    "save": lambda: None,
    "step": lambda *_: Status.DISCARD,
}
#: Calls that change nothing that a step could depend on.
_HARMLESS = {"get_numbers", "get_texts", "save", "step", "terminate"}


@catching
def _call(method: Callable, unit: Any, arguments: tuple) -> Any:
    return method(unit, *arguments)


def guarded(method: Callable) -> Callable:
    """Turn every exception of a unit's method into a message and an answer."""
    name = method.__name__

    @functools.wraps(method)
    def outer(self: Any, *arguments: Any) -> Any:
        try:
            return _call(method, self, arguments)
        except LcmchainError as error:
            self.refuse(str(error), changes=name not in _HARMLESS)
        except KeyboardInterrupt:
            self.interrupted()
            self.refuse(f"{name} was interrupted", changes=False)
        except BaseException as error:
            # A defect, or no memory: the unit says where, and goes on as it was.
            where = traceback.format_tb(error.__traceback__)[-1].strip().replace("\n", " ")
            what = f"{name} failed with {type(error).__name__} ({error}) at {where}"
            self.refuse(what, changes=name not in _HARMLESS)
        answer = _ANSWERS.get(name)
        return Status.ERROR if answer is None else answer(*arguments[:1])

    return outermost(outer)
