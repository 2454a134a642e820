"""Filling of a porous sheet with resin: the time loop over pressure, front and transport."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.coupling.infiltration.boundaries import Gate, RaceTrack, Vent
from lcmchain.coupling.infiltration.mesh import FlowMesh
from lcmchain.coupling.infiltration.preform import Preform
from lcmchain.coupling.infiltration.state import FillingFrame, FillingResult, FillingState


@dataclass(frozen=True)
class FillingOptions:
    """How a filling is computed.

    Parameters
    ----------
    front_step : control volumes that the front may cross in a time step, of the mean speed.
    largest_step : [s].
    trapped_air : air that no vent reaches is compressed (ideal gas, isothermal; all pressures
        absolute) instead of vanishing at the vent's pressure.
    """

    front_step: float = 0.6
    largest_step: float = np.inf
    trapped_air: bool = False


class Filling:
    """Darcy flow with a moving front in a sheet.

    Parameters
    ----------
    mesh, preform : where, and through what.
    resin : law of viscosity and cure (:mod:`lcmchain.coupling.infiltration.resin`), or the
        viscosity [Pa s].
    gates, vents : where resin enters and air leaves.
    gravity : acceleration [m/s2], shape (3,); needs a resin with a density.
    wetted : fill factors at the start, shape (N,), or rows of nodes that are full.
    film : resin film on the sheet (:mod:`lcmchain.coupling.infiltration.film`): has
        ``start(filling)``, ``inflow(filling) -> (N,)`` [m3/s] and ``taken(filling, volume)``.
    edges : race tracks.

    Raises
    ------
    InputError : no vent, no source, nodes beyond the mesh, a part of the mesh without a source.
    """

    state: FillingState

    def __init__(
        self,
        mesh: FlowMesh,
        preform: Preform,
        resin: object,
        gates: Sequence[Gate],
        vents: Sequence[Vent],
        *,
        gravity: np.ndarray | None = None,
        wetted: np.ndarray | None = None,
        film: object | None = None,
        edges: Sequence[RaceTrack] = (),
        options: FillingOptions | None = None,
    ) -> None:
        raise NotImplementedError

    @property
    def time(self) -> float:
        return self.state.time

    @property
    def filled_share(self) -> float:
        """Resin over pore volume of the whole sheet."""
        raise NotImplementedError

    def advance(
        self, until: float, on_step: Callable[[Filling], None] | None = None
    ) -> tuple[str, str]:
        """Fill up to a time [s]; return outcome and message (:class:`FillingResult`).

        ``on_step`` is called after every time step; what it raises stops the filling between two
        steps.
        """
        raise NotImplementedError

    def run(
        self, until: float, frames: int = 20, on_step: Callable[[Filling], None] | None = None
    ) -> FillingResult:
        """Fill up to a time [s] and save frames at equal filled shares."""
        raise NotImplementedError

    def frame(self) -> FillingFrame:
        """Return the fields of the present state."""
        raise NotImplementedError

    def save(self) -> FillingState:
        """Return a copy of the state."""
        return self.state.copy()

    def restore(self, saved: FillingState) -> None:
        """Go back to a saved state; going on from it is bit-identical."""
        raise NotImplementedError

    def set_thickness(self, thickness: np.ndarray, rate: np.ndarray | None = None) -> None:
        """Move the preform: thickness [m] and its rate [m/s], shape (C,).

        The thickness goes on linearly with its rate while the filling advances. Fibres keep their
        volume per cell; porosity and permeability follow.
        """
        raise NotImplementedError

    def set_points(self, points: np.ndarray) -> None:
        """Move the nodes [m], shape (N, 3); fibres keep their volume per cell."""
        raise NotImplementedError
