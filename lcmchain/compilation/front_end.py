"""Numba's front end in less time: what it spends on itself while it compiles a function.

Most of the time that Python takes to compile the solver is numba's own work. Three parts of it give
nothing. Python looks for circles of dead objects again and again among those of the functions that
are being compiled, which all live on. Each time a call is typed, numba looks up the answer by the
options of the caller, which it compares and hashes option by option, though few are set. And each
function that is compiled while others wait for it times what all below it do.
"""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import compiler, event
from numba.core.targetconfig import TargetConfig

#: Objects that a function being compiled may add before Python looks for dead ones, and how many
#: such looks go by before it looks among older ones.
THRESHOLDS = (200_000, 50, 100)


def compile_in_less_time() -> None:
    """Spare numba what gives nothing; before anything is compiled."""
    _collect_seldom()
    _compare_options_as_they_are_set()
    _time_the_outermost_alone()


def _collect_seldom() -> None:
    compile_extra = compiler.compile_extra

    @functools.wraps(compile_extra)
    def compile_undisturbed(*arguments: Any, **named: Any) -> Any:
        before = gc.get_threshold()
        if 0 < before[0] < THRESHOLDS[0]:  # 0 is a collector that somebody has switched off
            gc.set_threshold(*THRESHOLDS)
        try:
            return compile_extra(*arguments, **named)
        finally:
            gc.set_threshold(*before)

    compiler.compile_extra = compile_undisturbed


def _compare_options_as_they_are_set() -> None:
    """Compare only the options that were set, and hash their names once."""
    compare_all = TargetConfig.__eq__
    names: dict[type, int] = {}

    def equal(self: TargetConfig, other: object) -> bool:
        if type(self) is not type(other):
            return compare_all(self, other)
        mine, others = self._values, other._values
        # one set to its default equals one that was not set
        return mine == others or all(
            getattr(self, name) == getattr(other, name) for name in mine.keys() | others.keys()
        )

    def hashed(self: Any) -> int:
        found = names.get(type(self))
        if found is None:
            found = names[type(self)] = hash(tuple(sorted(self.options)))
        return found

    TargetConfig.__eq__ = equal  # type: ignore[method-assign]
    TargetConfig.__hash__ = hashed  # type: ignore[method-assign]


def _time_the_outermost_alone() -> None:
    """Install no timer for a kind of event that is being timed: it would hear each of them too."""
    install_timer = event.install_timer
    timed: set[str] = set()

    @contextmanager
    def install_one(kind: str, callback: Callable[[float], None]) -> Iterator[Any]:
        if kind in timed:
            yield None
            return
        timed.add(kind)
        try:
            with install_timer(kind, callback) as timer:
                yield timer
        finally:
            timed.remove(kind)

    event.install_timer = install_one
