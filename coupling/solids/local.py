"""Compaction of every cell alone: the solid side of an infusion, or of closing tools.

Where the sheet does not move in its plane, only its thickness is unknown, and inertia is left out:
fibres and fluid of a cell bear the pressure on it. So minutes of an infusion cost little, which an
explicit forming could not reach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    THICKNESS,
    THICKNESS_RATE,
    THICKNESS_RATE_SLOPE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
    Fields,
    PartFailed,
    checked_field,
    selected_fields,
)
from lcmchain.coupling.solids.closures import Closed, Closure, require_positive
from lcmchain.coupling.solids.compaction_law import CompactionLaw
from lcmchain.errors import InputError, SimulationError

#: Change of a thickness that counts as round-off, relative to it: more than a press leaves.
ROUND_OFF = 1e-12


@dataclass(frozen=True)
class SavedCompaction:
    """State of a :class:`LocalCompaction`; arrays are per cell (C,), the history is the law's."""

    time: float
    step: float
    pore_pressure: np.ndarray
    used_pressure: np.ndarray
    thickness: np.ndarray
    before: np.ndarray
    compliance: np.ndarray
    history: np.ndarray


class LocalCompaction:
    """Thickness of C cells under a closure and their pore pressure.

    It is a :class:`lcmchain.coupling.iteration.interface.CoupledPart`. The pore pressure that is
    set is that at the end of a step. The first state is in balance with the pressures at the start,
    or has a prescribed thickness.

    Parameters
    ----------
    law : of the cells.
    closure : presses on them.
    area : present area of the mid-surface of each cell (C,) [m²].
    pore_pressure : at the start (C,) or one number [Pa].
    centres : of the cells (C, 3) [m], for messages.
    time : at the start [s].
    start : thickness at the start (C,) [m], where the fluid holds the cells out of balance; None:
        the thickness in balance.
    swells : whether fluid can come in, so that cells may become thicker. Else they keep their
        thickness when the closure is relieved.

    Raises
    ------
    InputError : an area that is not positive, wrong numbers of values.
    """

    inputs = (PORE_PRESSURE,)

    def __init__(
        self,
        law: CompactionLaw,
        closure: Closure,
        area: np.ndarray,
        *,
        pore_pressure: np.ndarray | float = 0.0,
        centres: np.ndarray | None = None,
        time: float = 0.0,
        start: np.ndarray | None = None,
        swells: bool = True,
    ) -> None:
        self._swells, self._given_start = swells, start is not None
        self.law, self.closure = law, closure
        self.area = checked_field("area", area, law.thickness.size)
        require_positive("area", self.area)
        self._centres, self._time, self._step = centres, float(time), 0.0
        pore = np.broadcast_to(np.asarray(pore_pressure, dtype=float), self.area.shape)
        self._pressure = checked_field(PORE_PRESSURE, pore, self.cell_count)
        self._used = self._pressure.copy()
        if start is None:
            closed = self._closed(self._time)
        else:
            given = checked_field(THICKNESS, start, self.cell_count)
            closed = Closed(given, np.zeros_like(given))
        self._take(closed)
        self._before = self._thickness.copy()

    @property
    def cell_count(self) -> int:
        return self.area.size

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self._time

    @property
    def thickness(self) -> np.ndarray:
        """Present thickness (C,) [m]."""
        return self._thickness.copy()

    def advance(self, step: float) -> None:
        """Go on by ``step`` [s] to the balance under the pore pressure that was set.

        Raises
        ------
        PartFailed : no thickness bears what presses on a cell.
        """
        if not step > 0.0:
            raise InputError(f"a step must be positive, not {step:g} s")
        try:
            closed = self._closed(self._time + step)
        except SimulationError as error:
            raise PartFailed(
                str(error), time=self._time, step=step, inputs={PORE_PRESSURE: self._pressure}
            ) from error
        if self._given_start:
            # a change by round-off is no rate
            change = closed.thickness - self._thickness
            lies = np.abs(change) <= ROUND_OFF * self._thickness
            closed = Closed(np.where(lies, self._thickness, closed.thickness), closed.compliance)
        if not self._swells:
            lies = closed.thickness >= self._thickness
            closed = Closed(
                np.where(lies, self._thickness, closed.thickness),
                np.where(lies, 0.0, closed.compliance),
            )
        self._before, self._used = self._thickness, self._pressure.copy()
        self._take(closed)
        self._time, self._step = self._time + step, float(step)

    def save(self) -> SavedCompaction:
        """Return a copy of the state."""
        return SavedCompaction(
            self._time, self._step, self._pressure.copy(), self._used.copy(),
            self._thickness.copy(), self._before.copy(), self._compliance.copy(),
            self.law.history.copy(),
        )  # fmt: skip

    def restore(self, saved: SavedCompaction) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        self._time, self._step = saved.time, saved.step
        self._pressure, self._used = saved.pore_pressure.copy(), saved.used_pressure.copy()
        self._thickness, self._before = saved.thickness.copy(), saved.before.copy()
        self._compliance = saved.compliance.copy()
        self.law.history = saved.history.copy()

    def set_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Set ``pore_pressure`` (C,) [Pa] at the end of the next step.

        Raises
        ------
        InputError : another name, a wrong number of values, or one that is no number.
        """
        for name, values in fields.items():
            if name != PORE_PRESSURE:
                raise InputError(f'"{name}" is no input of compaction; it takes {PORE_PRESSURE}')
            self._pressure = checked_field(name, values, self.cell_count)

    def get_fields(self, names: Sequence[str]) -> Fields:
        """Return outputs (C,) at the present time; rates are means over the last step.

        ``thickness`` [m] and ``volume`` [m³] with their ``_rate``; ``fibre_pressure``, the part of
        the total pressure that the fibres bear, and ``total_pressure`` [Pa]; the slopes of the
        rates by the pressure and ``reference_pressure`` for the fixed-stress split.

        Raises
        ------
        InputError : a name that is no output.
        """
        step = self._step or np.inf  # rates are 0 before the first step
        rate = (self._thickness - self._before) / step
        fibres = self.law.pressure(self._thickness)
        outputs = {
            THICKNESS: self._thickness,
            THICKNESS_RATE: rate,
            THICKNESS_RATE_SLOPE: self._compliance / step,
            "volume": self.area * self._thickness,
            VOLUME_RATE: self.area * rate,
            VOLUME_RATE_SLOPE: self.area * self._compliance / step,
            REFERENCE_PRESSURE: self._used,
            PORE_PRESSURE: self._used,
            "fibre_pressure": fibres,
            "total_pressure": fibres + self._used,
        }
        return selected_fields(names, outputs)

    def force_parts(self, across: np.ndarray | float = 1.0) -> dict[str, float]:
        """Return the force on all cells and its parts: ``total``, ``fibres``, ``fluid`` [N].

        across : share of a cell's area across the direction of the force, (C,) or one number.
        """
        area = self.area * across
        fibres = float(np.sum(area * self.law.pressure(self._thickness)))
        fluid = float(np.sum(area * self._used))
        return {"total": fibres + fluid, "fibres": fibres, "fluid": fluid}

    def places(self, name: str) -> np.ndarray | None:
        """Return the centres of the cells (C, 3) [m]."""
        return self._centres

    def _closed(self, time: float) -> Closed:
        return self.closure.close(self.law, self.area, self._pressure, time)

    def _take(self, closed: Closed) -> None:
        self._thickness, self._compliance = closed
        self.law.remember(self._thickness)
