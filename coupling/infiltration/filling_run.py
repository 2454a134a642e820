"""A filling advanced to its end, with saved states, histories, checkpoints and a way to stop it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lcmchain.coupling.closing.mould import Mould
from lcmchain.coupling.infiltration.checkpoint import read_checkpoint, write_checkpoint
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.results import FilledPart, FillingRecord
from lcmchain.coupling.infiltration.setup import FillingSetup
from lcmchain.errors import SimulationInterrupted
from lcmchain.forming_run import stop_requests
from lcmchain.scene.infiltration import Infiltration

#: A checkpoint is written after this time of computing [s].
CHECKPOINT_INTERVAL = 30.0

#: Told how much is filled (of one) and a text.
Tell = Callable[[float, str], None]


class FillingRun:
    """Advances a filling and keeps what it finds.

    Parameters
    ----------
    checkpoint : file that is written on the way, None for none.
    fingerprint : of what decides the numbers.
    tell : called after every step with the filled share and a text.
    """

    def __init__(
        self, setup: FillingSetup, checkpoint: Path | None, fingerprint: dict[str, str], tell: Tell
    ) -> None:
        self.setup, self.checkpoint, self.fingerprint = setup, checkpoint, fingerprint
        self.tell = tell
        self.filling = setup.filling()
        self.mould = self._mould()
        #: What is advanced and saved: the filling, or the mould that closes on it.
        self.mover: Filling | Mould = self.mould or self.filling
        self.record = FillingRecord.empty()
        # resin in a flow medium covers nothing of the part
        area = node_areas(setup)
        layer = self.filling.mesh.node_count - len(area)
        self._node_area = np.concatenate([area, np.zeros(layer)])

    def complete(self, *, resume: bool = False) -> FilledPart:
        """Advance to the end and return what was found.

        Raises
        ------
        InputError : ``resume`` without a checkpoint of this filling.
        SimulationInterrupted : the user stopped it; a checkpoint was left.
        """
        if resume and self.checkpoint is not None:
            state, self.record = read_checkpoint(self.checkpoint, self.fingerprint)
            self.mover.restore(state)
        else:
            self.begin()
        self._saved = time.perf_counter()
        with stop_requests() as self._stop:
            outcome, message = self._advance()
        return self.found(outcome, message)

    def begin(self) -> None:
        """Record the start."""
        self.record.add_frame(self.filling)
        self.record.add_step(self.filling, self._node_area, self._force())

    def note(self, filling: Filling) -> float:
        """Record a step that has been taken; return the filled share."""
        self.record.add_step(filling, self._node_area, self._force())
        share = filling.filled_share
        if self._is_frame(share):
            self.record.add_frame(filling)
        self.tell(share, f"filling, {filling.time:.4g} s")
        return share

    def found(self, outcome: str, message: str) -> FilledPart:
        """Return what was recorded, with the present state as its last frame.

        A part that is full, but from whose vents resin bleeds up to the end, is filled.
        """
        if outcome == "reached" and self.filling.state.full.all():
            outcome, message = "filled", f"all pores are full, and {message}"
        if self.record.frame_time[-1] < self.filling.time:
            self.record.add_frame(self.filling)
        history = None if self.mould is None else self.mould.history
        return FilledPart.of_record(
            self.setup, self.record, self.filling.save(), outcome, message, history
        )

    def _mould(self) -> Mould | None:
        """What closes on the part, if something does."""
        setup = self.setup
        if setup.case.closure is None:
            return None
        return Mould(setup.part, self.filling, setup.case.closure, setup.case.time)

    def _force(self) -> tuple[float, ...]:
        return () if self.mould is None else self.mould.force

    def _advance(self) -> tuple[str, str]:
        case = self.setup.case
        interval = case.frame_interval
        if interval is None:
            return self.mover.advance(case.time, self._after_step)
        outcome, message = "reached", ""
        while self.filling.time < case.time:
            number = int(np.floor(self.filling.time / interval * (1.0 + 1e-12))) + 1
            until = min(number * interval, case.time)
            outcome, message = self.mover.advance(until, self._after_step)
            if outcome != "reached" and self.mould is None:
                break
        return outcome, message

    def _after_step(self, filling: Filling) -> None:
        share = self.note(filling)
        if self._stop.is_set():
            self._save()
            raise SimulationInterrupted(
                f"stopped at {filling.time:.4g} s with {share:.1%} filled"
                + (
                    ""
                    if self.checkpoint is None
                    else "; the same command with --resume goes on from here"
                )
            )
        if time.perf_counter() - self._saved > CHECKPOINT_INTERVAL:
            self._save()

    def _is_frame(self, share: float) -> bool:
        """Whether the filling has come to a share or a time that is to be saved."""
        return is_frame_due(
            self.setup.case,
            (self.filling.time, share),
            (self.record.frame_time[-1], self._saved_share()),
        )

    def _saved_share(self) -> float:
        """Filled share in the last saved state."""
        number = int(np.searchsorted(self.record.time, self.record.frame_time[-1]))
        return self.record.filled_share[min(number, len(self.record.time) - 1)]

    def _save(self) -> None:
        if self.checkpoint is None:
            return
        write_checkpoint(self.checkpoint, self.fingerprint, self.mover.save(), self.record)
        self._saved = time.perf_counter()


def is_frame_due(case: Infiltration, now: tuple[float, float], last: tuple[float, float]) -> bool:
    """Whether a filling has come to a time or a filled share at which its fields are to be saved.

    now, last : time [s] and filled share, at present and in the last saved state.
    """
    if case.frame_interval is not None:
        here, before = now[0], last[0]
        step, slack = case.frame_interval, 1e-12 * here / case.frame_interval
    else:
        here, before = now[1], last[1]
        step, slack = 1.0 / (case.frames - 1), 1e-9
    return bool(np.floor(here / step + slack) > np.floor(before / step + slack))


def node_areas(setup: FillingSetup) -> np.ndarray:
    """Area of the mesh that belongs to each node [m2], (N,): equal parts of its cells."""
    cells = setup.mesh.cells
    there = cells >= 0
    part = np.where(there, (setup.mesh.areas / there.sum(axis=1))[:, None], 0.0)
    return np.bincount(cells[there], weights=part[there], minlength=setup.mesh.node_count)
