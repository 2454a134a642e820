"""A system of coupled parts: goes through windows of time until all exchanged fields agree."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.iteration.failure import NotConverged, not_converged
from lcmchain.coupling.iteration.history import (
    ACCEPTED,
    CONVERGED,
    EXPLICIT,
    FAILED,
    REJECTED,
    History,
    IterationRecord,
    WindowRecord,
)
from lcmchain.coupling.iteration.interface import CoupledPart, Exchange, Fields, PartFailed
from lcmchain.coupling.iteration.measures import Judgement, judge, rms
from lcmchain.coupling.iteration.predictor import Predictor
from lcmchain.coupling.iteration.schemes import Scheme
from lcmchain.coupling.iteration.sweep import Sweep
from lcmchain.coupling.iteration.windows import WindowControl, WindowSize
from lcmchain.errors import InputError, SimulationError

log = logging.getLogger(__name__)

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Port:
    """An input or output of a part that the system offers under a name of its own.

    ``of_step``: an output is the value at the ``end`` of the system's step or its ``mean``.
    """

    part: str
    field: str
    of_step: Literal["end", "mean"] = "end"


@dataclass(frozen=True)
class Attempt:
    """What came of going through a window: the last inputs and answers per exchange."""

    iterations: int
    inputs: list[Values]
    answers: list[Values]
    judgements: list[Judgement]
    converged: bool


class CoupledSystem:
    """Parts that exchange fields; satisfies :class:`CoupledPart` itself, so that systems nest.

    Parameters
    ----------
    parts : by name; a serial scheme advances them in this order.
    exchanges : all fields that go from one to another.
    scheme : from :mod:`lcmchain.coupling.iteration.schemes`; belongs to this system.
    window : size of the windows [s], or how it is led.
    substeps : into how many steps a part divides a window, 1 where it is not named.
    prediction : order 0..2 of the extrapolation into a new window.
    on_failure : ``stop``, or ``go_on`` with a window that did not converge at its smallest size;
        the history records it.
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
        self._scales = np.zeros(len(self.exchanges))
        self._accepted_windows = 0
        self._last_size = math.nan
        self._means: Fields = {}  # of the outputs that are means over the system's step
        times = {name: part.time for name, part in self.parts.items()}
        if len(set(times.values())) > 1:
            told = ", ".join(f"{name} {time:g} s" for name, time in times.items())
            raise InputError(f"the parts do not begin at the same time: {told}")
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
        NotConverged : a window did not converge; names exchange, value and place. The system then
            stands at the begin of that window.
        SimulationError : a part failed at the smallest window; the system stands as above.
        """
        if not (step > 0.0 and math.isfinite(step)):
            raise InputError(f"a step must be positive, not {step:g} s")
        if not self._predictor.started:
            self._predictor.accept(self._time, self._sweep.present())
            self._scales = np.array([rms(field) for field in self._predictor.latest])
        begin, end = self._time, self._time + step
        sums: Fields = {}
        while self._time < end:
            size = self._windows.within(end - self._time)
            last = size >= end - self._time
            used = self._window(size, end if last else self._time + size)
            for name, values in self._sweep.means.items():
                sums[name] = sums.get(name, 0.0) + values * used
        self._means = {name: total / (end - begin) for name, total in sums.items()}

    def set_fields(self, fields: Mapping[str, Values]) -> None:
        """Set inputs of parts from outside: names of ports, or ``"part.field"``."""
        for name, values in fields.items():
            port = self._port(name, self.inputs, "input")
            if (port.part, port.field) in self._sweep.targets:
                raise InputError(f'the input "{name}" is set by an exchange')
            self.parts[port.part].set_fields({port.field: values})

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs of parts: names of ports, or ``"part.field"``."""
        found: Fields = {}
        for name in names:
            port = self._port(name, self.outputs, "output")
            key = f"{port.part}.{port.field}"
            if port.of_step == "mean" and key in self._means:
                found[name] = self._means[key].copy()
            else:
                found[name] = self.parts[port.part].get_fields([port.field])[port.field]
        return found

    def places(self, name: str) -> Values | None:
        """Return the positions (n, 3) of a field's values where the part knows them."""
        known = {**self.inputs, **self.outputs}
        port = self._port(name, known, "field")
        return self._sweep.places(port.part, port.field)

    def save(self) -> Any:
        """Return a copy of the whole state: parts, memory of the scheme, windows, history."""
        acceleration = self.scheme.acceleration
        return {
            "parts": {name: part.save() for name, part in self.parts.items()},
            "acceleration": None if acceleration is None else acceleration.save(),
            "predictor": self._predictor.save(),
            "windows": self._windows.save(),
            "history": self.history.save(),
            "scales": self._scales.copy(),
            "means": {name: values.copy() for name, values in self._means.items()},
            "time": (self._time, self._last_size, self._accepted_windows),
        }

    def restore(self, saved: Any) -> None:
        """Return to a saved state; going on from it is bit-identical."""
        for name, part in self.parts.items():
            part.restore(saved["parts"][name])
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.restore(saved["acceleration"])
        self._predictor.restore(saved["predictor"])
        self._windows.restore(saved["windows"])
        self.history.restore(saved["history"])
        self._scales = saved["scales"].copy()
        self._means = {name: values.copy() for name, values in saved["means"].items()}
        self._time, self._last_size, self._accepted_windows = saved["time"]

    # --- one window -------------------------------------------------------------------------------

    def _window(self, size: float, end: float) -> float:
        """Go through one window, shorter and shorter ones if it fails; return the size."""
        start = {name: part.save() for name, part in self.parts.items()}
        attempt_number = 0
        while True:
            error: SimulationError | None = None
            tried: Attempt | None = None
            predicted = self._predictor.at(end)
            self._begin(size)
            try:
                tried = self._iterate(attempt_number, end, predicted, start)
                if not tried.converged:
                    error = self._complaint(tried, size)
            except SimulationError as failure:
                error = self._named(failure, size)
            missed = math.inf if tried is None else self._missed(predicted, tried.answers)
            if tried is not None and error is None:
                if not self._windows.reject(size, missed):
                    outcome = EXPLICIT if self.scheme.explicit else CONVERGED
                    break
                outcome, reason = REJECTED, f"coupling residual {missed:.3g}"
            else:
                outcome, reason = FAILED, str(error)
                if not self._windows.shorten(size):
                    if tried is not None and self.on_failure == "go_on":
                        log.warning("%s; the run goes on", error)
                        outcome = ACCEPTED
                        break
                    self._undo(start)
                    self._record(attempt_number, size, tried, FAILED, missed, reason)
                    raise error if error is not None else AssertionError
            self._record(attempt_number, size, tried, outcome, missed, reason)
            self._undo(start)
            attempt_number += 1
            size = self._windows.size
            end = self._time + size
        self._accept(attempt_number, size, end, tried, outcome, missed)
        return size

    def _begin(self, size: float) -> None:
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            # Rates answer to values divided by the window's size, so old differences mislead.
            if not abs(size - self._last_size) <= 0.1 * self._last_size:
                acceleration.forget()
            acceleration.begin_window()

    def _iterate(
        self, attempt: int, end: float, predicted: list[Values], start: dict[str, Any]
    ) -> Attempt:
        """Evaluate the parts until all fields agree or the iterations are used up."""
        begin = self._predictor.latest
        inputs, before = predicted, predicted
        unknown, acceleration = self._sweep.unknown, self.scheme.acceleration
        for iteration in range(1, self.scheme.most_iterations + 1):
            if iteration > 1:
                self._restore_parts(start)
            answers = self._sweep.evaluate(end, begin, inputs)
            if iteration == 1:
                first = [rms(field) for field in answers]
            # An unknown is judged by what its parts answer to it, others by their last answer.
            judgements = [
                judge(
                    inputs[i] if i in unknown else before[i],
                    answers[i],
                    begin[i],
                    self._sweep.tolerance(i) if acceleration is not None else None,
                    self._scales[i],
                )
                for i in range(len(self.exchanges))
            ]
            converged = all(judgement.converged for judgement in judgements)
            done = converged or acceleration is None or iteration == self.scheme.most_iterations
            proposal = None if done else self._propose(inputs, answers, first)
            self._note(attempt, iteration, judgements)
            if proposal is None:
                break
            inputs, before = proposal, answers
        return Attempt(iteration, inputs, answers, judgements, converged)

    def _propose(
        self, inputs: list[Values], answers: list[Values], first: list[float]
    ) -> list[Values]:
        """Return the next inputs per exchange; ``first``: sizes of the window's first answers."""
        acceleration, unknown = self.scheme.acceleration, self._sweep.unknown
        assert acceleration is not None
        x, answer = self._packed(inputs), self._packed(answers)
        proposed = acceleration.propose(x, answer, self._weights(answers, first))
        following, at = list(answers), 0
        for i in unknown:
            part = proposed[at : at + answers[i].size]
            at += answers[i].size
            relaxation = self.exchanges[i].relaxation
            following[i] = inputs[i] + relaxation * (part - inputs[i])
        return following

    def _packed(self, fields: list[Values]) -> Values:
        return np.concatenate([fields[i] for i in self._sweep.unknown])

    def _weights(self, fields: list[Values], first: list[float]) -> Values:
        """Return the weights (n,) that give all unknown fields the same size."""
        # Sizes come from windows that stand; answers on the way may be far too large.
        weights = []
        for i in self._sweep.unknown:
            count = fields[i].size
            scale = self.exchanges[i].scale or self._scales[i] or first[i] or 1.0
            weights.append(np.full(count, 1.0 / (scale * math.sqrt(max(count, 1)))))
        return np.concatenate(weights)

    def _missed(self, predicted: list[Values], answers: list[Values]) -> float:
        """Return the largest coupling residual of a judged exchange, relative to its field."""
        shares = [0.0]
        for i, exchange in enumerate(self.exchanges):
            scale = exchange.scale or self._scales[i] or rms(answers[i])
            if exchange.tolerance is not None and scale > 0.0:
                shares.append(rms(answers[i] - predicted[i]) / scale)
        return max(shares)

    # --- the end of a window ----------------------------------------------------------------------

    def _accept(
        self,
        attempt: int,
        size: float,
        end: float,
        tried: Attempt,
        outcome: int,
        missed: float,
    ) -> None:
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            if outcome == CONVERGED:
                acceleration.end_window(self._packed(tried.inputs), self._packed(tried.answers))
            else:
                acceleration.drop_window()
        self._record(attempt, size, tried, outcome, missed)
        self._predictor.accept(end, tried.answers)
        self._scales = np.maximum(self._scales, [rms(field) for field in tried.answers])
        self._windows.follow(size, tried.iterations, missed, self._predictor.order)
        self._time, self._last_size = end, size
        self._accepted_windows += 1

    def _undo(self, start: dict[str, Any]) -> None:
        self._restore_parts(start)
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.drop_window()

    def _restore_parts(self, start: dict[str, Any]) -> None:
        for name, part in self.parts.items():
            part.restore(start[name])

    def _note(self, attempt: int, iteration: int, judgements: list[Judgement]) -> None:
        acceleration = self.scheme.acceleration
        self.history.iterations.append(
            IterationRecord(
                self._accepted_windows,
                attempt,
                iteration,
                tuple(judgement.residual for judgement in judgements),
                tuple(judgement.size for judgement in judgements),
                tuple(judgement.limit for judgement in judgements),
                math.nan if acceleration is None else acceleration.factor,
                0 if acceleration is None else acceleration.rank,
            )
        )

    def _record(
        self,
        attempt: int,
        size: float,
        tried: Attempt | None,
        outcome: int,
        missed: float,
        reason: str = "",
    ) -> None:
        if tried is None:  # a part failed; its iterations are those noted
            now = (self._accepted_windows, attempt)
            notes = self.history.iterations
            iterations = 1 + sum((note.window, note.attempt) == now for note in notes)
        else:
            iterations = tried.iterations
        self.history.windows.append(
            WindowRecord(
                self._accepted_windows,
                attempt,
                self._time,
                size,
                iterations,
                outcome,
                missed,
                reason,
            )
        )

    def _complaint(self, tried: Attempt, size: float) -> NotConverged | None:
        if self.scheme.explicit:
            return None
        return not_converged(
            self.scheme.name, self._time, size, tried.iterations, self._sweep, tried.judgements
        )

    def _named(self, failure: SimulationError, size: float) -> SimulationError:
        """Return the failure of a part with the time of the window where it lacks it."""
        if isinstance(failure, PartFailed) and math.isnan(failure.time):
            return PartFailed(
                failure.reason,
                part=failure.part,
                time=self._time,
                step=size,
                inputs=failure.inputs,
            )
        return failure

    def _port(self, name: str, ports: Mapping[str, Port], kind: str) -> Port:
        if name in ports:
            return ports[name]
        part, _, field = name.partition(".")
        if part in self.parts and field:
            return Port(part, field)
        known = ", ".join([*ports, *(f"{part}.<field>" for part in self.parts)])
        raise InputError(f'the coupled system has no {kind} "{name}"; there are {known}')
