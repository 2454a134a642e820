"""A sheet of triangles with membrane and shell part: building it, and what the solver asks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from lcmchain.elements.blocks import LANES, in_blocks
from lcmchain.elements.family import Condition, ReferenceFrequencies, Unsound, shear_may_stiffen
from lcmchain.elements.fibre_volume import (
    CAUSE_OF_SHEAR,
    initial_fibre_volume_fraction,
    overfilled,
)
from lcmchain.elements.membrane_shell.kernel import (
    MembraneShellData,
    membrane_shell_state,
    nodal_frequency_bounds,
    patch_nodes_in_blocks,
    patch_rows,
)
from lcmchain.elements.membrane_shell.membrane import (
    MembraneData,
    membrane_data,
    membrane_frequency_bounds,
    membrane_state_loop,
)
from lcmchain.elements.membrane_shell.patch import (
    CORNERS,
    TriangleGeometry,
    angle_shares,
    triangle_geometry,
)
from lcmchain.elements.membrane_shell.table import MembraneShellElement
from lcmchain.errors import InputError
from lcmchain.materials.features.shear_friction import shear_friction_of
from lcmchain.materials.law import (
    Material,
    bending_losses_of,
    bends_by_curves,
    history_count,
    knows_step,
    plane_bending_stiffness,
    serves_planes,
)
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.cells import SWEEPS, nodal_bound
from lcmchain.mesh.mid_surface import TriangleMesh, triangulate

# Below this fraction of its initial area a triangle counts as collapsed: the fibres are sheared to
# within 3 degrees of each other.
COLLAPSED_AREA = 0.05


# A body is found by identity: arrays have no single truth of being equal.
@dataclass(frozen=True, eq=False)
class MembraneShellBody:
    """Triangles of one material; see :class:`lcmchain.elements.family.Body`.

    mass_factor : (mesh.node_count,) inertia of the nodes over their mass, None for their mass.
    """

    name: str
    mesh: TriangleMesh
    material: Material
    geometry: TriangleGeometry
    data: MembraneShellData | MembraneData
    first_node: int
    first_element: int
    mass_factor: np.ndarray | None = None

    type = "membrane-shell"
    hourglass_tells = True  # there is none
    without_potential = ()
    CAUSES = ("in-plane stiffness", "bending stiffness")

    @staticmethod
    def mesh_of(blank: BlankMesh) -> TriangleMesh:
        return triangulate(blank)

    @classmethod
    def build(
        cls,
        name: str,
        mesh: TriangleMesh,
        material: Material,
        choices: MembraneShellElement,
        first_node: int,
        first_element: int,
    ) -> Self:
        """Build the body; without ``choices.bending`` no curvature is computed or kept.

        Raises
        ------
        InputError : triangles without area, or a material that does not serve them.
        """
        if bends_by_curves(material):
            raise InputError(
                f"of {material.name} follows a curve, unknown to elements without thickness; "
                'use element = "solid-shell", or leave out curve_1 and curve_2',
                key="material.bending",
            )
        if bending_losses_of(material) is not None:
            raise InputError(
                f"of {material.name} loses energy (friction_1, viscous_1), unknown to elements "
                'without thickness; use element = "solid-shell", or leave them out',
                key="material.bending",
            )
        if shear_friction_of(material) is not None:
            raise InputError(
                f"of {material.name} is unknown to elements without thickness; use element = "
                '"solid-shell", or leave it out',
                key="material.membrane.friction",
            )
        if knows_step(material.law):
            raise InputError(
                f"of {material.name} is unknown to elements without thickness; use element = "
                '"solid-shell", or leave it out',
                key="material.viscous",
            )
        if not serves_planes(material.law) or history_count(material.law):
            raise InputError(
                f"{material.name} does not serve sheets without thickness; use element = "
                '"solid-shell"',
                key="material.law",
            )
        geometry = triangle_geometry(mesh, plane_bending_stiffness(material.law))
        thickness = float(material.thickness)
        if not choices.bending:
            membrane = membrane_data(material.law, thickness, geometry, first_node)
            corners = geometry._replace(
                nodes=geometry.nodes[:, :CORNERS], curvature=geometry.curvature[:, :, :0]
            )
            return cls(name, mesh, material, corners, membrane, first_node, first_element)
        data = MembraneShellData(
            law=material.law,
            thickness=thickness,
            corner_node=patch_nodes_in_blocks(geometry, first_node),
            element_data=in_blocks(patch_rows(geometry)),
            element_count=mesh.element_count,
        )
        return cls(name, mesh, material, geometry, data, first_node, first_element)

    @property
    def has_bending(self) -> bool:
        """Whether the shell part is compiled in."""
        return isinstance(self.data, MembraneShellData)

    @property
    def kernel(self) -> str:
        return self.type if self.has_bending else "membrane"

    @property
    def force_nodes(self) -> np.ndarray:
        return self.geometry.nodes

    @property
    def contact_offset(self) -> float:
        return 0.5 * float(self.material.thickness)  # the nodes lie on the mid-surface

    @property
    def node_mass(self) -> np.ndarray:
        return self.material.areal_mass * self.node_area

    @property
    def inertial_mass(self) -> np.ndarray:
        return self.node_mass if self.mass_factor is None else self.mass_factor * self.node_mass

    @property
    def least_mass_factor(self) -> float:
        return 1.0 if self.mass_factor is None else float(self.mass_factor.min())

    @property
    def part_omega2(self) -> np.ndarray:
        """Of the nodes."""
        in_plane = self.material.wave_stiffness()[0] / self.material.density
        return in_plane * self.fibre_bound[0]

    def with_mass_factor(self, factor: np.ndarray) -> Self:
        return replace(self, mass_factor=factor)

    @cached_property
    def node_area(self) -> np.ndarray:
        """Area of the nodes [m²], the parts of their triangles by angle."""
        return self._at_nodes(self.geometry.area)

    @cached_property
    def fibre_bound(self) -> tuple[np.ndarray, np.ndarray]:
        """Bound of ω²/c² in the reference by each node [1/m²], c the speed of the fibre wave.

        And the weights of the nodes with which it holds, which are 1 where no cell is cut.
        """
        corners = self.mesh.elements
        shares = angle_shares(self.mesh.node_positions[corners])
        sweeps = SWEEPS if self.mesh.is_cut else 1
        gradient = np.abs(self.geometry.gradient)
        return nodal_bound(corners, gradient, shares, self.geometry.area, sweeps)

    def present_node_area(self, positions: np.ndarray) -> np.ndarray:
        own = positions[:, self.first_node : self.first_node + self.mesh.node_count].T
        return self._at_nodes(self.mesh.areas(own))

    @cached_property
    def shortest_length(self) -> float:
        if self.mesh.is_cut:  # cut triangles share mass with their neighbours
            return 2.0 / math.sqrt(float(self.fibre_bound[0].max()))
        return float(2.0 / np.abs(self.geometry.gradient).sum(axis=1).max())

    @property
    def volume(self) -> float:
        return float(self.node_mass.sum()) / self.material.density

    def effects(self) -> dict[str, tuple[bool, str]]:
        return {
            "thickness": (False, "triangles on the mid-surface have none"),
            "compaction": (False, "the mid-surface has no thickness direction"),
            "shear-compaction coupling": (False, "the mid-surface has no thickness direction"),
            "bending": (
                (True, "C^B, superimposed on the membrane; rotation-free")
                if self.has_bending
                else (False, "element.bending = false")
            ),
            "transverse shear": (False, "the normal of a triangle stays normal"),
            "hourglass control": (False, "constant strain triangles have no zero-energy mode"),
            "enhanced strain": (False, "no thickness direction"),
            "memory": (False, "the law remembers nothing"),
        }

    def stored_energy(self, positions: np.ndarray, history: np.ndarray) -> tuple[float, float]:
        strain, _, bending = self._evaluate(positions)
        density = self.material.membrane_energy(strain)
        volume = self.geometry.area * self.material.thickness
        return (density * volume).sum() + bending.sum(), 0.0

    def hourglass_energies(self, positions: np.ndarray, history: np.ndarray) -> np.ndarray:
        return np.zeros(self.mesh.element_count)

    @property
    def history_count(self) -> int:
        return 0

    def renew(
        self, positions: np.ndarray, history: np.ndarray, counted_at: np.ndarray | None = None
    ) -> float:
        return 0.0  # triangles read the nodes of their neighbours in every step

    def normal_pressure(self, positions: np.ndarray, history: np.ndarray) -> None:
        return None

    def dissipated_energy(self, history: np.ndarray) -> float:
        return 0.0

    def viscous_energy(self, history: np.ndarray) -> float:
        return 0.0

    def damping_rate(self, positions: np.ndarray, history: np.ndarray) -> float:
        return 0.0

    def highest_frequency(
        self, positions: np.ndarray, history: np.ndarray, mass: np.ndarray
    ) -> tuple[float, int, int]:
        """The code is 0 where the membrane governs, 1 where bending does."""
        membrane, bending = np.empty((2, 6, mass.size))
        omega2, part = np.empty(mass.size), np.zeros(mass.size, dtype=np.int64)
        weight = np.ones(mass.size)
        weight[self.first_node : self.first_node + self.mesh.node_count] = self.fibre_bound[1]
        if isinstance(self.data, MembraneData):
            membrane_frequency_bounds(self.data, positions, mass, weight, membrane, omega2)
        else:
            nodal_frequency_bounds(
                self.data, positions, mass, weight, membrane, bending, omega2, part
            )
        node = int(np.argmax(omega2))
        own = self.mesh.elements + self.first_node
        element = int(np.flatnonzero((own == node).any(axis=1))[0])
        return float(omega2[node]), element, int(part[node])

    def reference_frequencies(self) -> ReferenceFrequencies:
        in_plane = self.material.wave_stiffness()[0] / self.material.density
        # most nodes are whole ones, whatever weights the power iteration has given to them
        shortest = np.abs(self.geometry.gradient).sum(axis=1).max(axis=1)
        factor = 1.0 if self.mass_factor is None else self.mass_factor
        return ReferenceFrequencies(
            in_plane=float(in_plane * (self.fibre_bound[0] / factor).max()),
            at_nodes=float(in_plane * np.median(shortest) ** 2 / np.median(factor)),
            over_thickness=0.0,
        )

    def cause(self, code: int) -> str:
        return self.CAUSES[code]

    def condition(self, positions: np.ndarray, history: np.ndarray) -> Condition:
        area_stretch = self._evaluate(positions)[1]
        return Condition(np.ones_like(area_stretch), area_stretch)

    def fibre_volume_fraction(self, condition: Condition) -> np.ndarray | None:
        """That of a sheet which keeps its thickness."""
        if self.material.fibre_density is None:
            return None
        initial = initial_fibre_volume_fraction(self.material, self.material.thickness)
        return initial / condition.volume_ratio

    def may_stiffen(self, condition: Condition, omega2: float) -> bool:
        """Fibres and bending have constant stiffnesses; the shear is softer unless it locks."""
        return shear_may_stiffen(self, condition, omega2)

    def unsound(
        self,
        positions: np.ndarray,
        condition: Condition,
        tools_near: Callable[[np.ndarray], list[str]],
    ) -> Unsound | None:
        """A triangle that has lost its area, or too much of it for the fibres."""
        area = condition.area_stretch
        worst = int(np.argmin(area))
        if area[worst] > COLLAPSED_AREA:
            return overfilled(self, positions, condition, lambda e: CAUSE_OF_SHEAR, "triangle")
        return Unsound(
            worst,
            f"triangle {worst} is collapsed (area {area[worst]:.3f} of the initial one)",
            "the sheet is sheared beyond 87 degrees, or the mesh cannot resolve the tool; use a "
            "smaller blank.edge_length or a larger radius",
        )

    def no_history(self) -> np.ndarray:
        return np.empty(0)

    def element_history(self, history: np.ndarray) -> np.ndarray:
        """Return no values: (0, element_count)."""
        return np.empty((0, self.mesh.element_count))

    def _at_nodes(self, area: np.ndarray) -> np.ndarray:
        """Return the parts (mesh.node_count,) of the triangles' areas by initial angle."""
        corners = self.mesh.elements
        parts = angle_shares(self.mesh.node_positions[corners]) * area[:, None]
        return np.bincount(corners.ravel(), weights=parts.ravel(), minlength=self.mesh.node_count)

    def _evaluate(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return strains (E, 6), area ratios (E,) and energies of bending (E,) [J]."""
        padded = LANES * -(-self.mesh.element_count // LANES)
        strain, area_ratio, bending = np.empty((padded, 6)), np.empty(padded), np.empty(padded)
        if isinstance(self.data, MembraneData):
            bending[:] = 0.0
            membrane_state_loop(
                positions, self.data.corner_node, self.data.element_data, strain, area_ratio
            )
        else:
            membrane_shell_state(self.data, positions, strain, area_ratio, bending)
        real = slice(self.mesh.element_count)
        return strain[real], area_ratio[real], bending[real]
