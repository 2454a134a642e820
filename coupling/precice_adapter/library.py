"""What the adapter asks of preCICE: the methods of its version 3 that it calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lcmchain.errors import InputError


class Participant(Protocol):
    """A participant of preCICE, as ``precice.Participant`` of its Python bindings is one.

    Reference: Chourdakis et al., preCICE v2: a sustainable and user-friendly coupling library,
    Open Research Europe 2 (2022) 51; the names are those of version 3.
    """

    def get_mesh_dimensions(self, mesh_name: str) -> int:
        """Return the dimensions of a mesh."""

    def get_data_dimensions(self, mesh_name: str, data_name: str) -> int:
        """Return the components of data: 1 of a scalar."""

    def set_mesh_vertices(self, mesh_name: str, positions: Any) -> Any:
        """Define the vertices of a mesh (n, dimensions); return their ids (n,)."""

    def requires_initial_data(self) -> bool:
        """Return whether data have to be written before the coupling begins."""

    def initialize(self) -> None:
        """Begin the coupling."""

    def is_coupling_ongoing(self) -> bool:
        """Return whether there are windows left."""

    def requires_writing_checkpoint(self) -> bool:
        """Return whether the state has to be kept, to come back to it."""

    def requires_reading_checkpoint(self) -> bool:
        """Return whether the window is gone through once more."""

    def is_time_window_complete(self) -> bool:
        """Return whether the last step has ended a window that stands."""

    def get_max_time_step_size(self) -> float:
        """Return what is left of the window [s]."""

    def read_data(
        self, mesh_name: str, data_name: str, vertex_ids: Any, relative_read_time: float
    ) -> NDArray[np.float64]:
        """Return data at a time from now on, within the window."""

    def write_data(self, mesh_name: str, data_name: str, vertex_ids: Any, values: Any) -> None:
        """Give data at the end of the step."""

    def advance(self, computed_time_step_size: float) -> None:
        """End a step [s]; exchanges the data at the end of a window."""

    def finalize(self) -> None:
        """End the coupling."""


def open_participant(name: str, config: Path) -> Participant:
    """Return the participant of a preCICE configuration, of one process.

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
