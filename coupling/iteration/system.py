"""A system of coupled parts that advances in windows of time.

In every window the parts are evaluated until all exchanged fields agree. The size of the windows is
constant, or follows iterations, failures and the coupling residual. The first guess in a window is
extrapolated from the last ones.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from lcmchain.coupling.iteration.attempt import (
    Attempt,
    Iteration,
    NotSettled,
    Window,
    not_converged,
)
from lcmchain.coupling.iteration.history import (
    ACCEPTED,
    CONVERGED,
    EXPLICIT,
    FAILED,
    REJECTED,
    STANDING,
    History,
    WindowRecord,
)
from lcmchain.coupling.iteration.interface import (
    CoupledPart,
    Exchange,
    Fields,
    Jumps,
    PartFailed,
    Port,
    Values,
    find_port,
)
from lcmchain.coupling.iteration.schemes import Scheme
from lcmchain.coupling.iteration.sweep import Sweep
from lcmchain.errors import InputError, SimulationError

log = logging.getLogger(__name__)


class CoupledSystem:
    """Parts that exchange fields; satisfies :class:`CoupledPart` itself, so that systems nest.

    Parameters
    ----------
    parts : by name; a serial scheme advances them in this order.
    exchanges : all fields that go from one part to another.
    scheme : from :mod:`lcmchain.coupling.iteration.schemes`; belongs to this system.
    window : size of the windows [s], or its control.
    substeps : number of steps of a part in a window, by name; 1 where it is missing.
    prediction : order 0..2 of the extrapolation into a new window. A window that fails is repeated
        without extrapolation.
    on_failure : ``stop``, or ``go_on`` with a window that did not converge at its smallest size;
        the history records it.
    jumps : values between parts that change in jumps, besides the exchanges.
    inputs, outputs : fields that the system offers as a part; ``"part.field"`` always works.

    Raises
    ------
    InputError : parts, exchanges and scheme do not fit together.
    """

    def __init__(
        self,
        parts: Mapping[str, CoupledPart],
        exchanges: Sequence[Exchange],
        scheme: Scheme,
        *,
        window: WindowControl | float,
        substeps: Mapping[str, int] | None = None,
        prediction: int = 1,
        on_failure: Literal["stop", "go_on"] = "stop",
        jumps: Jumps | None = None,
        inputs: Mapping[str, Port] | None = None,
        outputs: Mapping[str, Port] | None = None,
    ) -> None:
        control = window if isinstance(window, WindowControl) else WindowControl(float(window))
        if on_failure not in ("stop", "go_on"):
            raise InputError('on_failure must be "stop" or "go_on"')
        if scheme.explicit and control.most > control.size and control.residual is None:
            raise InputError(
                "the windows of an explicit scheme can grow only by their coupling residual; give "
                "WindowControl(residual=...)"
            )
        self.parts, self.scheme, self.on_failure = dict(parts), scheme, on_failure
        self.inputs, self.outputs = dict(inputs or {}), dict(outputs or {})
        self._sweep = Sweep(
            self.parts,
            tuple(exchanges),
            scheme.order,
            dict(substeps or {}),
            [(p.part, p.field) for p in self.outputs.values() if p.of_step == "mean"],
        )
        self.exchanges = self._sweep.exchanges
        if not scheme.explicit and not self._sweep.unknown:
            raise InputError(
                f"no exchange closes a loop, so there is nothing for {scheme.name} to iterate; "
                "take an explicit scheme"
            )
        self.history = History(scheme.name, tuple(exchange.name for exchange in self.exchanges))
        self._windows = WindowSize(control)
        self._predictor = Predictor(prediction)
        self._iteration = Iteration(self._sweep, scheme, self.history)
        self._window_number = 0
        self._jumps = jumps
        # an explicit scheme with constant windows takes parts that cannot save their state
        self._can_return = not scheme.explicit or control.least < control.size or jumps is not None
        self._means: Fields = {}  # of the outputs that are means over the system's step
        times = {name: part.time for name, part in self.parts.items()}
        if len(set(times.values())) > 1:
            begins = ", ".join(f"{name} {time:g} s" for name, time in times.items())
            raise InputError(f"the parts do not begin at the same time: {begins}")
        self._time = next(iter(times.values()))

    # --- as a part --------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Return the present time [s], which all parts have reached."""
        return self._time

    def advance(self, step: float) -> None:
        """Go on by ``step`` [s] in windows.

        Raises
        ------
        NotConverged : a window did not converge; names exchange, value and place. The system is
            then at the begin of that window.
        SimulationError : a part failed at the smallest window; the system is at its begin likewise.
        """
        if not (step > 0.0 and math.isfinite(step)):
            raise InputError(f"a step must be positive, not {step:g} s")
        self.advance_to(self._time + step)

    def advance_to(
        self, end: float, on_window: Callable[[CoupledSystem], None] | None = None
    ) -> None:
        """Go on until ``end`` [s]; ``on_window`` is called after every accepted window.

        ``on_window`` may save the system: restored and advanced to the same end, it goes on
        bit-identically. An exception of ``on_window`` ends the run between two windows.

        Raises
        ------
        SimulationError : as :meth:`advance`.
        """
        if not self._predictor.started:
            self._predictor.accept(self._time, self._sweep.present())
            self._iteration.start(self._predictor.latest)
        begin = self._time
        sums: Fields = {}
        while self._time < end:
            size = self._windows.within(end - self._time)
            used = self._window(size, end)
            for name, values in self._sweep.means.items():
                sums[name] = sums.get(name, 0.0) + values * used
            if on_window is not None:
                on_window(self)
        self._means = {name: total / (end - begin) for name, total in sums.items()}

    def go_on_from(self, time: float) -> None:
        """Go on from a time [s] that all parts have reached by other means.

        The scheme forgets what it has learnt in earlier windows.
        """
        self._time = float(time)
        self._predictor = Predictor(self._predictor.order)
        self._iteration.forget()

    @property
    def exchanged(self) -> list[Values]:
        """Return the exchanged fields at the end of the last window, one array per exchange."""
        return self._predictor.latest

    def set_fields(self, fields: Mapping[str, Values]) -> None:
        """Set inputs of parts from outside: names of ports, or ``"part.field"``."""
        for name, values in fields.items():
            port = find_port(name, self.inputs, self.parts, "input")
            if (port.part, port.field) in self._sweep.targets:
                raise InputError(f'the input "{name}" is set by an exchange')
            self.parts[port.part].set_fields({port.field: values})

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs of parts: names of ports, or ``"part.field"``."""
        fields: Fields = {}
        for name in names:
            port = find_port(name, self.outputs, self.parts, "output")
            key = f"{port.part}.{port.field}"
            if port.of_step == "mean" and key in self._means:
                fields[name] = self._means[key].copy()
            else:
                fields[name] = self.parts[port.part].get_fields([port.field])[port.field]
        return fields

    def places(self, name: str) -> Values | None:
        """Return the positions (n, 3) [m] of a field's values where the part knows them."""
        known = {**self.inputs, **self.outputs}
        port = find_port(name, known, self.parts, "field")
        return self._sweep.places(port.part, port.field)

    def save(self) -> dict[str, Any]:
        """Return a copy of the whole state: parts, memory of the scheme, windows, history."""
        return {
            "parts": self._sweep.save(),
            "iteration": self._iteration.save(),
            "predictor": self._predictor.save(),
            "windows": self._windows.save(),
            "history": self.history.save(),
            "means": {name: values.copy() for name, values in self._means.items()},
            "time": (self._time, self._window_number),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Return to a saved state; going on from it is bit-identical."""
        self._sweep.restore(saved["parts"])
        self._iteration.restore(saved["iteration"])
        self._predictor.restore(saved["predictor"])
        self._windows.restore(saved["windows"])
        self.history.restore(saved["history"])
        self._means = {name: values.copy() for name, values in saved["means"].items()}
        self._time, self._window_number = saved["time"]

    # --- one window -------------------------------------------------------------------------------

    def _window(self, size: float, latest: float) -> float:
        """Compute one window, with smaller sizes as long as it fails; return the size [s]."""
        start, attempt = self._sweep.save() if self._can_return else {}, 0
        while True:
            # the last window ends exactly at the end, without a rounding error
            end = latest if size >= latest - self._time else self._time + size
            window = Window(
                self._window_number,
                attempt,
                size,
                end,
                self._predictor.latest,
                self._predictor.at(end) if attempt == 0 else self._predictor.held(),
                start,
            )
            tried, error = self._settled(window)
            # extrapolation over a jump may be the cause, so repeat without it before halving
            shorter = self._windows.shorter(size) if self._can_return else None
            extrapolated = attempt == 0 and self._predictor.extrapolates
            if error is not None and extrapolated and self._can_return:
                shorter = size
            outcome = self._outcome(tried, error, shorter is not None)
            self._record(window, tried, outcome, error)
            if tried is not None and outcome in STANDING:
                self._accept(window, tried)
                return size
            try:
                self._iteration.undo(window)
            except SimulationError:  # report what ended a part, not that it cannot go back then
                if error is None:
                    raise
                raise error  # noqa: B904  # its cause is kept
            if shorter is None:
                assert error is not None
                raise error
            if shorter < size:
                self._windows.shorten(shorter)
            size, attempt = shorter, attempt + 1

    def _settled(self, window: Window) -> tuple[Attempt | None, SimulationError | None]:
        """Repeat a window until values that change in jumps stay; see :meth:`_try`."""
        jumps, earlier, passes = self._jumps, 0, 0
        if jumps is None:
            return self._try(window)
        jumps.begin()
        while True:
            tried, error = self._try(window, earlier)
            if tried is None or error is not None:
                return tried, error
            earlier, passes = earlier + tried.iterations, passes + 1
            changing = jumps.follow()
            tried = replace(tried, iterations=earlier)
            if not changing:
                return tried, None
            if passes >= jumps.most_iterations:
                return tried, NotSettled(self._time, window.size, passes, changing)
            self._iteration.undo(window)

    def _try(
        self, window: Window, earlier: int = 0
    ) -> tuple[Attempt | None, SimulationError | None]:
        """Compute a window; return the attempt (None: a part failed) and the error, if any."""
        try:
            tried = self._iteration.attempt(window, earlier)
        except SimulationError as failure:
            if isinstance(failure, PartFailed) and math.isnan(failure.time):
                where = {"time": self._time, "step": window.size}
                failure = PartFailed(
                    failure.reason, part=failure.part, inputs=failure.inputs, **where
                )
            return None, failure
        if tried.converged:
            return tried, None
        return tried, not_converged(
            self.scheme.name,
            self._time,
            window.size,
            tried.iterations,
            self.scheme.most_iterations,
            self._sweep,
            tried.judgements,
        )

    def _outcome(
        self, tried: Attempt | None, error: SimulationError | None, can_shorten: bool
    ) -> int:
        """Return the outcome of an attempt, as the history records it."""
        if tried is not None and error is None:
            wanted = self._windows.control.residual
            if can_shorten and wanted is not None and tried.missed > 2.0 * wanted:
                return REJECTED
            return EXPLICIT if self.scheme.explicit else CONVERGED
        if tried is not None and not can_shorten and self.on_failure == "go_on":
            log.warning("%s; the run goes on", error)
            return ACCEPTED
        return FAILED

    def _accept(self, window: Window, tried: Attempt) -> None:
        self._iteration.accept(window, tried)
        self._predictor.accept(window.end, tried.answers)
        self._windows.follow(window.size, tried.iterations, tried.missed, self._predictor.order)
        self._time = window.end
        self._window_number += 1

    def _record(
        self,
        window: Window,
        tried: Attempt | None,
        outcome: int,
        error: SimulationError | None,
    ) -> None:
        if tried is not None:
            iterations, missed = tried.iterations, tried.missed
        else:  # a part failed in the iteration after the recorded ones
            now = (window.number, window.attempt)
            records = self.history.iterations
            iterations = 1 + sum((record.window, record.attempt) == now for record in records)
            missed = math.nan
        self.history.windows.append(
            WindowRecord(
                window.number,
                window.attempt,
                self._time,
                window.size,
                iterations,
                outcome,
                missed,
                "" if error is None else str(error),
            )
        )


# --- size of the windows --------------------------------------------------------------------------


@dataclass(frozen=True)
class WindowControl:
    """Control of the size of windows.

    Parameters
    ----------
    size : of the first window [s].
    smallest : least size of a window that is halved after a failure [s]; None: windows are not
        halved.
    largest : size up to which windows grow [s]; None: windows never grow beyond ``size``.
    few_iterations : a window with at most so many iterations is an easy one.
    patience : easy windows in a row before the size grows.
    grow : factor of growth.
    residual : wanted coupling residual: difference between a field and its prediction, over the
        field. It estimates the error of an explicit scheme, and the change of curvature in an
        implicit one. A window with more than twice of it is repeated, as long as ``smallest``
        allows. None: no control by the residual.
    """

    size: float
    smallest: float | None = None
    largest: float | None = None
    few_iterations: int = 5
    patience: int = 3
    grow: float = 1.5
    residual: float | None = None

    def __post_init__(self) -> None:
        if not (0.0 < self.size < math.inf):
            raise InputError(f"the size of a window must be positive, not {self.size:g} s")
        if not (0.0 < self.least <= self.size <= self.most < math.inf):
            raise InputError(
                f"a window of {self.size:g} s lies outside of smallest {self.least:g} s and "
                f"largest {self.most:g} s"
            )
        if not self.grow > 1.0:
            raise InputError(f"windows grow by a factor above 1, not {self.grow:g}")
        if self.residual is not None and not self.residual > 0.0:
            raise InputError(f"the coupling residual must be positive, not {self.residual:g}")

    @property
    def least(self) -> float:
        return self.size if self.smallest is None else self.smallest

    @property
    def most(self) -> float:
        return self.size if self.largest is None else self.largest


#: By how much windows may be longer than their size, relative to it, where rounding is to blame.
ROUNDING = 1e-8


@dataclass
class WindowSize:
    """The present size of the windows; belongs to one system."""

    control: WindowControl
    size: float = field(init=False)
    calm: int = field(default=0, init=False)  # easy windows in a row

    def __post_init__(self) -> None:
        self.size = self.control.size

    def within(self, remaining: float) -> float:
        """Return the size of the next window; equal windows fill what remains.

        They may exceed the size by rounding. The time is a sum over all windows before: its error
        in numbers of windows grows with their count, and so does what is taken for rounding.
        """
        return remaining / max(1, math.ceil(remaining / self.size * (1.0 - ROUNDING)))

    def shorter(self, used: float) -> float | None:
        """Return half of a window that failed, None where it is the smallest already."""
        smaller = max(0.5 * used, self.control.least)
        return smaller if smaller < used * (1.0 - 1e-9) else None

    def shorten(self, size: float) -> None:
        """Go on with shorter windows."""
        self.size, self.calm = size, 0

    def follow(self, used: float, iterations: int, missed: float, order: int) -> None:
        """Choose the next size after a window that was accepted."""
        control = self.control
        self.calm = self.calm + 1 if iterations <= control.few_iterations else 0
        size = self.size
        if self.calm >= control.patience:
            size, self.calm = size * control.grow, 0
        if control.residual is not None:
            # the error of an extrapolation grows with the power order + 1 of the size
            ratio = control.residual / max(missed, 1e-300)
            fitting = used * 0.9 * ratio ** (1.0 / (order + 1))
            size = min(size, fitting) if fitting < self.size else size
        self.size = min(max(size, control.least), control.most)

    def save(self) -> tuple[float, int]:
        """Return a copy of the memory."""
        return self.size, self.calm

    def restore(self, saved: tuple[float, int]) -> None:
        """Return to a saved memory."""
        self.size, self.calm = saved


# --- first guess in a window ----------------------------------------------------------------------


class Predictor:
    """Extrapolates the fields at the ends of the last windows by a polynomial.

    Windows may differ in size. With fewer windows the order is lower.

    Parameters
    ----------
    order : of the polynomial, 0, 1 or 2.
    """

    def __init__(self, order: int) -> None:
        if order not in (0, 1, 2):
            raise InputError(f"the order of extrapolation must be 0, 1 or 2, not {order}")
        self.order = order
        self._times: list[float] = []  # newest first
        self._values: list[list[Values]] = []

    @property
    def started(self) -> bool:
        return bool(self._times)

    @property
    def extrapolates(self) -> bool:
        """Whether there are enough windows for more than the last values."""
        return len(self._times) > 1

    @property
    def latest(self) -> list[Values]:
        """Return the fields at the end of the last window."""
        return self._values[0]

    def accept(self, time: float, values: list[Values]) -> None:
        """Take the fields (one array per exchange) at the end of a window."""
        self._times.insert(0, time)
        self._values.insert(0, [field.copy() for field in values])
        del self._times[self.order + 1 :], self._values[self.order + 1 :]

    def held(self) -> list[Values]:
        """Return the fields as they were at the end of the last window, new arrays."""
        return [field.copy() for field in self._values[0]]

    def at(self, time: float) -> list[Values]:
        """Return the fields extrapolated to ``time``, new arrays."""
        weights = _lagrange_weights(self._times, time)
        fields = []
        for number in range(len(self._values[0])):
            # relative to the newest value, so that a constant field stays bit-identical
            field = self._values[0][number].copy()
            for weight, values in zip(weights[1:], self._values[1:]):
                field += weight * (values[number] - self._values[0][number])
            fields.append(field)
        return fields

    def save(self) -> tuple[list[float], list[list[Values]]]:
        """Return a copy of the memory."""
        return list(self._times), [[field.copy() for field in row] for row in self._values]

    def restore(self, saved: tuple[list[float], list[list[Values]]]) -> None:
        """Return to a saved memory."""
        times, values = saved
        self._times, self._values = list(times), [[field.copy() for field in row] for row in values]


def _lagrange_weights(nodes: list[float], time: float) -> list[float]:
    """Return the weights of the values at ``nodes`` in their polynomial at ``time``; sum 1."""
    weights = []
    for i, here in enumerate(nodes):
        weight = 1.0
        for j, other in enumerate(nodes):
            if j != i:
                weight *= (time - other) / (here - other)
        weights.append(weight)
    return weights
