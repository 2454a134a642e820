"""Whether an explicit coupling diverges: its fields swing from window to window and grow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import SimulationError

Values = NDArray[np.float64]

#: A swing that grows by less per window may fade again.
LEAST_GROWTH = 1.05
#: So many growing swings in a row, and so large a growth together, are no answer of the units.
LEAST_SWINGS = 8
LEAST_TOTAL = 1e3
#: Cosine between two changes below which the later one takes back the earlier one.
OPPOSITE = -0.9
#: Growth over the first size that no use has, whatever its course.
BEYOND_USE = 1e15


class CouplingDiverges(SimulationError):
    """An explicit scheme whose fields grow from window to window without end."""


@dataclass
class _Swing:
    """How often in a row a change has taken back the one before it, and grown."""

    count: int = 0
    begin: float = 0.0


@dataclass
class DivergenceWatch:
    """Follows the exchanged fields over the windows of an explicit scheme.

    Between two units that go one after the other an error changes its sign with every window,
    between two that go at once with every second one; a solution that is resolved does neither.
    """

    names: Sequence[str]
    _before: list[Values] | None = None
    _changes: list[list[Values]] = field(default_factory=list)  # newest first
    _swings: dict[tuple[int, int], _Swing] = field(default_factory=dict)
    _first: dict[int, float] = field(default_factory=dict)

    def follow(self, fields: Sequence[Values]) -> str:
        """Take the fields at the end of a window; return what diverges in words, or nothing."""
        found = ""
        if self._before is not None:
            changes = [now - before for now, before in zip(fields, self._before)]
            for number, change in enumerate(changes):
                found = found or self._judge(number, change, fields[number])
            self._changes.insert(0, changes)
            del self._changes[2:]
        self._before = [values.copy() for values in fields]
        return found

    def growing(self) -> str:
        """Return the field that has swung most often in a row by now; nothing below three times."""
        most = max(self._swings, key=lambda key: self._swings[key].count, default=None)
        if most is None or self._swings[most].count < 3:
            return ""
        return self.names[most[0]]

    def _judge(self, number: int, change: Values, now: Values) -> str:
        size = float(np.linalg.norm(change))
        name = self.names[number]
        for distance in (1, 2):
            if len(self._changes) < distance:
                continue
            earlier = self._changes[distance - 1][number]
            swing = self._swings.setdefault((number, distance), _Swing())
            before = float(np.linalg.norm(earlier))
            if size == before == 0.0:  # two units that go at once: nothing in between
                continue
            opposite = float(change @ earlier) < OPPOSITE * size * before
            if not (opposite and size > LEAST_GROWTH * before > 0.0):
                swing.count = 0
                continue
            if swing.count == 0:
                swing.begin = before
            swing.count += 1
            grown = size / swing.begin
            if swing.count >= LEAST_SWINGS and grown > LEAST_TOTAL:
                return (
                    f"{name} swings with every {'window' if distance == 1 else 'second window'}, "
                    f"and its swings have grown {grown:.3g} times in {swing.count} windows"
                )
        amount = float(np.abs(now).max()) if now.size else 0.0
        first = self._first.setdefault(number, amount) if amount > 0.0 else 0.0
        if first > 0.0 and amount > BEYOND_USE * first:
            return f"{name} has grown {amount / first:.3g} times since it was first not 0"
        return ""


def advice(cannot_return: Sequence[str]) -> str:
    """Return what to do where an explicit scheme diverges.

    cannot_return : units without states to go back to.
    """
    text = (
        "The units answer to each other more strongly than an explicit scheme can follow; smaller "
        "windows help between masses and springs, but not against an incompressible fluid or a "
        'direct feedthrough. Take an implicit scheme: scheme.type = "iqn-ils" (or "aitken")'
    )
    if cannot_return:
        names = ", ".join(f'"{name}"' for name in cannot_return)
        text += (
            f"; for it {names} would have to be able to go back (canGetAndSetFMUstate), which the "
            "unit says it cannot: ask its maker, or exchange what is passed (the stiffer side "
            "should take the displacement and give the force)"
        )
    return text
