"""What a filling unit keeps for its result file, in pieces that are never changed.

A state of the unit refers to the pieces of its time: saving it copies nothing of what lies behind.
Neighbouring pieces of about the same length are joined, so that there are few of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.results import FillingRecord
from lcmchain.coupling.infiltration.setup import FillingSetup
from lcmchain.coupling.infiltration.stage import is_frame_due, node_areas

Piece = dict[str, np.ndarray]

#: Entries of a record that saved states have; the others belong to time steps.
OF_FRAMES = (
    "frame_time", "fill", "pressure", "resin_volume", "velocity", "cure", "temperature", "film",
    "thickness", "frame_stage",
)  # fmt: skip
OF_STEPS = tuple(f.name for f in fields(FillingRecord) if f.name not in OF_FRAMES)


class RecordPieces:
    """The record of a filling so far."""

    def __init__(self, setup: FillingSetup) -> None:
        self._case, self._node_areas = setup.case, node_areas(setup)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.frames: tuple[Piece, ...] = ()
        self.steps: tuple[Piece, ...] = ()
        self._last = (0.0, 0.0)
        self._new = FillingRecord.empty()

    def begin(self, filling: Filling) -> None:
        """Keep the start."""
        self._add_frame(filling)
        self._new.add_step(filling, self._node_areas)
        self.close()

    def after_step(self, filling: Filling) -> None:
        """Keep what a time step has led to, if the start was kept."""
        if not self.frames:
            return
        self._new.add_step(filling, self._node_areas)
        if is_frame_due(self._case, (filling.time, filling.filled_share), self._last):
            self._add_frame(filling)

    def end(self, filling: Filling) -> None:
        """Keep the last state, if anything has moved since a state was saved."""
        if self.steps[-1]["time"][-1] > self.frames[-1]["frame_time"][-1]:
            self._add_frame(filling)
            self.close()

    def close(self) -> None:
        """Make a piece of what was kept since the last one."""
        self.frames = _with(self.frames, self._new, OF_FRAMES)
        self.steps = _with(self.steps, self._new, OF_STEPS)
        self._new = FillingRecord.empty()

    def whole(self) -> FillingRecord:
        """Return the record in one."""
        joined = {**_joined(self.frames, OF_FRAMES), **_joined(self.steps, OF_STEPS)}
        return FillingRecord(**{name: list(values) for name, values in joined.items()})

    # --- saved states -----------------------------------------------------------------------------

    def arrays(self) -> Piece:
        """Return everything as arrays by name."""
        named: Piece = {}
        for kind, pieces in (("frames", self.frames), ("steps", self.steps)):
            for number, piece in enumerate(pieces):
                named |= {f"{kind} {number} {name}": values for name, values in piece.items()}
        return named | {"last frame": np.array(self._last)}

    def take(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go back to what :meth:`arrays` has returned.

        Raises
        ------
        KeyError, ValueError : these are not arrays of a record.
        """
        found: dict[str, dict[int, Piece]] = {"frames": {}, "steps": {}}
        for key, values in arrays.items():
            if key != "last frame":
                kind, number, name = key.split(" ")
                found[kind].setdefault(int(number), {})[name] = values
        pieces = {kind: tuple(own[k] for k in range(len(own))) for kind, own in found.items()}
        for kind, names in (("frames", OF_FRAMES), ("steps", OF_STEPS)):
            if any(set(piece) != set(names) for piece in pieces[kind]):
                raise KeyError(kind)
        time, share = arrays["last frame"]
        self.frames, self.steps = pieces["frames"], pieces["steps"]
        self._last, self._new = (float(time), float(share)), FillingRecord.empty()

    def _add_frame(self, filling: Filling) -> None:
        self._new.add_frame(filling)
        self._last = filling.time, filling.filled_share


def _with(
    pieces: tuple[Piece, ...], record: FillingRecord, names: tuple[str, ...]
) -> tuple[Piece, ...]:
    """Append what a record holds, and join pieces at the end that are not much longer."""
    new = {name: np.array(getattr(record, name)) for name in names}
    if len(new[names[0]]) == 0:
        return pieces
    while pieces and len(pieces[-1][names[0]]) <= 2 * len(new[names[0]]):
        new = {name: np.concatenate([pieces[-1][name], new[name]]) for name in names}
        pieces = pieces[:-1]
    return (*pieces, new)


def _joined(pieces: tuple[Piece, ...], names: tuple[str, ...]) -> Piece:
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
