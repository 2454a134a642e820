"""A stack of plies that is formed, as the solid side of a coupling: columns through all plies.

The fluid has one pressure in each *column*, which goes through all plies and the gaps between them.
The elements of the ply that covers most are the columns; an element of another ply lies over those
that its area overlaps at present. What the pressure acts on: :mod:`lcmchain.effects.pore_pressure`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from lcmchain.coupling.infiltration.formed_part import blocks_of
from lcmchain.coupling.solids.explicit import DAMPED_SHARE, ExplicitForming, SavedForming
from lcmchain.coupling.solids.inner_faces import PliesInColumns, inner_parts
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

#: From the larger of these shares of its area on an element lies over columns with all of it:
#: tangent planes and facets of two meshes of the same curved surface disagree by a few per cent. Up
#: to the smaller one it hangs over, in between it goes from one to the other.
HANGS_OVER, WHOLLY = 0.8, 0.9
#: Shares below this are rounding of faces that share an edge.
ROUNDING = 1e-9


class StackForming(ExplicitForming):
    """A forming simulation of several plies with a fluid between and in them.

    As :class:`ExplicitForming`, whose cells here are the columns: pressures, resistances, volumes
    and areas are theirs. The columns lie where the plies are at the begin of a step; they stay with
    the material in it.

    Parameters
    ----------
    simulation : of several plies with a thickness, which touch each other, whose model was built
        with ``pore_pressure=True``.
    unlike : whether plies end inside others, so that parts of their faces look at other plies than
        the next ones, or lie bare (:mod:`.inner_faces`). Else the faces between the plies look at
        each other, however far they have slid.
    options : ``surroundings``, ``ramped`` as of :class:`ExplicitForming`. The part of an element
        that lies beside all columns has the pressure of the surroundings.

    Raises
    ------
    InputError : the model has no pore pressure, one sheet, or plies that do not touch.
    """

    def __init__(self, simulation: Simulation, *, unlike: bool = False, **options: Any) -> None:
        self._unlike = unlike
        super().__init__(simulation, **options)

    @classmethod
    def of_scene(cls, scene: Scene, simulation: Simulation, **options: Any) -> StackForming:
        """Return the forming of the stack of a scene; parameters are those of the class."""
        return cls(simulation, unlike=not scene.stack.has_one_outline, **options)

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
        """Let the columns lie where the plies are now."""
        positions = self._positions()
        if np.array_equal(positions, self._renewed_at):  # an iteration begins where the last did
            return
        self._renewed_at = positions.copy()
        self.shares = shares_of_columns(self._bodies, self.reference, positions)
        model = self.simulation.model
        self._columns = PoreColumns.of_shares(self._lanes, self.shares, self._own.start)
        if self._unlike:
            self._find_inner_faces(positions)
        self.simulation.model = replace(model, pore=self._lanes, pore_columns=self._columns)

    def _find_inner_faces(self, positions: np.ndarray) -> None:
        """Find the part of every face that looks at another ply, and tell the loop."""
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
        #: Part of the lower and upper face of every element that looks at another ply (E,).
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
        # outputs of the last step are those of the columns that it began with
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

        The face across the gap has the other half. Depths that contact leaves are negative gaps.
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

    def normal_thickness(self) -> np.ndarray:
        """Return the thickness that the laws of compaction see, of all plies (C,) [m]."""
        model, state, positions = self.simulation.model, self.simulation.state, self._positions()
        volume = []
        for body in self._bodies:
            condition = body.condition(state.position, model.history_of(body, state.history))
            area = body.mesh.areas(positions[self._nodes(body)])
            volume.append(area * condition.thickness_stretch * 2.0 * body.geometry.height)
        return (self.shares.T @ np.concatenate(volume)) / self.area()

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
        """Return how a column answers to its pressure, at most (C,) [m⁴/kg].

        Of a column of elements with the gradients g_e and the masses m_e the fastest motion has
        (Σ W_e g_e)² / Σ W_e m_e, which is at most Σ W_e g_e²/m_e.
        """
        return of_columns(self._columns, mobilities(self._lanes, self.simulation.state.position))

    def _next_resistance(self) -> np.ndarray:
        # plies of a dry column may come apart; resisted, they would take many iterations to do so
        bearable = 2.0 * DAMPED_SHARE / (self.simulation.control.step * self._mobility())
        return np.where(self.resisting, bearable, 0.0)

    def compliance(self) -> np.ndarray:
        """Return how much the volumes answer to their pressures over the last step (C,) [m³/Pa].

        As of one sheet. The compliances of the plies add up, with those of the springs between
        them; the outer faces are what inertia lets move first.
        """
        area = self.area()
        held = 1.0 / self._static_compliance() + self._contact_stiffness(area) / area**2
        return np.minimum(1.0 / held, 0.5 * self._step**2 * self._mobility())

    def longest_window(self) -> float:
        omega2 = self._mobility() / self._static_compliance()
        return float(np.pi / np.sqrt(omega2.max()))

    def _static_compliance(self) -> np.ndarray:
        own = [self._compliance_of(body) for body in self._bodies]
        return self.shares.T @ np.concatenate(own) + self._between_plies()

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


def forming_of_scene(scene: Scene, simulation: Simulation, **options: Any) -> ExplicitForming:
    """Return the forming of one sheet, or of a stack, that a fluid acts in.

    simulation : of the scene. options : as of :class:`ExplicitForming`.
    """
    if len(simulation.model.bodies) > 1:
        return StackForming.of_scene(scene, simulation, **options)
    return ExplicitForming(simulation, **options)


def largest_ply(meshes: Sequence[SheetMesh]) -> int:
    """Return the number of the ply that covers most, of equal ones the lowest."""
    area = np.array([mesh.areas(mesh.node_positions).sum() for mesh in meshes])
    return int(np.argmax(area >= area.max() * (1.0 - ROUNDING)))


def shares_of_columns(bodies: Sequence[Body], reference: int, positions: np.ndarray) -> csr_array:
    """Return the share of its area with which each element lies over each column.

    Parameters
    ----------
    reference : number of the body whose elements are the columns.
    positions : of all nodes (node_count, 3) [m].

    Returns
    -------
    (element_count, C); a row adds up to at most 1, and to less where the element hangs over.
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
