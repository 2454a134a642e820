"""A coupled part as a participant of preCICE: its fields, steps and checkpoints.

preCICE leads: it says how long the window is, and whether it is gone through once more. What a
:class:`lcmchain.coupling.iteration.CoupledPart` offers is all that is needed for that, so that
every part of this package can be a participant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.iteration.interface import CoupledPart, HasPlaces, PartFailed
from lcmchain.coupling.precice_adapter.library import Participant
from lcmchain.errors import InputError, SimulationError

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Read:
    """Data of preCICE that are an input of the part.

    Parameters
    ----------
    data, mesh : their names in the configuration. field : name of the input.
    within : sub-steps see the value at the end of each (``linear``: what preCICE interpolates), or
        all that at the end of the window (``held``), as :class:`Exchange` has it.
    """

    data: str
    mesh: str
    field: str
    within: Literal["linear", "held"] = "linear"


@dataclass(frozen=True)
class Write:
    """An output of the part that is given to preCICE.

    Parameters
    ----------
    data, mesh : their names in the configuration. field : name of the output.
    of_window : the value at the ``end`` of each step, or the ``mean`` since the window began, which
        conserves a rate.
    """

    data: str
    mesh: str
    field: str
    of_window: Literal["end", "mean"] = "end"


@dataclass
class Steps:
    """How far a participant has come: windows that stand, steps, and how often it went back."""

    windows: int = 0
    steps: int = 0
    repetitions: int = 0


class Adapter:
    """Leads a part through a coupling that preCICE controls.

    Parameters
    ----------
    part : what is simulated. participant : not yet initialised.
    reads, writes : fields that are exchanged. Those of one mesh lie at the same places.
    substeps : into how many steps the part divides a window at least.
    name : of the participant, for messages.

    Raises
    ------
    InputError : a field without places, meshes or data that do not fit it.
    """

    def __init__(
        self,
        part: CoupledPart,
        participant: Participant,
        reads: Sequence[Read],
        writes: Sequence[Write],
        *,
        substeps: int = 1,
        name: str = "participant",
    ) -> None:
        if substeps < 1:
            raise InputError(f"must be at least 1, not {substeps}", key="substeps")
        self.part, self.participant, self.name = part, participant, name
        self.reads, self.writes, self.substeps = tuple(reads), tuple(writes), substeps
        self.steps = Steps()
        self._vertices = self._define_meshes()

    def run(self, on_window: Callable[[CoupledPart], None] | None = None) -> Steps:
        """Go through the whole coupling; ``on_window`` is called after every window that stands.

        Raises
        ------
        PartFailed : the part could not do a step. preCICE is then left without an end, so that
            the other participants stop too.
        """
        participant, part = self.participant, self.part
        if participant.requires_initial_data():
            self._write(self._outputs())
        participant.initialize()
        while participant.is_coupling_ongoing():
            saved = part.save() if participant.requires_writing_checkpoint() else None
            again = self._window(saved)
            while again:  # the state of the begin is good for every iteration
                self.steps.repetitions += 1
                part.restore(saved)
                again = self._window(saved)
            self.steps.windows += 1
            if on_window is not None:
                on_window(part)
        participant.finalize()
        return self.steps

    def _window(self, saved: Any) -> bool:
        """Go through a window; return whether it is to be gone through once more."""
        participant = self.participant
        size = participant.get_max_time_step_size()
        begin, sums = self.part.time, dict[str, Values]()
        own = size / self.substeps
        while True:
            left = participant.get_max_time_step_size()
            # the last step ends the window, not a rounding error beside it
            step = left if left < own * (1.0 + 1e-9) else min(own, left)
            self._step(step, left)
            outputs = self._outputs()
            for write in self.writes:
                if write.of_window == "mean":
                    before = sums.get(write.field, np.zeros(outputs[write.field].shape))
                    sums[write.field] = before + step * outputs[write.field]
            spent = self.part.time - begin
            means = {field: total / spent for field, total in sums.items()}
            self._write(outputs, means)
            participant.advance(step)
            self.steps.steps += 1
            if participant.requires_reading_checkpoint():
                if saved is None:
                    raise SimulationError(
                        f"{self.name}: preCICE goes back to a checkpoint that it did not ask for"
                    )
                return True
            if participant.is_time_window_complete():
                return False

    def _step(self, step: float, left: float) -> None:
        """Set the inputs and advance the part; ``left`` is the rest of the window [s]."""
        inputs = {}
        for read in self.reads:
            ids, _ = self._vertices[read.mesh]
            at = left if read.within == "held" else step
            values = self.participant.read_data(read.mesh, read.data, ids, at)
            inputs[read.field] = np.asarray(values, dtype=float).ravel()
        begin = self.part.time
        try:
            self.part.set_fields(inputs)
            self.part.advance(step)
        except PartFailed as failure:
            raise PartFailed(
                failure.reason, part=failure.part or self.name, time=begin, step=step,
                inputs=failure.inputs or inputs,
            ) from failure  # fmt: skip
        except SimulationError as failure:
            raise PartFailed(
                str(failure), part=self.name, time=begin, step=step, inputs=inputs
            ) from failure

    def _outputs(self) -> dict[str, Values]:
        names = list(dict.fromkeys(write.field for write in self.writes))
        return self.part.get_fields(names) if names else {}

    def _write(self, outputs: dict[str, Values], means: dict[str, Values] | None = None) -> None:
        for write in self.writes:
            own = outputs if write.of_window == "end" or not means else means
            values = own[write.field]
            wrong = np.flatnonzero(~np.isfinite(values))
            if len(wrong):
                raise PartFailed(
                    f"{len(wrong)} of {len(values)} values of {write.field} are no numbers, the "
                    f"first is number {wrong[0]}",
                    part=self.name,
                    time=self.part.time,
                )
            ids, count = self._vertices[write.mesh]
            shaped = values if len(values) == count else values.reshape(count, -1)
            self.participant.write_data(write.mesh, write.data, ids, shaped)

    # --- meshes -----------------------------------------------------------------------------------

    def _define_meshes(self) -> dict[str, tuple[Any, int]]:
        """Give preCICE the vertices of every mesh: ids and number of vertices by its name."""
        entries: list[Read | Write] = [*self.reads, *self.writes]
        if not entries:
            raise InputError("exchanges nothing; give it [[read]] or [[write]]", key=self.name)
        meshes: dict[str, tuple[Any, int]] = {}
        places: dict[str, tuple[str, Values]] = {}
        for entry in entries:
            here = self._places(entry)
            first, there = places.setdefault(entry.mesh, (entry.field, here))
            if not np.array_equal(here, there):
                raise InputError(
                    f'the fields "{first}" and "{entry.field}" do not lie at the same places; give '
                    "each a mesh of its own",
                    key=f'mesh "{entry.mesh}"',
                )
            if entry.mesh not in meshes:
                dimensions = self.participant.get_mesh_dimensions(entry.mesh)
                if dimensions != 3:
                    raise InputError(
                        f'has {dimensions} dimensions in the configuration; write dimensions="3"',
                        key=f'mesh "{entry.mesh}"',
                    )
                ids = self.participant.set_mesh_vertices(entry.mesh, here)
                meshes[entry.mesh] = ids, len(here)
            self._require_fitting(entry, meshes[entry.mesh][1])
        return meshes

    def _places(self, entry: Read | Write) -> Values:
        found = self.part.places(entry.field) if isinstance(self.part, HasPlaces) else None
        if found is None:
            raise InputError(
                f'the part does not say where the values of "{entry.field}" lie, so they have no '
                "vertices",
                key=f'data "{entry.data}"',
            )
        return np.ascontiguousarray(found, dtype=float)

    def _require_fitting(self, entry: Read | Write, count: int) -> None:
        """Refuse data of another number of components than the field has."""
        components = self.participant.get_data_dimensions(entry.mesh, entry.data)
        own = 1
        if isinstance(entry, Write):
            own = self.part.get_fields([entry.field])[entry.field].size // max(count, 1)
        if components != own:
            raise InputError(
                f'has {components} components, the field "{entry.field}" has {own}; declare it as '
                f"data:{'scalar' if own == 1 else 'vector'}",
                key=f'data "{entry.data}"',
            )
