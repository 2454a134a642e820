"""The sheet or stack that is being formed, as the part that resin flows through.

:func:`part_of_sheet` and :func:`part_of_stack` make a part of the present state.
:class:`MovingPermeability` and :class:`MovingStack` keep the permeability of its filling up to date
while the fibres move.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.coupling.infiltration.formed_part import (
    NEEDED,
    FormedPart,
    blocks_of,
    fibre_directions,
    with_permeability,
)
from lcmchain.coupling.permeability import law_of, principal_permeabilities
from lcmchain.coupling.principal_permeability import unit
from lcmchain.coupling.solids.stack import StackForming
from lcmchain.elements.family import Body
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields import derive_fields
from lcmchain.fields.stack import plies_of
from lcmchain.fields.ugrid import TIME, UgridMesh, Variable
from lcmchain.mapping.sheet import FIBRE_FAMILIES, SHARE
from lcmchain.mapping.surfaces.averages import turned
from lcmchain.mapping.target import TargetMesh
from lcmchain.materials.law import fibre_angles
from lcmchain.scene import Scene
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.solver.simulation import Simulation, Snapshot

#: Vectors of a ply that the columns need, of as many families as it has.
FIBRES = tuple(f"{family}_{axis}" for family in FIBRE_FAMILIES for axis in "xyz")


def law_of_scene(scene: Scene) -> Permeability:
    """Return the permeability table of a scene with wet forming."""
    case = scene.wet_forming
    law = scene.permeability if case is None or case.permeability is None else case.permeability
    assert law is not None  # a scene without is refused
    return law


def part_of_sheet(
    scene: Scene, simulation: Simulation, snapshots: Sequence[Snapshot], points: np.ndarray
) -> FormedPart:
    """Return the sheet in the last of saved states; its cells are the elements in their order.

    Parameters
    ----------
    snapshots : the start, and any later ones.
    points : of its mid-surface then (N, 3) [m].
    """
    (body,) = simulation.model.bodies
    cells = np.asarray(body.mesh.sheet_faces, dtype=np.int64)
    target = TargetMesh(points, blocks_of(cells), {})
    fields = forming_datasets(scene, simulation, snapshots)["/"].isel({TIME: -1})
    return FormedPart(target, fields.drop_vars(TIME), str(scene.source.path or "the scene"))


def part_of_stack(
    scene: Scene,
    forming: StackForming,
    snapshots: Sequence[Snapshot],
    points: np.ndarray,
    law: Permeability,
) -> FormedPart:
    """Return the stack in the last of saved states; its cells are the columns.

    Thickness, fibre volume fraction, areal mass and permeability are those of all plies. Other
    fields without the name of a ply are those of the ply whose elements are the columns.

    Parameters
    ----------
    snapshots : the start, and any later ones; the last is the present.
    points : of the mid-surface of that ply (N, 3) [m].
    law : of the permeability.
    """
    simulation, shares = forming.simulation, forming.shares
    datasets = forming_datasets(scene, simulation, snapshots)
    sheets = {name: groups["/"].isel({TIME: -1}) for name, groups in plies_of(datasets)}
    bodies = simulation.model.bodies
    reference = bodies[forming.reference]
    mesh, part = UgridMesh("sheet"), sheets[reference.name].drop_vars(TIME)
    volume, area = forming.ply_volumes(), forming.area()
    total = shares.T @ volume
    added: dict[str, Variable] = {}
    for body in bodies:
        rows = slice(body.first_element, body.first_element + body.mesh.element_count)
        parts = shares[rows].multiply(volume[rows, None]).tocsr()
        sheet = sheets[body.name]
        for name in (*NEEDED, *(name for name in FIBRES if name in sheet)):
            values = sheet[name]
            mean = mean_over_columns(parts, values.values)
            added[f"{body.name}_{name}"] = mesh.on_cells(mean, dict(values.attrs))
        share = {"units": "1", "long_name": f"share of the column that the ply {body.name} has"}
        added[f"{SHARE}{body.name}"] = mesh.on_cells(parts.sum(axis=0) / total, share)

    def of_elements(name: str) -> np.ndarray:
        return np.concatenate([sheets[body.name][name].values for body in bodies])

    fraction, on_area = of_elements("fibre_volume_fraction"), of_elements("areal_fibre_mass")
    for name, values in {
        "thickness": total / area,
        "fibre_volume_fraction": (shares.T @ (fraction * volume)) / total,
        "areal_fibre_mass": (shares.T @ (on_area * volume / of_elements("thickness"))) / area,
    }.items():
        added[name] = mesh.on_cells(values, dict(part[name].attrs))
    cells = np.asarray(reference.mesh.sheet_faces, dtype=np.int64)
    formed = FormedPart(
        TargetMesh(points, blocks_of(cells), {}),
        part.assign(added).assign_attrs(datasets["/"].attrs),
        str(scene.source.path or "the scene"),
    )
    return with_permeability(formed, law, scene.source.directory)


def mean_over_columns(parts: csr_array, values: np.ndarray) -> np.ndarray:
    """Return means of values of elements (E,) in columns (C,), not a number in empty columns.

    parts : volume of each element in each column (E, C).
    """
    volume, summed = parts.sum(axis=0), parts.T @ np.asarray(values, dtype=float)
    return np.divide(summed, volume, out=np.full_like(summed, np.nan), where=volume > 0.0)


def fibre_fractions(simulation: Simulation) -> np.ndarray:
    """Return the fibre volume fractions of all elements at present (element_count,)."""
    positions = np.ascontiguousarray(simulation.state.position.T)
    fractions = []
    for body in simulation.model.bodies:
        nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
        now = derive_fields(body.mesh, body.material, positions[nodes])
        fractions.append(now["fibre_volume_fraction"])
    return np.concatenate(fractions)


def blank_of_scene(scene: Scene) -> FormedPart:
    """Return the blank or stack of a scene, before it is formed.

    A stack has the columns of :class:`~lcmchain.coupling.solids.stack.StackForming` for cells.
    """
    simulation = Simulation.from_scene(scene)
    if len(simulation.model.bodies) > 1:
        forming, law = StackForming.of_scene(scene, simulation), law_of_scene(scene)
        return part_of_stack(scene, forming, [simulation.snapshot()], forming.points(), law)
    (body,) = simulation.model.bodies
    points = body.mesh.mid_surface(simulation.model.node_positions)
    return part_of_sheet(scene, simulation, [simulation.snapshot()], points)


# --- permeability of the present -----------------------------------------------------------------


class MovingPermeability:
    """Sets the permeability of a filling by the fibres of a forming simulation.

    Within a time window the fibres keep their directions, and the permeability follows the fibre
    volume fraction as that of the preform does.

    Parameters
    ----------
    law : of the scene.
    preform : at the start. Where its permeability differs from that of the law, as in regions, the
        factor between them stays.
    directory : folder to which a file of the law is relative.
    """

    def __init__(
        self, simulation: Simulation, law: Permeability, preform: Preform, directory: Path | None
    ) -> None:
        self.simulation, self.law = simulation, law_of(law, directory)
        size = np.trace(preform.permeability, axis1=1, axis2=2)
        by_law = np.trace(self._principal(1.0 - preform.porosity)[0], axis1=1, axis2=2)
        self._factor = size / by_law

    def begin(self, filling: Filling) -> None:
        """Set fibres and permeability of a filling that has the present thickness."""
        self.renew(filling)

    def place(self, filling: Filling) -> None:
        """Set the present fibres of the filling: the cells of a sheet keep theirs."""

    def renew(self, filling: Filling) -> None:
        """Set the present permeability of the filling.

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
        """Return tensors in space (C, 3, 3) and values through the thickness (C,) [m²]."""
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

    Where plies come apart, the fibre volume fraction of the column falls below that of any ply. Out
    of the range of the law the permeability stays as it is until the end of the window.

    Parameters
    ----------
    law : of the scene.
    part : with the fibre directions of its cells.
    directory : folder to which a file of the law is relative.
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
    """Sets fibres and permeability of a filling by the columns of a stack.

    It also tells the stack which columns resist: those with resin.

    Each element keeps its volume of fibres. As plies slide on each other, fibres move to other
    columns. Resin stays in its column, and flows out where it has no room. Each ply conducts by its
    own fibre volume fraction: in parallel along the stack, in series through it. Gaps between plies
    do not conduct. Within a time window the columns keep their material, and the permeability
    follows the fibre volume fraction of the stack (:class:`WithinWindow`).

    Parameters
    ----------
    law, preform, directory : as of :class:`MovingPermeability`. In a region with more fibres each
        ply has more by the same factor.
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
        of_elements = fractions * forming.ply_volumes()
        shares = forming.shares
        of_columns = (1.0 - preform.porosity) * preform.thickness * forming.area()
        denser = of_columns / (shares.T @ of_elements)
        covered = np.asarray(shares.sum(axis=1)).ravel()
        beside = 1.0 - covered
        #: Volume of the fibres in the elements (element_count of the model,) [m³].
        self.fibre_volume = of_elements * (shares @ denser + beside)
        tensor = self._principal()[0]
        size = np.trace(preform.permeability, axis1=1, axis2=2)
        self._factor = size / np.trace(tensor, axis1=1, axis2=2)

    def begin(self, filling: Filling) -> None:
        """Set fibres and permeability of a filling that has the present thickness.

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
        """Find the columns at the present positions, and set their fibres in the filling."""
        self.forming.renew()
        filling.medium.fibre_volume = self.forming.shares.T @ self.fibre_volume

    def renew(self, filling: Filling) -> None:
        """Find the columns at the present positions, and set fibres and permeability.

        The pores keep their volume: a column that gets more fibres becomes thicker here, and has
        the volume of its plies at the end of the next window.

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
        """Return tensors in space (C, 3, 3) and values through the thickness (C,) [m²]."""
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
    """Return the permeability of columns of stacked elements.

    Elements conduct in parallel along the stack, each turned with its normal into the plane of the
    column, and in series through it, as in
    :func:`lcmchain.mapping.surfaces.averages.through_layers`.

    Parameters
    ----------
    parts : volume of each element in each column (E, C) [m³].
    values : principal permeabilities of the elements (E, 3) [m²], the last one through them.
    axes : their axes (E, 3, 3).
    normals : of the columns (C, 3).

    Returns
    -------
    Tensors in space (C, 3, 3) and values through the thickness (C,) [m²].
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
