"""A stack of plies that is formed, as the solid side of a coupling: columns through all plies.

The fluid has one pressure in each *column*, which goes through all plies and the gaps between them.
The elements of the ply with the largest area are the columns. An element of another ply belongs to
the columns that its area overlaps at present. :mod:`lcmchain.effects.pore_pressure` says where the
pressure acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from lcmchain.coupling.infiltration.formed_part import blocks_of
from lcmchain.coupling.solids.explicit import DAMPED_SHARE, ExplicitForming, SavedForming
from lcmchain.effects.pore_pressure import PoreColumns, mobilities, of_columns
from lcmchain.elements.family import Body
from lcmchain.errors import InputError
from lcmchain.fields.stack import REACH
from lcmchain.interfaces.in_frames import GAP
from lcmchain.mapping.surfaces.intersection import overlaps
from lcmchain.mapping.surfaces.surface import Surface
from lcmchain.mapping.target import TargetMesh
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.scene import Scene
from lcmchain.solver.simulation import Simulation

#: An element with more than the larger of these shares of its area over columns counts as wholly
#: over them: tangent planes and facets of two meshes of the same curved surface differ by a few per
#: cent. Up to the smaller share the rest hangs over; in between the rest is reduced linearly.
HANGS_OVER, WHOLLY = 0.8, 0.9
#: Shares below this are rounding of faces that share an edge.
ROUNDING = 1e-9
#: Gaps over the thickness of the thinner of two plies: up to the smaller one the fluid joins them,
#: from the larger one on it does not. Contact has no gap beyond half a thickness.
JOINED, APART = 0.25, 0.5


class StackForming(ExplicitForming):
    """A forming simulation of several plies with a fluid between and in them.

    It is an :class:`ExplicitForming` whose cells are the columns: pressures, resistances, volumes
    and areas are theirs. The columns are found anew at the begin of a step, and follow the material
    during the step.

    Parameters
    ----------
    simulation : of several plies with a thickness, which touch each other, whose model was built
        with ``pore_pressure=True``.
    unlike : whether plies end inside others, so that parts of their faces face other plies than the
        next ones, or are bare. Else the faces between the plies face each other, however far they
        have slid.
    surroundings, ramped : as of :class:`ExplicitForming`. The part of an element beside all columns
        has the pressure of the surroundings.

    Raises
    ------
    InputError : the model has no pore pressure, one sheet, or plies that do not touch.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        unlike: bool = False,
        surroundings: float = 0.0,
        ramped: bool = False,
    ) -> None:
        self._unlike = unlike
        super().__init__(simulation, surroundings=surroundings, ramped=ramped)

    @classmethod
    def of_scene(
        cls, scene: Scene, simulation: Simulation, *, surroundings: float = 0.0
    ) -> StackForming:
        """Return the forming of the stack of a scene; parameters are those of the class."""
        unlike = not scene.stack.has_one_outline
        return cls(simulation, unlike=unlike, surroundings=surroundings)

    def _sheet(self) -> Body:
        model = self.simulation.model
        if len(model.bodies) < 2 or model.ply_contact is None:
            raise InputError("the model is no stack of plies that touch each other")
        self._bodies: Sequence[Body] = model.bodies
        #: Number of the ply whose elements are the columns.
        self.reference = largest_ply([body.mesh for body in model.bodies])
        body = model.bodies[self.reference]
        #: Columns whose fluid resists the change of their volume (C,): those that hold any.
        self.resisting = np.ones(body.mesh.element_count, dtype=bool)
        self._own = slice(body.first_element, body.first_element + body.mesh.element_count)
        self._body = body
        self._renewed_at = np.empty(0)
        self.renew()
        return body

    @property
    def element_count(self) -> int:
        """Number of columns."""
        return self._body.mesh.element_count

    def renew(self) -> None:
        """Find the columns at the present positions of the plies."""
        positions = self._positions()
        if np.array_equal(positions, self._renewed_at):  # an iteration begins at the same positions
            return
        self._renewed_at = positions.copy()
        self.shares = shares_of_columns(self._bodies, self.reference, positions)
        model = self.simulation.model
        self._columns = PoreColumns.of_shares(self._lanes, self.shares, self._own.start)
        if self._unlike:
            self._find_inner_faces(positions)
        self.simulation.model = replace(model, pore=self._lanes, pore_columns=self._columns)

    def _find_inner_faces(self, positions: np.ndarray) -> None:
        """Find the part of every face that faces another ply, and pass it to the time loop."""
        counts = [body.mesh.element_count for body in self._bodies]
        ply = np.repeat(np.arange(len(counts)), counts)
        own = [positions[self._nodes(body)] for body in self._bodies]
        area, centre = (np.concatenate(values) for values in zip(*(
            (body.mesh.areas(at), at[body.mesh.elements].mean(axis=1))
            for body, at in zip(self._bodies, own, strict=True)
        ), strict=True))  # fmt: skip
        plies = PliesInColumns.of_elements(
            self.shares, ply, area, self.ply_volumes(), centre, (self.area(), self.normals())
        )
        thicknesses = [float(body.material.thickness) for body in self._bodies]
        #: Part of the lower and upper face of every element that faces another ply (E,).
        self.inner = tuple(
            inner_parts(self.shares, ply, plies.part, facing)
            for facing in plies.facing(thicknesses)
        )
        below, above = self.inner
        self._lanes = self._lanes._replace(
            bottom=self._lanes.in_lanes(1.0 - below), top=self._lanes.in_lanes(1.0 - above)
        )

    def advance(self, step: float) -> None:
        self.renew()
        super().advance(step)

    def save(self) -> SavedForming:
        return replace(super().save(), columns_at=self._renewed_at.T.copy())

    def restore(self, saved: SavedForming) -> None:
        super().restore(saved)
        # outputs of the last step belong to the columns at its begin
        position = self.simulation.state.position
        present = position.copy()
        position[:] = saved.columns_at
        self.renew()
        position[:] = present

    # --- shape ------------------------------------------------------------------------------------

    def node_positions(self) -> np.ndarray:
        """Return the present positions of the reference ply's nodes (node_count, 3) [m]."""
        return self._positions()[self._nodes(self._body)]

    def _positions(self) -> np.ndarray:
        return np.ascontiguousarray(self.simulation.state.position.T)

    @staticmethod
    def _nodes(body: Body) -> slice:
        return slice(body.first_node, body.first_node + body.mesh.node_count)

    def volume(self) -> np.ndarray:
        """Return the volumes of the columns (C,) [m³], with the gaps between the plies."""
        volume = super()._volumes_and_rates()[0] + self._gaps()
        return self.shares.T @ volume

    def ply_volumes(self) -> np.ndarray:
        """Return the volumes of the elements of all plies (element_count of the model,) [m³]."""
        return super()._volumes_and_rates()[0]

    def _gaps(self) -> np.ndarray:
        """Return half the volume of the gaps at both faces of each element [m³].

        The face across the gap has the other half. Penetrations of the contact are negative gaps.
        """
        model = self.simulation.model
        assert model.ply_contact is not None
        gap = np.nan_to_num(self.simulation.between_plies(model.ply_contact.data)[GAP])
        positions, found = self._positions(), []
        for number, body in enumerate(self._bodies):
            nodes = self._nodes(body)
            area = body.mesh.areas(positions[nodes])
            at = gap[nodes][body.mesh.elements]
            below = at[:, :4].mean(axis=1) if number > 0 else 0.0
            above = at[:, 4:].mean(axis=1) if number < len(self._bodies) - 1 else 0.0
            if self._unlike:
                rows = slice(body.first_element, body.first_element + body.mesh.element_count)
                below, above = at[:, :4].mean(axis=1), at[:, 4:].mean(axis=1)
                below, above = below * self.inner[0][rows], above * self.inner[1][rows]
            found.append(0.5 * area * (below + above))
        return np.concatenate(found)

    # --- pressures --------------------------------------------------------------------------------

    def present_pressure(self) -> np.ndarray:
        return self.simulation.state.pore_pressure[self._columns.lane] + self.surroundings

    def _pressure_in_lanes(self, pressure: np.ndarray) -> np.ndarray:
        return self._lanes.in_lanes(self.shares @ (pressure - self.surroundings))

    def _resistance_in_lanes(self) -> np.ndarray:
        lanes = np.zeros(self._lanes.padded_count)
        lanes[self._columns.lane] = self._resistance
        return lanes

    # --- answers ----------------------------------------------------------------------------------

    def _mobility(self) -> np.ndarray:
        """Return an upper bound of the columns' accelerations of volume per pressure (C,) [m⁴/kg].

        In a column of elements with the gradients g_e and the masses m_e the fastest motion has
        (Σ W_e g_e)² / Σ W_e m_e, which is at most Σ W_e g_e²/m_e.
        """
        return of_columns(self._columns, mobilities(self._lanes, self.simulation.state.position))

    def _next_resistance(self) -> np.ndarray:
        # plies of a dry column may come apart; a resistance would delay that by many iterations
        bearable = 2.0 * DAMPED_SHARE / (self.simulation.control.step * self._mobility())
        return np.where(self.resisting, bearable, 0.0)

    def compliance(self) -> np.ndarray:
        """Return the change of volume per pressure over the last step (C,) [m³/Pa].

        As for one sheet. The compliances of the plies and of the springs between them add up. By
        inertia the outer faces move first.
        """
        area = self.area()
        held = 1.0 / self._static_compliance() + self._contact_stiffness(area) / area**2
        return np.minimum(1.0 / held, 0.5 * self._step**2 * self._mobility())

    def longest_window(self) -> float:
        omega2 = self._mobility() / self._static_compliance()
        return float(np.pi / np.sqrt(omega2.max()))

    def _static_compliance(self) -> np.ndarray:
        of_plies = [self._compliance_of(body) for body in self._bodies]
        return self.shares.T @ np.concatenate(of_plies) + self._between_plies()

    def _between_plies(self) -> np.ndarray:
        """Return the compliance of the springs between the plies (C,) [m³/Pa]."""
        contact = self.simulation.model.ply_contact
        assert contact is not None
        numbers = np.arange(len(self._bodies) - 1)
        interface = contact.data.interface[numbers, numbers + 1]
        penalty = contact.data.penalty[interface[interface >= 0]]
        return self.area() * np.sum(1.0 / penalty)

    def _touched(self) -> tuple[np.ndarray, np.ndarray]:
        if self._unlike:
            return self._touched_part(0), self._touched_part(1)
        force, found = self.simulation.state.contact_force > 0.0, []
        for body, face in ((self._bodies[0], slice(0, 4)), (self._bodies[-1], slice(4, 8))):
            touched = force[self._nodes(body)][body.mesh.elements[:, face]].mean(axis=1)
            shares = self.shares[body.first_element : body.first_element + len(touched)]
            total = shares.sum(axis=0)
            there = shares.T @ touched
            found.append(np.divide(there, total, out=np.zeros_like(there), where=total > 0.0))
        return found[0], found[1]

    def _touched_part(self, side: int) -> np.ndarray:
        """Return the part of the bare faces below (0) or above (1) that tools touch (C,)."""
        force, positions = self.simulation.state.contact_force > 0.0, self._positions()
        bare, touched = np.zeros((2, self._lanes.place.size))
        for body in self._bodies:
            rows = slice(body.first_element, body.first_element + body.mesh.element_count)
            own = self._nodes(body)
            at = body.mesh.elements[:, 4 * side : 4 * side + 4]
            bare[rows] = body.mesh.areas(positions[own]) * (1.0 - self.inner[side][rows])
            touched[rows] = bare[rows] * force[own][at].mean(axis=1)
        total, there = self.shares.T @ bare, self.shares.T @ touched
        return np.divide(there, total, out=np.zeros_like(there), where=total > 0.0)


def forming_of_scene(
    scene: Scene, simulation: Simulation, *, surroundings: float = 0.0
) -> ExplicitForming:
    """Return the forming of one sheet or of a stack, with a fluid in it.

    Parameters
    ----------
    simulation : of the scene.
    surroundings : pressure around the sheet [Pa], see :class:`ExplicitForming`.
    """
    if len(simulation.model.bodies) > 1:
        return StackForming.of_scene(scene, simulation, surroundings=surroundings)
    return ExplicitForming(simulation, surroundings=surroundings)


def largest_ply(meshes: Sequence[SheetMesh]) -> int:
    """Return the number of the ply with the largest area, of equal ones the lowest."""
    area = np.array([mesh.areas(mesh.node_positions).sum() for mesh in meshes])
    return int(np.argmax(area >= area.max() * (1.0 - ROUNDING)))


def shares_of_columns(bodies: Sequence[Body], reference: int, positions: np.ndarray) -> csr_array:
    """Return the share of each element's area over each column (element_count, C).

    The sum of a row is at most 1, and less where the element hangs over.

    Parameters
    ----------
    reference : number of the body whose elements are the columns.
    positions : of all nodes (node_count, 3) [m].
    """
    surfaces = []
    for body in bodies:
        own = positions[body.first_node : body.first_node + body.mesh.node_count]
        faces = np.asarray(body.mesh.sheet_faces, dtype=np.int64)
        surfaces.append(Surface(np.ascontiguousarray(body.mesh.mid_surface(own)), faces))
    # the columns in the order of the elements: blocks hold runs of them
    target = TargetMesh(surfaces[reference].points, blocks_of(surfaces[reference].faces), {})
    cells = target.polygons(np.empty((0, 3)))
    reach = REACH * sum(body.material.thickness for body in bodies)
    rows, columns, values = [], [], []
    for body, surface in zip(bodies, surfaces, strict=True):
        if body is bodies[reference]:
            element = column = np.arange(surface.face_count)
            share = np.ones(surface.face_count)
        else:
            found = overlaps(surface, cells, reach)
            element, column = found.face, found.cell
            share = found.area / surface.areas[element]
            total = np.bincount(element, share, minlength=surface.face_count)
            whole = np.clip((total - HANGS_OVER) / (WHOLLY - HANGS_OVER), 0.0, 1.0)
            counted = total + whole * (1.0 - total)
            share = share * (counted / np.where(total > 0.0, total, 1.0))[element]
        kept = share > ROUNDING
        rows.append(body.first_element + element[kept])
        columns.append(column[kept])
        values.append(share[kept])
    shape = (sum(len(surface.faces) for surface in surfaces), target.cell_count)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(coo_array(entries, shape=shape))


# --- faces between plies, where plies end inside others -------------------------------------------
#
# Fluid between two plies presses on both of their faces (lcmchain.effects.pore_columns). So the
# parts of both faces that face each other must be equal at every place, else the fluid would push
# the stack as a whole. They are found column by column. A ply covers a part of a column. Parts of
# unlike size are nested: two plies face each other in the part that both cover and no ply between
# them covers. Where they have come apart, each face is bare.


class PliesInColumns(NamedTuple):
    """Plies of a stack in its columns, arrays (P, C).

    Parameters
    ----------
    part : of the area of the column that the ply covers, at most 1.
    height : of the ply's middle along the column's normal [m]; 0 where the ply is not.
    thickness : of the ply [m]; 0 where the ply is not.
    """

    part: np.ndarray
    height: np.ndarray
    thickness: np.ndarray

    @classmethod
    def of_elements(
        cls,
        shares: csr_array,
        ply: np.ndarray,
        area: np.ndarray,
        volume: np.ndarray,
        centre: np.ndarray,
        columns: tuple[np.ndarray, np.ndarray],
    ) -> PliesInColumns:
        """Gather the elements of each ply in each column.

        Parameters
        ----------
        shares : share of the area of each element over each column (E, C).
        ply : number of each element's ply (E,).
        area, volume, centre : of the elements [m², m³, m], (E,), (E,), (E, 3).
        columns : areas (C,) [m²] and normals (C, 3).
        """
        column_area, normals = columns
        count = int(ply.max()) + 1
        part, height, thickness = np.zeros((3, count, column_area.size))
        for number in range(count):
            rows = np.flatnonzero(ply == number)
            of_ply = shares[rows]
            covered = of_ply.T @ area[rows]
            there = covered > 0.0
            middle = of_ply.T @ (area[rows, None] * centre[rows])
            total = of_ply.T @ volume[rows]
            part[number] = np.minimum(covered / column_area, 1.0)
            height[number, there] = ((middle * normals).sum(axis=1)[there]) / covered[there]
            thickness[number, there] = total[there] / covered[there]
        return cls(part, height, thickness)

    def facing(self, thinnest: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of the columns in which each ply faces one below, and one above (P, C).

        thinnest : thickness of each ply at the start [m].
        """
        below, above = np.zeros_like(self.part), np.zeros_like(self.part)
        count = len(self.part)
        for lower in range(count):
            between = np.zeros(self.part.shape[1])
            for upper in range(lower + 1, count):
                both = np.minimum(self.part[lower], self.part[upper])
                seen = np.maximum(both - between, 0.0)
                gap = self.height[upper] - self.height[lower]
                gap = gap - 0.5 * (self.thickness[upper] + self.thickness[lower])
                wide = gap / min(thinnest[lower], thinnest[upper])
                joined = seen * np.clip((APART - wide) / (APART - JOINED), 0.0, 1.0)
                above[lower] += joined
                below[upper] += joined
                between = np.maximum(between, self.part[upper])
        return below, above


def inner_parts(
    shares: csr_array, ply: np.ndarray, part: np.ndarray, facing: np.ndarray
) -> np.ndarray:
    """Return the part of each element's face that faces another ply (E,).

    Parameters
    ----------
    shares, ply : as of :meth:`PliesInColumns.of_elements`.
    part, facing : parts of the columns that the plies cover, and in which they face another ply,
        (P, C).
    """
    of_ply = np.divide(facing, part, out=np.zeros_like(part), where=part > 0.0)
    entries = shares.tocoo()
    element, column = entries.coords
    seen = entries.data * of_ply[ply[element], column]
    total = np.bincount(element, entries.data, minlength=ply.size)
    found = np.bincount(element, seen, minlength=ply.size)
    return np.divide(found, total, out=np.zeros_like(total), where=total > 0.0)
