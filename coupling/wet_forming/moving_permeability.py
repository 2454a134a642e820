"""What resin flows through while it is formed: permeability of the fibres where they are now.

And, of a stack whose plies slide on each other, which fibres there are in the columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.coupling.infiltration.formed_part import FormedPart, fibre_directions
from lcmchain.coupling.permeability import law_of, principal_permeabilities
from lcmchain.coupling.principal_permeability import unit
from lcmchain.coupling.solids.stack import StackForming
from lcmchain.elements.family import Body
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import derive_fields
from lcmchain.mapping.surfaces.averages import turned
from lcmchain.materials.law import fibre_angles
from lcmchain.scene.infiltration.laws import Permeability
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

    def begin(self, filling: Filling) -> None:
        """Give the filling what it knows of the present, in a state that fits to it."""
        self.renew(filling)

    def place(self, filling: Filling) -> None:
        """Give the filling the fibres of the present: the cells of a sheet keep theirs."""

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
        families, normals = fibres_and_normals(body, positions)
        found = principal_permeabilities(
            self.law, fraction, *families, normal=normals, out_of_range="raise"
        )
        values = np.stack([found.k1, found.k2], axis=1)
        axes = np.stack([found.direction_1, found.direction_2], axis=1)
        return np.einsum("cm,cmi,cmj->cij", values, axes, axes), found.k3


def fibres_and_normals(body: Body, positions: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Return directions of all families of fibres and normals of a body's elements, (C, 3) each."""
    now = derive_fields(body.mesh, body.material, positions)
    families = [
        np.stack([now[f"fibre_direction_{family}_{axis}"] for axis in "xyz"], axis=1)
        for family in range(1, 1 + len(fibre_angles(body.material)))
    ]
    base = body.mesh.base_vectors(positions)
    return families, unit(np.cross(base[:, 0], base[:, 1]))


class WithinWindow:
    """Factor on the permeability of columns within a time window, by the law of the scene.

    Where plies come apart, the fibre volume fraction of the column falls below that of any ply: a
    law that gives no value there leaves the permeability as it is, until the window ends.

    Parameters
    ----------
    law : of the scene. part : with the fibre directions of its cells.
    directory : folder to which a file that the law names is relative.
    """

    def __init__(self, law: Permeability, part: FormedPart, directory: Path | None) -> None:
        self.law = law_of(law, directory)
        self._families, self._normals = fibre_directions(part), part.target.surface.normals

    def __call__(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the factors (C,) for fibre volume fractions (C,) now and in the beginning."""
        ratio = self._in_plane(now) / self._in_plane(before)
        return np.where(np.isfinite(ratio), ratio, 1.0)

    def _in_plane(self, fraction: np.ndarray) -> np.ndarray:
        found = principal_permeabilities(
            self.law, fraction, *self._families, normal=self._normals, out_of_range="nan"
        )
        return found.k1 + found.k2


class MovingStack:
    """Gives a filling the fibres and the permeability of the columns of a stack.

    And tells the stack which columns resist: those with resin.

    The fibres keep their volume in each element. As plies slide on each other, they come to lie in
    other columns; resin stays in its column, and flows from there where it has no room. Each ply
    conducts by its own fibre volume fraction, and the layers side by side along the stack, one
    after the other through it; gaps between them conduct nothing. Within a time window the columns
    keep their material, and the permeability follows the fibre volume fraction of the stack
    (:class:`WithinWindow`).

    Parameters
    ----------
    law, preform, directory : as of :class:`MovingPermeability`. A region with more fibres has as
        many more in each ply.
    fractions : fibre volume fractions of the elements at the start (element_count of the model,).
    """

    def __init__(
        self,
        forming: StackForming,
        law: Permeability,
        preform: Preform,
        directory: Path | None,
        fractions: np.ndarray,
    ) -> None:
        self.forming, self.law = forming, law_of(law, directory)
        own = fractions * forming.ply_volumes()
        shares = forming.shares
        found = (1.0 - preform.porosity) * preform.thickness * forming.area()
        denser = found / (shares.T @ own)
        covered = np.asarray(shares.sum(axis=1)).ravel()
        beside = 1.0 - covered
        #: Volume of the fibres in the elements (element_count of the model,) [m³].
        self.fibre_volume = own * (shares @ denser + beside)
        tensor = self._principal()[0]
        size = np.trace(preform.permeability, axis1=1, axis2=2)
        self._factor = size / np.trace(tensor, axis1=1, axis2=2)

    def begin(self, filling: Filling) -> None:
        """Give the filling what it knows of the present, in a state that fits to it.

        Raises
        ------
        SimulationError : a fibre volume fraction is out of the range of the law.
        """
        self.place(filling)
        cells = filling.mesh.cells
        self.forming.resisting = (filling.state.full[cells] & (cells >= 0)).any(axis=1)
        try:
            tensor, through = self._principal()
        except InputError as error:
            raise SimulationError(
                f"the permeability law ends at {filling.time:.4g} s of the filling: {error}"
            ) from error
        filling.set_permeability(self._factor[:, None, None] * tensor, self._factor * through)

    def place(self, filling: Filling) -> None:
        """Let the columns lie where the plies are, and give the filling their fibres."""
        self.forming.renew()
        filling.medium.fibre_volume = self.forming.shares.T @ self.fibre_volume

    def renew(self, filling: Filling) -> None:
        """Let the columns lie where the plies are, and give the filling what is in them.

        The pores stay as large as they are: a column that gets more fibres becomes thicker by them
        here, and has the volume of its plies at the end of the next window.

        Raises
        ------
        SimulationError : as of :meth:`begin`.
        """
        self.forming.renew()
        more = self.forming.shares.T @ self.fibre_volume - filling.medium.fibre_volume
        filling.medium.fibre_volume = filling.medium.fibre_volume + more
        filling.set_thickness(filling.state.thickness + more / filling.mesh.areas)
        self.begin(filling)

    def _principal(self) -> tuple[np.ndarray, np.ndarray]:
        """Tensors in space (C, 3, 3) and values through the thickness (C,) [m2]."""
        forming, model = self.forming, self.forming.simulation.model
        positions = np.ascontiguousarray(forming.simulation.state.position.T)
        volume = forming.ply_volumes()
        values, axes = [], []
        for body in model.bodies:
            rows = slice(body.first_element, body.first_element + body.mesh.element_count)
            nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
            families, normals = fibres_and_normals(body, positions[nodes])
            fraction = self.fibre_volume[rows] / volume[rows]
            found = principal_permeabilities(
                self.law, fraction, *families, normal=normals, out_of_range="raise"
            )
            values.append(np.stack(found[:3], axis=1))
            axes.append(np.stack(found[3:], axis=1))
        parts = forming.shares * volume[:, None]
        tensor, through = through_columns(
            parts, np.concatenate(values), np.concatenate(axes), forming.normals()
        )
        plies = parts.sum(axis=0) / forming.volume()
        return tensor * plies[:, None, None], through / plies


def through_columns(
    parts: csr_array, values: np.ndarray, axes: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the permeability of columns of elements that lie over each other.

    Along the stack they conduct side by side, each turned with its normal into the plane of the
    column, and through it one after the other, as of
    :func:`lcmchain.mapping.surfaces.averages.through_layers`.

    Parameters
    ----------
    parts : volume of each element in each column (E, C) [m³]. values, axes : principal
        permeabilities of the elements (E, 3) [m2], the last one through them, and their axes
        (E, 3, 3). normals : of the columns (C, 3).

    Returns
    -------
    Tensors in space (C, 3, 3) and values through the thickness (C,) [m2].
    """
    entries = parts.tocoo()
    element, column = entries.coords
    count = len(normals)
    volume = np.bincount(column, entries.data, minlength=count)
    tensor = np.zeros((count, 3, 3))
    for number in (0, 1):
        along = turned(axes[element, number], axes[element, 2], normals[column])
        weight = entries.data * values[element, number]
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            summed = np.bincount(column, weight * along[:, i] * along[:, j], minlength=count)
            tensor[:, i, j] += summed / volume
    tensor[:, [1, 2, 2], [0, 0, 1]] = tensor[:, [0, 0, 1], [1, 2, 2]]
    resistance = np.bincount(column, entries.data / values[element, 2], minlength=count)
    return tensor, volume / resistance
