"""One window: the parts are evaluated until all exchanged fields agree.

Each evaluation is followed by a judgement on every field. The error of a window that does not
converge names the field, the place and the excess.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.coupling.iteration.history import History, IterationRecord
from lcmchain.coupling.iteration.interface import Exchange, Tolerance, Values
from lcmchain.coupling.iteration.schemes import Scheme
from lcmchain.coupling.iteration.sweep import Sweep
from lcmchain.errors import SimulationError

#: Growth of a residual, over its first value, its limit and the size of the field, that ends an
#: iteration.
HOPELESS = 1e12


@dataclass(frozen=True)
class Window:
    """A window before it is computed.

    Parameters
    ----------
    number, attempt : count from 0.
    size, end : [s].
    begin, predicted : fields at its begin and extrapolated to its end, one array per exchange.
    start : saved states of the parts at its begin, by name; empty where nothing returns to them.
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
    """Result of an attempt at a window, with the last inputs and answers per exchange.

    missed : largest difference between answer and prediction of a judged exchange, over its field.
    """

    iterations: int
    inputs: list[Values]
    answers: list[Values]
    judgements: list[Judgement]
    converged: bool
    missed: float


class Iteration:
    """A scheme applied to parts; keeps its memory from window to window."""

    def __init__(self, sweep: Sweep, scheme: Scheme, history: History) -> None:
        self.sweep, self.scheme, self.history = sweep, scheme, history
        self._scales = np.zeros(len(sweep.exchanges))  # largest size in accepted windows
        self._last_size = math.nan

    def start(self, fields: list[Values]) -> None:
        """Take the sizes of the fields at the begin of the first window."""
        self._scales = np.array([rms(field) for field in fields])

    def attempt(self, window: Window, earlier: int = 0) -> Attempt:
        """Evaluate the parts until all fields agree or the iterations are used up.

        Parameters
        ----------
        earlier : iterations that this attempt at the window already had.

        Raises
        ------
        SimulationError : a part failed.
        """
        scheme, sweep = self.scheme, self.sweep
        acceleration = scheme.acceleration
        self._begin(window.size)
        inputs = window.predicted if scheme.explicit else self._bounded(window.predicted)
        before = inputs
        sizes = [0.0] * len(sweep.exchanges)  # least of each field so far
        first: list[Judgement] = []  # of the first iteration
        for iteration in range(1, scheme.most_iterations + 1):
            if iteration > 1:
                sweep.restore(window.start)
            answers = sweep.evaluate(window.end, window.begin, inputs)
            sizes = [_least(size, rms(field)) for size, field in zip(sizes, answers)]
            judgements = self._judge(inputs, before, answers, window.begin)
            converged = all(judgement.converged for judgement in judgements)
            first = judgements if iteration == 1 else first
            hopeless = self._is_hopeless(judgements, first)
            last = iteration == scheme.most_iterations or hopeless
            done = converged or acceleration is None or last
            proposal = None if done else self._propose(inputs, answers, sizes)
            self._note(window, earlier + iteration, judgements)
            if proposal is None:
                break
            inputs, before = proposal, answers
        missed = self._missed(window.predicted, answers)
        return Attempt(iteration, inputs, answers, judgements, converged, missed)

    def _is_hopeless(self, judgements: list[Judgement], first: list[Judgement]) -> bool:
        """Tell whether a judged field grows beyond all bounds.

        A field that need not converge has an infinite limit and tells nothing: from rounding it may
        grow to its size in one iteration, as a pressure does when a gate opens.

        first : judgements of the first iteration.
        """
        return any(
            now.residual > HOPELESS * max(then.residual, then.limit, scale) > 0.0
            for now, then, scale in zip(judgements, first, self._scales)
        )

    def undo(self, window: Window) -> None:
        """Return to the begin of a window and forget what the scheme learnt in it."""
        if window.start:
            self.sweep.restore(window.start)
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.drop_window()

    def accept(self, window: Window, attempt: Attempt) -> None:
        """Keep what the scheme learnt in a window."""
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            if attempt.converged:
                acceleration.end_window(self._packed(attempt.inputs), self._packed(attempt.answers))
            else:
                acceleration.drop_window()
        self._scales = np.maximum(self._scales, [rms(field) for field in attempt.answers])
        self._last_size = window.size

    def forget(self) -> None:
        """Forget what the scheme has learnt."""
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.forget()

    def save(self) -> tuple[Any, Values, float]:
        """Return a copy of the memory; that of the acceleration is of its own kind."""
        acceleration = self.scheme.acceleration
        learnt = None if acceleration is None else acceleration.save()
        return learnt, self._scales.copy(), self._last_size

    def restore(self, saved: tuple[Any, Values, float]) -> None:
        """Return to a saved memory."""
        learnt, scales, self._last_size = saved
        self._scales = scales.copy()
        if self.scheme.acceleration is not None:
            self.scheme.acceleration.restore(learnt)

    def _begin(self, size: float) -> None:
        acceleration = self.scheme.acceleration
        if acceleration is not None:
            # rates depend on the size of the window, so differences of another size mislead
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
        """Judge an unknown by the answer to it, other fields by their last answer."""
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
        """Return the next inputs per exchange.

        sizes : least size of each field so far.
        """
        acceleration = self.scheme.acceleration
        assert acceleration is not None
        x, answer = self._packed(inputs), self._packed(answers)
        proposed = acceleration.propose(x, answer, self._weights(answers, sizes))
        following, at = list(answers), 0
        for i in self.sweep.unknown:
            field = proposed[at : at + answers[i].size]
            at += answers[i].size
            exchange = self.sweep.exchanges[i]
            following[i] = inputs[i] + exchange.relaxation * (field - inputs[i])
        return self._bounded(following)

    def _bounded(self, fields: list[Values]) -> list[Values]:
        """Return the fields, the unknowns among them limited to their bounds."""
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
        # sizes of accepted windows, because answers on the way may be far too large
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


# --- judgement: has an exchanged field converged, and where least ---------------------------------


@dataclass(frozen=True)
class Judgement:
    """Residual of one exchange in one iteration against its limit.

    Parameters
    ----------
    residual, size : of the field, in its unit.
    limit : largest residual of a converged field; infinite where it need not converge.
    worst : number of the value that changed most.
    worst_residual : its change.
    """

    residual: float
    size: float
    limit: float
    worst: int
    worst_residual: float

    @property
    def converged(self) -> bool:
        return self.residual <= self.limit


def rms(values: Values) -> float:
    """Return the root mean square, 0 of no values."""
    if values.size == 0:
        return 0.0
    largest = float(np.abs(values).max())
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    return largest * float(np.sqrt(np.mean((values / largest) ** 2)))  # squares never overflow


def largest_size(values: Values) -> float:
    """Return the largest absolute value, 0 of no values."""
    return float(np.abs(values).max()) if values.size else 0.0


def judge(
    before: Values, now: Values, start: Values, tolerance: Tolerance | None, scale: float
) -> Judgement:
    """Judge the change of a field (n,) in an iteration.

    Parameters
    ----------
    before, now : the field before and after the iteration.
    start : the field at the begin of the window.
    scale : largest size that the field has had.
    """
    norm = largest_size if tolerance is not None and tolerance.norm == "largest" else rms
    change = now - before
    size = norm(now)
    worst = int(np.abs(change).argmax()) if change.size else 0
    worst_residual = float(abs(change[worst])) if change.size else 0.0
    limit = np.inf
    if tolerance is not None:
        limits = [np.inf]
        if tolerance.relative is not None:
            limits.append(tolerance.relative * size)
        if tolerance.increment is not None:
            limits.append(tolerance.increment * norm(now - start))
        limit = min(limits)
        if tolerance.absolute is not None:
            limit = tolerance.absolute if np.isinf(limit) else max(limit, tolerance.absolute)
        limit = max(limit, tolerance.floor * scale)
    return Judgement(norm(change), size, float(limit), worst, worst_residual)


# --- errors of a window that does not converge ----------------------------------------------------


class NotConverged(SimulationError):
    """The exchanged fields of a window do not agree after the allowed iterations.

    Parameters
    ----------
    finding : what does not agree, where and by how much, in words.
    remedies : what helps, in words.
    exchange : name of the exchange that is worst.
    value : number of its worst value on the target's mesh.
    residual, limit : reached and allowed, in the field's unit.
    """

    def __init__(
        self,
        finding: str,
        remedies: str,
        *,
        exchange: str,
        value: int,
        residual: float,
        limit: float,
    ) -> None:
        self.finding = finding
        self.exchange, self.value = exchange, value
        self.residual, self.limit = residual, limit
        super().__init__(f"{finding} {remedies}")

    def with_remedies(self, remedies: str) -> NotConverged:
        """Return the same error with the remedies of one that knows which parts are coupled."""
        return NotConverged(
            self.finding,
            remedies,
            exchange=self.exchange,
            value=self.value,
            residual=self.residual,
            limit=self.limit,
        )


class NotSettled(SimulationError):
    """Values that change in jumps do not come to rest in a window after the allowed iterations.

    Parameters
    ----------
    time, size : begin and size of the window [s].
    changing : what the last iteration has changed, in words.
    """

    def __init__(self, time: float, size: float, iterations: int, changing: list[str]) -> None:
        self.changing = changing
        super().__init__(
            f"what changes in jumps does not come to rest in {iterations} iterations of the window "
            f"of {size:g} s from {time:g} s: {'; '.join(changing)}"
        )


def not_converged(
    scheme: str,
    time: float,
    size: float,
    iterations: int,
    most_iterations: int,
    sweep: Sweep,
    judgements: list[Judgement],
) -> NotConverged:
    """Return the error of a window that begins at ``time`` [s]; it names the worst exchange."""

    def excess(number: int) -> float:
        judgement = judgements[number]
        return judgement.residual / judgement.limit if judgement.limit > 0.0 else float("inf")

    failing = [i for i, judgement in enumerate(judgements) if not judgement.converged]
    failing.sort(key=lambda i: -excess(i))
    worst = failing[0]
    judgement, exchange = judgements[worst], sweep.exchanges[worst]
    position = _position_text(sweep, exchange, judgement.worst)
    others = [sweep.exchanges[i].name for i in failing[1:]]
    also = f" Also not converged: {', '.join(others)}." if others else ""
    diverged = "did not converge" if iterations == most_iterations else "diverged"
    finding = (
        f"the coupling {diverged} ({scheme}) in {iterations} iterations of the window of "
        f"{size:g} s from {time:g} s: {exchange.name} still changes by {judgement.residual:.3g} "
        f"where {judgement.limit:.3g} is allowed ({excess(worst):.3g} times), most at value "
        f"{judgement.worst}{position} by {judgement.worst_residual:.3g}.{also}"
    )
    return NotConverged(
        finding,
        "Likely cause: the parts answer to each other more strongly than the scheme can follow. "
        "Remedies: IQN-ILS in place of a relaxation, the fixed-stress split between solid and "
        "fluid, more iterations; smaller windows (WindowControl(smallest=...)) where the fields "
        "answer to each other the less the shorter a window is, which the pressure of an "
        "incompressible fluid does not",
        exchange=exchange.name,
        value=judgement.worst,
        residual=judgement.residual,
        limit=judgement.limit,
    )


def _position_text(sweep: Sweep, exchange: Exchange, value: int) -> str:
    """Return the position of a value in mm, by the target or, on the same mesh, the source."""
    sides = [(exchange.target, exchange.input)]
    if exchange.mapping is None:
        sides.append((exchange.source, exchange.field))
    for part, field in sides:
        places = sweep.places(part, field)
        if places is not None and value < len(places):
            x, y, z = 1e3 * places[value]
            return f" near ({x:.2f}, {y:.2f}, {z:.2f}) mm"
    return ""
