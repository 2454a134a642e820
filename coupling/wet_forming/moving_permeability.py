"""Permeability of a textile while it is formed: of the fibres where they are now."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.preform import Preform
from lcmchain.coupling.permeability import law_of, principal_permeabilities
from lcmchain.coupling.principal_permeability import unit
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import derive_fields
from lcmchain.materials.law import fibre_angles
from lcmchain.scene.permeability import Permeability
from lcmchain.solver.simulation import Simulation


class MovingPermeability:
    """Gives a filling the permeability of the fibres of a forming simulation.

    Within a time window the fibres keep their directions, and the permeability follows the fibre
    volume fraction as that of the preform does.

    Parameters
    ----------
    law : of the scene. directory : folder to which a file that it names is relative.
    preform : as it was set up; where its permeability at the start is another than that of the law,
        as in regions, it stays larger or smaller by the same factor.
    """

    def __init__(
        self, simulation: Simulation, law: Permeability, preform: Preform, directory: Path | None
    ) -> None:
        self.simulation, self.law = simulation, law_of(law, directory)
        size = np.trace(preform.permeability, axis1=1, axis2=2)
        own = np.trace(self._principal(1.0 - preform.porosity)[0], axis1=1, axis2=2)
        self._factor = size / own

    def renew(self, filling: Filling) -> None:
        """Give the filling the permeability of the present.

        Raises
        ------
        SimulationError : a fibre volume fraction is out of the range of the law.
        """
        fraction = filling.medium.fibre_fraction(filling.state.thickness)
        try:
            tensor, through = self._principal(fraction)
        except InputError as error:
            raise SimulationError(
                f"the permeability law ends at {filling.time:.4g} s of the filling: {error}"
            ) from error
        filling.set_permeability(self._factor[:, None, None] * tensor, self._factor * through)

    def _principal(self, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tensors in space (C, 3, 3) and values through the thickness (C,) [m2]."""
        (body,) = self.simulation.model.bodies
        positions = np.ascontiguousarray(self.simulation.state.position.T)
        now = derive_fields(body.mesh, body.material, positions)
        families = [
            np.stack([now[f"fibre_direction_{family}_{axis}"] for axis in "xyz"], axis=1)
            for family in range(1, 1 + len(fibre_angles(body.material)))
        ]
        base = body.mesh.base_vectors(positions)
        normal = unit(np.cross(base[:, 0], base[:, 1]))
        found = principal_permeabilities(
            self.law, fraction, *families, normal=normal, out_of_range="raise"
        )
        values = np.stack([found.k1, found.k2], axis=1)
        axes = np.stack([found.direction_1, found.direction_2], axis=1)
        return np.einsum("cm,cmi,cmj->cij", values, axes, axes), found.k3
