"""Going through one window: the parts are evaluated until all exchanged fields agree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.iteration.history import History, IterationRecord
from lcmchain.coupling.iteration.measures import Judgement, judge, rms
from lcmchain.coupling.iteration.schemes import Scheme
from lcmchain.coupling.iteration.sweep import Sweep

Values = NDArray[np.float64]

#: An iteration is given up when a residual has grown by this factor, over the field's size too.
HOPELESS = 1e12


@dataclass(frozen=True)
class Window:
    """What is known before a window: its number, its attempt, its end and the fields.

    ``begin`` and ``predicted`` hold one array per exchange, at its begin and extrapolated to its
    end; ``start`` the saved states of the parts, empty where nothing returns to them.
    """

    number: int
    attempt: int
    size: float
    end: float
    begin: list[Values]
    predicted: list[Values]
    start: dict[str, Any]


@dataclass(frozen=True)
class Attempt:
    """What came of going through a window: the last inputs and answers per exchange."""

    iterations: int
    inputs: list[Values]
    answers: list[Values]
    judgements: list[Judgement]
    converged: bool
    missed: float  # largest coupling residual of a judged exchange, relative to its field


class Iteration:
    """A scheme at work on parts; keeps what it learns from window to window."""

    def __init__(self, sweep: Sweep, scheme: Scheme, history: History) -> None:
        self.sweep, self.scheme, self.history = sweep, scheme, history
        self._scales = np.zeros(len(sweep.exchanges))  # largest size in windows that stand
        self._last_size = math.nan

    def start(self, fields: list[Values]) -> None:
        """Take the fields at the begin of the first window."""
        self._scales = np.array([rms(field) for field in fields])

    def attempt(self, window: Window, earlier: int = 0) -> Attempt:
        """Evaluate the parts until all fields agree or the iterations are used up.

        Parameters
        ----------
        earlier : iterations that this attempt at the window has already had.

        Raises
        ------
        SimulationError : a part failed.
        """
        scheme, sweep = self.scheme, self.sweep
        acceleration = scheme.acceleration
        self._begin(window.size)
        inputs = window.predicted if scheme.explicit else self._bounded(window.predicted)
        before = inputs
        sizes = [0.0] * len(sweep.exchanges)
        first: list[float] = []  # residuals of the first iteration
        for iteration in range(1, scheme.most_iterations + 1):
            if iteration > 1:
                sweep.restore(window.start)
            answers = sweep.evaluate(window.end, window.begin, inputs)
            sizes = [_least(size, rms(field)) for size, field in zip(sizes, answers)]
            judgements = self._judge(inputs, before, answers, window.begin)
            converged = all(judgement.converged for judgement in judgements)
            residuals = [judgement.residual for judgement in judgements]
            first = residuals if iteration == 1 else first
            known = np.maximum(first, self._scales)
            hopeless = any(now > HOPELESS * then > 0.0 for now, then in zip(residuals, known))
            last = iteration == scheme.most_iterations or hopeless
            done = converged or acceleration is None or last
            proposal = None if done else self._propose(inputs, answers, sizes)
            self._note(window, earlier + iteration, judgements)
            if proposal is None:
                break
            inputs, before = proposal, answers
        missed = self._missed(window.predicted, answers)
        return Attempt(iteration, inputs, answers, judgements, converged, missed)

    def undo(self, window: Window) -> None:
        """Return to the begin of a window and forget what it taught."""
        if window.start:
            self.sweep.restore(window.start)
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.drop_window()

    def accept(self, window: Window, attempt: Attempt) -> None:
        """Keep what a window taught."""
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            if attempt.converged:
                acceleration.end_window(self._packed(attempt.inputs), self._packed(attempt.answers))
            else:
                acceleration.drop_window()
        self._scales = np.maximum(self._scales, [rms(field) for field in attempt.answers])
        self._last_size = window.size

    def forget(self) -> None:
        """Forget what windows have taught."""
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.forget()

    def save(self) -> Any:
        """Return a copy of the memory."""
        acceleration = self.scheme.acceleration
        learnt = None if acceleration is None else acceleration.save()
        return learnt, self._scales.copy(), self._last_size

    def restore(self, saved: Any) -> None:
        """Return to a saved memory."""
        learnt, scales, self._last_size = saved
        self._scales = scales.copy()
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.restore(learnt)

    def _begin(self, size: float) -> None:
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            # Rates answer to values divided by the window's size, so old differences mislead.
            if not abs(size - self._last_size) <= 0.1 * self._last_size:
                acceleration.forget()
            acceleration.begin_window()

    def _judge(
        self,
        inputs: list[Values],
        before: list[Values],
        answers: list[Values],
        begin: list[Values],
    ) -> list[Judgement]:
        """Judge an unknown by what its parts answer to it, other fields by their last answer."""
        sweep, explicit = self.sweep, self.scheme.explicit
        return [
            judge(
                inputs[i] if i in sweep.unknown else before[i],
                answers[i],
                begin[i],
                None if explicit else sweep.tolerance(i),
                float(self._scales[i]),
            )
            for i in range(len(sweep.exchanges))
        ]

    def _propose(
        self, inputs: list[Values], answers: list[Values], sizes: list[float]
    ) -> list[Values]:
        """Return the next inputs per exchange; ``sizes``: the least of each field so far."""
        acceleration = self.scheme.acceleration
        assert acceleration is not None
        x, answer = self._packed(inputs), self._packed(answers)
        proposed = acceleration.propose(x, answer, self._weights(answers, sizes))
        following, at = list(answers), 0
        for i in self.sweep.unknown:
            part = proposed[at : at + answers[i].size]
            at += answers[i].size
            exchange = self.sweep.exchanges[i]
            following[i] = inputs[i] + exchange.relaxation * (part - inputs[i])
        return self._bounded(following)

    def _bounded(self, fields: list[Values]) -> list[Values]:
        """Return the fields with the unknowns among them within their bounds."""
        bounded = list(fields)
        for i in self.sweep.unknown:
            bounds = self.sweep.exchanges[i].bounds
            if bounds is not None:
                bounded[i] = np.clip(fields[i], *bounds)
        return bounded

    def _packed(self, fields: list[Values]) -> Values:
        return np.concatenate([fields[i] for i in self.sweep.unknown])

    def _weights(self, fields: list[Values], sizes: list[float]) -> Values:
        """Return the weights (n,) that give all unknown fields the same size."""
        # Sizes come from windows that stand; answers on the way may be far too large.
        weights = []
        for i in self.sweep.unknown:
            count = fields[i].size
            scale = self.sweep.exchanges[i].scale or self._scales[i] or sizes[i] or 1.0
            weights.append(np.full(count, 1.0 / (scale * math.sqrt(max(count, 1)))))
        return np.concatenate(weights)

    def _missed(self, predicted: list[Values], answers: list[Values]) -> float:
        shares = [0.0]
        for i, exchange in enumerate(self.sweep.exchanges):
            scale = exchange.scale or self._scales[i] or rms(answers[i])
            if exchange.tolerance is not None and scale > 0.0:
                shares.append(rms(answers[i] - predicted[i]) / float(scale))
        return max(shares)

    def _note(self, window: Window, iteration: int, judgements: list[Judgement]) -> None:
        acceleration = self.scheme.acceleration
        self.history.iterations.append(
            IterationRecord(
                window.number,
                window.attempt,
                iteration,
                tuple(judgement.residual for judgement in judgements),
                tuple(judgement.size for judgement in judgements),
                tuple(judgement.limit for judgement in judgements),
                math.nan if acceleration is None else acceleration.factor,
                0 if acceleration is None else acceleration.rank,
            )
        )


def _least(one: float, other: float) -> float:
    """Return the smaller of two sizes that is not 0, if one is not."""
    return min(one, other) if one > 0.0 and other > 0.0 else max(one, other)
