"""What the solver asks about the elements of a sheet between chunks of steps, for either kind."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from lcmchain.elements.membrane_shell.kernel import membrane_shell_state, nodal_frequency_bounds
from lcmchain.elements.solid_shell.energies import strain_energies, thickness_stretches
from lcmchain.elements.solid_shell.frequency import IN_PLANE_MODES, frequency_bounds
from lcmchain.elements.solid_shell.kernel import LANES
from lcmchain.model import Model
from lcmchain.solver import guards
from lcmchain.state import State

# The in-plane frequency changes slowly: its bound is renewed every so many chunks (see
# ``simulation.py``), unless the thickness wave comes near it.
THICKNESS_SHARE = 0.3


class SheetQueries(Protocol):
    """Answers about the sheet of a model in a given state; a kind of element gives them."""

    def require_sound(self, state: State) -> None:
        """Raise SimulationError where an element is inverted or collapsed."""

    def stored_energy(self, position: np.ndarray) -> tuple[float, float]:
        """Return strain energy and hourglass energy [J] at positions (3, node_count)."""

    def highest_frequency(self, position: np.ndarray) -> tuple[float, int, int]:
        """Return the largest ω² bound [1/s²], its element, and a code of what governs it."""

    def cause(self, code: int) -> str:
        """Say in words what governs the step."""

    def may_stiffen(self, omega2: float) -> bool:
        """Tell whether the bound may grow well above ``omega2`` within a few chunks."""


def sheet_queries(model: Model) -> SheetQueries:
    """Return the queries of the model's kind of element."""
    return SolidShellQueries(model) if model.membrane_shell is None else TriangleQueries(model)


class SolidShellQueries:
    """Queries of solid-shell elements; thickness is looked at in every :meth:`require_sound`."""

    def __init__(self, model: Model):
        self.model = model
        padded = model.corner_node.size // 8
        self._stretch = np.ones(padded)
        self._omega2 = np.zeros(padded)
        self._mode = np.zeros(padded, dtype=np.int64)
        height = model.geometry.height
        self._height = np.concatenate([height, np.repeat(height[-1:], padded - len(height))])

    def require_sound(self, state: State) -> None:
        thickness_stretches(state.position, self.model.corner_node, self._height, self._stretch)
        guards.require_upright(self.model, state, self._stretch[: self.model.element_count])

    def stored_energy(self, position: np.ndarray) -> tuple[float, float]:
        model = self.model
        count = model.corner_node.size // 8
        strain, bending, hourglass = np.empty((count, 6)), np.empty(count), np.empty(count)
        strain_energies(
            position,
            model.corner_node,
            model.element_data,
            *model.elements,
            strain,
            bending,
            hourglass,
        )
        real = slice(model.element_count)
        membrane = model.material.membrane_energy(strain[real]) * model.geometry.volume
        return membrane.sum() + bending[real].sum(), hourglass[real].sum()

    def highest_frequency(self, position: np.ndarray) -> tuple[float, int, int]:
        """The code is the mode vector whose row sum the bound is."""
        model = self.model
        frequency_bounds(
            position,
            model.corner_node,
            model.element_data,
            model.transformation,
            model.transformation_change,
            model.material.density,
            *model.elements,
            self._omega2,
            self._mode,
        )
        element = int(np.argmax(self._omega2[: model.element_count]))
        return float(self._omega2[element]), element, int(self._mode[element])

    def cause(self, code: int) -> str:
        return "in-plane stiffness" if code in IN_PLANE_MODES else "compaction (thickness)"

    def may_stiffen(self, omega2: float) -> bool:
        """The thickness wave may come to govern the step."""
        stretch = self._stretch[: self.model.element_count]
        thinnest = int(np.argmin(stretch))
        strain = np.zeros(6)
        strain[2] = 0.5 * (stretch[thinnest] ** 2 - 1.0)
        tangent = self.model.material.stress_and_tangent(strain)[1][2, 2]
        thickness2 = tangent / (self.model.material.density * self._height[thinnest] ** 2)
        return bool(thickness2 > THICKNESS_SHARE * omega2)


class TriangleQueries:
    """Queries of triangles with membrane and shell part."""

    CAUSES = ("in-plane stiffness", "bending stiffness")

    def __init__(self, model: Model):
        self.model = model
        padded = LANES * -(-model.element_count // LANES)
        self._strain = np.empty((padded, 6))
        self._area_ratio, self._bending = np.empty(padded), np.empty(padded)
        self._parts = np.empty((2, 6, model.node_count))
        self._omega2 = np.empty(model.node_count)
        self._part = np.empty(model.node_count, dtype=np.int64)

    def require_sound(self, state: State) -> None:
        self._evaluate(state.position)
        guards.require_area(self.model, state, self._area_ratio[: self.model.element_count])

    def stored_energy(self, position: np.ndarray) -> tuple[float, float]:
        self._evaluate(position)
        model, real = self.model, slice(self.model.element_count)
        density = model.material.membrane_energy(self._strain[real])
        volume = model.geometry.area * model.material.thickness
        return (density * volume).sum() + self._bending[real].sum(), 0.0

    def highest_frequency(self, position: np.ndarray) -> tuple[float, int, int]:
        """The code is 0 where the membrane governs, 1 where bending does."""
        model = self.model
        nodal_frequency_bounds(
            position,
            model.corner_node,
            model.element_data,
            model.element_count,
            model.nodes.mass,
            *model.membrane_shell,
            *self._parts,
            self._omega2,
            self._part,
        )
        node = int(np.argmax(self._omega2))
        element = int(np.flatnonzero((model.blank.elements == node).any(axis=1))[0])
        return float(self._omega2[node]), element, int(self._part[node])

    def cause(self, code: int) -> str:
        return self.CAUSES[code]

    def may_stiffen(self, omega2: float) -> bool:
        """Never: fibres and bending have constant stiffnesses, the shear is much softer."""
        return False

    def _evaluate(self, position: np.ndarray) -> None:
        model = self.model
        membrane_shell_state(
            position,
            model.corner_node,
            model.element_data,
            *model.membrane_shell,
            self._strain,
            self._area_ratio,
            self._bending,
        )
