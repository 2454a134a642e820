"""A coupled part as a participant of preCICE: its fields, steps and checkpoints.

preCICE leads: it decides how long a window is and whether it is repeated. The adapter needs no more
than a :class:`lcmchain.coupling.iteration.CoupledPart` offers, so that every part of this package
can be a participant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lcmchain.coupling.iteration.interface import CoupledPart, HasPlaces, PartFailed
from lcmchain.errors import InputError, SimulationError

#: Values of a field, by vertex and component.
Values = NDArray[np.float64]
#: Numbers (n,) that preCICE gives the vertices of a mesh.
VertexIds = NDArray[np.int32]

# --- preCICE: the methods of its version 3 that the adapter calls ---------------------------------


class Participant(Protocol):
    """A participant of preCICE, such as ``precice.Participant`` of its Python bindings.

    Reference: Chourdakis et al., preCICE v2: a sustainable and user-friendly coupling library,
    Open Research Europe 2 (2022) 51; the names are those of version 3.
    """

    def get_mesh_dimensions(self, mesh_name: str) -> int:
        """Return the dimensions of a mesh."""

    def get_data_dimensions(self, mesh_name: str, data_name: str) -> int:
        """Return the components of data: 1 of a scalar."""

    def set_mesh_vertices(self, mesh_name: str, positions: Values) -> VertexIds:
        """Define the vertices of a mesh (n, dimensions); return their ids (n,)."""

    def requires_initial_data(self) -> bool:
        """Whether data have to be written before the coupling begins."""

    def initialize(self) -> None:
        """Begin the coupling."""

    def is_coupling_ongoing(self) -> bool:
        """Whether there are windows left."""

    def requires_writing_checkpoint(self) -> bool:
        """Whether the state has to be saved, so that it can be restored."""

    def requires_reading_checkpoint(self) -> bool:
        """Whether the window is repeated from the saved state."""

    def is_time_window_complete(self) -> bool:
        """Whether the last step has ended a window that is accepted."""

    def get_max_time_step_size(self) -> float:
        """Return the rest of the window [s]."""

    def read_data(
        self, mesh_name: str, data_name: str, vertex_ids: VertexIds, relative_read_time: float
    ) -> NDArray[np.float64]:
        """Return data at a time after the present one [s], within the window."""

    def write_data(
        self, mesh_name: str, data_name: str, vertex_ids: VertexIds, values: Values
    ) -> None:
        """Write data at the end of the step."""

    def advance(self, computed_time_step_size: float) -> None:
        """End a step [s]; data are exchanged at the end of a window."""

    def finalize(self) -> None:
        """End the coupling."""


def open_participant(name: str, config: Path) -> Participant:
    """Return a participant of a preCICE configuration, which runs in one process.

    Raises
    ------
    InputError : preCICE cannot be loaded, or refuses the configuration.
    """
    try:
        import precice
    except (ImportError, OSError) as error:  # the second where libprecice is not found
        raise InputError(
            f"preCICE cannot be loaded ({error}); install libprecice 3 and its Python bindings "
            '(pip install "pyprecice>=3"), and put the library on the path of the loader',
            key="config",
        ) from None
    if not config.is_file():
        raise InputError("there is no such file", file=config)
    try:
        return cast(Participant, precice.Participant(name, str(config), 0, 1))
    except Exception as error:
        raise InputError(
            f'preCICE refuses the participant "{name}": {error}', file=config
        ) from None


# --- the adapter ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Read:
    """Data of preCICE that are an input of the part.

    Parameters
    ----------
    data, mesh : their names in the configuration.
    field : name of the input.
    within : value that a sub-step sees: at its end, interpolated by preCICE (``linear``), or at the
        end of the window (``held``), as for an :class:`Exchange`.
    """

    data: str
    mesh: str
    field: str
    within: Literal["linear", "held"] = "linear"


@dataclass(frozen=True)
class Write:
    """An output of the part that is written to preCICE.

    Parameters
    ----------
    data, mesh : their names in the configuration.
    field : name of the output.
    of_window : the value at the ``end`` of each step, or the ``mean`` since the window began, which
        conserves a rate.
    """

    data: str
    mesh: str
    field: str
    of_window: Literal["end", "mean"] = "end"


@dataclass
class Steps:
    """Progress of a participant: accepted windows, steps, and repetitions of windows."""

    windows: int = 0
    steps: int = 0
    repetitions: int = 0


class Adapter:
    """Runs a part in a coupling that preCICE controls.

    Parameters
    ----------
    part : the simulation.
    participant : not yet initialised.
    reads, writes : fields that are exchanged. Those of one mesh have the same positions.
    substeps : least number of steps of the part in a window.
    name : of the participant, for messages.

    Raises
    ------
    InputError : a field without positions, or meshes or data that do not fit it.
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
        """Run the whole coupling; ``on_window`` is called after every accepted window.

        Raises
        ------
        PartFailed : the part could not do a step. preCICE is then not finalised, so that the other
            participants stop too.
        """
        participant, part = self.participant, self.part
        if participant.requires_initial_data():
            self._write(self._outputs())
        participant.initialize()
        while participant.is_coupling_ongoing():
            saved = part.save() if participant.requires_writing_checkpoint() else None
            again = self._window(saved)
            while again:  # preCICE asks for the state once, at the begin of the window
                self.steps.repetitions += 1
                part.restore(saved)
                again = self._window(saved)
            self.steps.windows += 1
            if on_window is not None:
                on_window(part)
        participant.finalize()
        return self.steps

    def _window(self, saved: object) -> bool:
        """Compute a window; return whether it has to be repeated from the saved state."""
        participant = self.participant
        size = participant.get_max_time_step_size()
        begin, sums = self.part.time, dict[str, Values]()
        substep = size / self.substeps
        while True:
            left = participant.get_max_time_step_size()
            # the last step ends exactly with the window, without a rounding error
            step = left if left < substep * (1.0 + 1e-9) else min(substep, left)
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
            values = (outputs if write.of_window == "end" or not means else means)[write.field]
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

    def _define_meshes(self) -> dict[str, tuple[VertexIds, int]]:
        """Define the vertices of every mesh; return their ids and number by the mesh's name."""
        entries: list[Read | Write] = [*self.reads, *self.writes]
        if not entries:
            raise InputError("exchanges nothing; give it [[read]] or [[write]]", key=self.name)
        meshes: dict[str, tuple[VertexIds, int]] = {}
        defined: dict[str, tuple[str, Values]] = {}  # first field of a mesh and its positions
        for entry in entries:
            positions = self._positions(entry)
            first, first_positions = defined.setdefault(entry.mesh, (entry.field, positions))
            if not np.array_equal(positions, first_positions):
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
                ids = self.participant.set_mesh_vertices(entry.mesh, positions)
                meshes[entry.mesh] = ids, len(positions)
            self._require_fitting(entry, meshes[entry.mesh][1])
        return meshes

    def _positions(self, entry: Read | Write) -> Values:
        """Return the positions (n, 3) [m] of the values of a field."""
        part = self.part
        positions = part.places(entry.field) if isinstance(part, HasPlaces) else None
        if positions is None:
            raise InputError(
                f'the part does not say where the values of "{entry.field}" lie, so they have no '
                "vertices",
                key=f'data "{entry.data}"',
            )
        return np.ascontiguousarray(positions, dtype=float)

    def _require_fitting(self, entry: Read | Write, count: int) -> None:
        """Refuse data of another number of components than the field has."""
        components = self.participant.get_data_dimensions(entry.mesh, entry.data)
        needed = 1
        if isinstance(entry, Write):
            needed = self.part.get_fields([entry.field])[entry.field].size // max(count, 1)
        if components != needed:
            raise InputError(
                f'has {components} components, the field "{entry.field}" has {needed}; declare it '
                f"as data:{'scalar' if needed == 1 else 'vector'}",
                key=f'data "{entry.data}"',
            )
