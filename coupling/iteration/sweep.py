"""One evaluation of all parts over a window: from inputs to answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lcmchain.coupling.iteration.interface import (
    CoupledPart,
    Exchange,
    Fields,
    HasPlaces,
    PartFailed,
    Tolerance,
    Values,
)
from lcmchain.errors import InputError, SimulationError


class Sweep:
    """Parts and exchanges in their order; knows which exchanges are unknowns of an iteration.

    In a serial order these are the exchanges that lead back, to the part itself or one before it.
    In a parallel order these are all exchanges.

    Parameters
    ----------
    parts : by name, in the order in which they advance.
    exchanges : see :class:`Exchange`.
    order : ``serial`` or ``parallel``.
    substeps : number of steps of a part in a window, by name; 1 where it is missing.
    watched : further (part, field) whose mean over the window is kept.
    """

    def __init__(
        self,
        parts: Mapping[str, CoupledPart],
        exchanges: tuple[Exchange, ...],
        order: str,
        substeps: Mapping[str, int],
        watched: Sequence[tuple[str, str]] = (),
    ) -> None:
        self.parts, self.exchanges, self.substeps = parts, exchanges, substeps
        self._check()
        turn = {name: number for number, name in enumerate(parts)}
        self._forward = frozenset(
            i
            for i, exchange in enumerate(exchanges)
            if order == "serial" and turn[exchange.source] < turn[exchange.target]
        )
        self.unknown = tuple(i for i in range(len(exchanges)) if i not in self._forward)
        self.targets = {(exchange.target, exchange.input) for exchange in exchanges}
        for i, exchange in enumerate(exchanges):
            if not exchange.iterated and i not in self._forward:
                raise InputError(
                    f"{exchange.name} only accompanies others (iterated=False), so it must lead "
                    f'forward: take a serial scheme and name "{exchange.source}" before '
                    f'"{exchange.target}"'
                )
        self._watched = tuple(watched)
        #: Means over the last window of the watched fields, by "part.field".
        self.means: Fields = {}

    def tolerance(self, number: int) -> Tolerance | None:
        """Return the tolerance of an exchange in this order, None where it need not converge."""
        exchange = self.exchanges[number]
        judged = number in self.unknown or exchange.judged == "always"
        return exchange.tolerance if judged else None

    def present(self) -> list[Values]:
        """Return the present fields of all exchanges on the targets' meshes."""
        return [
            self._answer(exchange, self._get(exchange.source, [exchange.field])[exchange.field])
            for exchange in self.exchanges
        ]

    def evaluate(self, end: float, begin: list[Values], inputs: list[Values]) -> list[Values]:
        """Advance all parts to ``end`` and return their answers, one array per exchange.

        Parameters
        ----------
        begin : the fields at the begin of the window.
        inputs : the fields at its end, for parts that do not see a new answer.

        Raises
        ------
        SimulationError : a part failed, or a value of its answer is no number.
        """
        given, answers = list(inputs), list(inputs)
        for name in self.parts:
            fields, means = self._advance(name, end, begin, given)
            for i, exchange in enumerate(self.exchanges):
                if exchange.source == name:
                    source = means if exchange.of_window == "mean" else fields
                    answers[i] = self._answer(exchange, source[exchange.field])
                    if i in self._forward:
                        given[i] = answers[i]
            for part, field in self._watched:
                if part == name:
                    self.means[f"{part}.{field}"] = means[field]
        return answers

    def save(self) -> dict[str, Any]:
        """Return a copy of the states of all parts."""
        return {name: part.save() for name, part in self.parts.items()}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Return all parts to saved states."""
        for name, part in self.parts.items():
            part.restore(saved[name])

    def places(self, part: str, field: str) -> Values | None:
        """Return the positions (n, 3) [m] of a field's values, None where the part has none."""
        owner = self.parts[part]
        return owner.places(field) if isinstance(owner, HasPlaces) else None

    def _advance(
        self, name: str, end: float, begin: list[Values], given: list[Values]
    ) -> tuple[Fields, Fields]:
        """Advance one part in its sub-steps; return its fields at the end and their means."""
        part, count = self.parts[name], self.substeps.get(name, 1)
        incoming = [i for i, exchange in enumerate(self.exchanges) if exchange.target == name]
        outgoing = [exchange for exchange in self.exchanges if exchange.source == name]
        outputs = list(dict.fromkeys(exchange.field for exchange in outgoing))
        averaged = [exchange.field for exchange in outgoing if exchange.of_window == "mean"]
        averaged += [field for owner, field in self._watched if owner == name]
        sums: Fields = {}
        start = part.time
        for number in range(1, count + 1):
            inputs = {
                self.exchanges[i].input: self._within(i, number / count, begin, given)
                for i in incoming
            }
            step = (end - part.time) / (count - number + 1)
            self._step(name, inputs, step)
            for field, values in self._get(name, list(dict.fromkeys(averaged))).items():
                sums[field] = sums.get(field, 0.0) + values * step
        if not math.isclose(part.time, end, rel_tol=1e-9, abs_tol=1e-9 * (end - start)):
            raise PartFailed(f"it stands at {part.time!r} s instead of {end!r} s", part=name)
        return self._get(name, outputs), {key: sums[key] / (end - start) for key in sums}

    def _within(
        self, number: int, fraction: float, begin: list[Values], given: list[Values]
    ) -> Values:
        """Return the values of an exchange at a fraction of the window."""
        if self.exchanges[number].within == "held" or fraction == 1.0:
            return given[number]
        return begin[number] + fraction * (given[number] - begin[number])

    def _step(self, name: str, inputs: Fields, step: float) -> None:
        part = self.parts[name]
        begin = part.time
        try:
            if inputs:
                part.set_fields(inputs)
            part.advance(step)
        except PartFailed as failure:
            if failure.part:
                raise
            raise PartFailed(
                failure.reason,
                part=name,
                time=begin,
                step=step,
                inputs=failure.inputs or inputs,
            ) from failure
        except SimulationError as failure:
            raise PartFailed(
                str(failure), part=name, time=begin, step=step, inputs=inputs
            ) from failure

    def _get(self, name: str, fields: list[str]) -> Fields:
        return self.parts[name].get_fields(fields) if fields else {}

    def _answer(self, exchange: Exchange, values: Values) -> Values:
        carried = exchange.carry(values)
        if carried.ndim != 1:
            raise InputError(
                f"{exchange.name}: one value per cell is exchanged, not {carried.ndim}"
            )
        wrong = np.flatnonzero(~np.isfinite(carried))
        if wrong.size:
            raise PartFailed(
                f"{wrong.size} of {carried.size} values of {exchange.field} are no numbers, the "
                f"first is number {wrong[0]}",
                part=exchange.source,
            )
        return carried

    def _check(self) -> None:
        if not self.parts:
            raise InputError("a coupled system needs parts")
        seen: set[tuple[str, str]] = set()
        for exchange in self.exchanges:
            for name in (exchange.source, exchange.target):
                if name not in self.parts:
                    known = ", ".join(self.parts)
                    raise InputError(f'{exchange.name}: there is no part "{name}", only {known}')
            target = (exchange.target, exchange.input)
            if target in seen:
                raise InputError(f'two exchanges set "{exchange.input}" of "{exchange.target}"')
            seen.add(target)
        for name, count in self.substeps.items():
            if name not in self.parts:
                raise InputError(f'substeps: there is no part "{name}"')
            if count < 1 or int(count) != count:
                raise InputError(f'substeps of "{name}" must be a whole number from 1, not {count}')
