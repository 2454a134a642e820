"""What the rest of the program asks a body: a sheet of one material and one family of elements.

A model is made of bodies. They share flat arrays: a body owns a range of nodes, of elements, of
corner forces and of history values, and its kernels read global node numbers. Each family (folder
``solid_shell``, ``membrane_shell``) offers one class with the methods of :class:`Body` and one
NamedTuple of constants for its kernels, which register their forces with :func:`internal_forces`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from lcmchain.dispatch import required
from lcmchain.materials.law import Material
from lcmchain.mesh.blank import BlankMesh


@required
def internal_forces(data, positions, corner_force, history):
    """Write the internal forces of all elements of a body, and move its history on (compiled).

    Parameters
    ----------
    data : constants of the body, a NamedTuple.
    positions : (3, node_count) of the whole model [m], C-contiguous.
    corner_force : of this body, blocks of 16 elements with 3 rows per corner [N], written.
    history : of this body, blocks of 16 elements with a row per value, or empty.
    """


class Condition(NamedTuple):
    """How much thinner and smaller elements have become, at their centres.

    thickness_stretch, area_stretch : present over initial value (element_count,) of the thickness
    along the normal and of the mid-surface; an element turned inside out has no positive thickness.
    Elements without a thickness keep 1.
    """

    thickness_stretch: np.ndarray
    area_stretch: np.ndarray

    @property
    def volume_ratio(self) -> np.ndarray:
        """Determinant of the deformation gradient (element_count,)."""
        return self.thickness_stretch * self.area_stretch


class Unsound(NamedTuple):
    """An element that cannot go on: which, in words, and the likely cause."""

    element: int
    text: str
    cause: str


class NormalPressure(NamedTuple):
    """Pressure through the thickness at the element centres, positive in compression [Pa].

    contact : what presses on the faces, the mean of both, (element_count,).
    total : minus the Cauchy stress normal to the sheet, (element_count,); the rest comes from
        within the element, above all from its bending.
    """

    contact: np.ndarray
    total: np.ndarray


class ReferenceFrequencies(NamedTuple):
    """ω² of the undeformed sheet [1/s²].

    in_plane : of the fibre wave across the elements, the largest.
    at_nodes : of that at usual nodes of elements whose bound adds up both families of fibres at the
        nodes, 0 without such elements; it grows by 1 + sin γ where the sheet shears by γ.
    over_thickness : of the wave over the thickness; 0 without one.
    damping_rate : of what resists the rate of the shear, c/m [1/s], which lags half a step.
    """

    in_plane: float
    at_nodes: float
    over_thickness: float
    damping_rate: float = 0.0


class Body(Protocol):
    """A sheet of one material and one family of elements.

    name : of the sheet. type : of the elements, as in ``element.type``.
    mesh : undeformed. material : see :class:`lcmchain.materials.law.Material`.
    data : constants for the kernels.
    geometry : reference geometry, of the family's own kind.
    force_nodes : (element_count, corner_count) nodes of the mesh that get corner forces; -1: none.
    node_mass : (mesh.node_count,) [kg], of the fabric.
    node_area : (mesh.node_count,) [m²] per face node.
    inertial_mass : (mesh.node_count,) [kg], ``node_mass`` with what is added for the time step.
    least_mass_factor : inertia over mass where least was added, 1 without added mass.
    part_omega2 : bounds of ω² [1/s²] of the undeformed parts that mass can be added to, elements
        or nodes, with the mass of the fabric; without compiled code, up to the small moduli.
    contact_offset : distance of the sheet's surface from its nodes [m].
    shortest_length : of the elements, what sets the in-plane wave's step [m].
    first_node, first_element : where its ranges begin.
    volume : of the undeformed sheet [m³].
    history_count : numbers per element that its kernels keep.
    hourglass_tells : whether large hourglass energy means that the mesh is too coarse.
    without_potential : scene entries, as they are set, whose forces have no potential.
    """

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> str: ...

    @property
    def mesh(self) -> Any: ...

    @property
    def material(self) -> Material: ...

    @property
    def data(self) -> Any: ...

    @property
    def geometry(self) -> Any: ...

    @property
    def force_nodes(self) -> np.ndarray: ...

    @property
    def node_mass(self) -> np.ndarray: ...

    @property
    def node_area(self) -> np.ndarray: ...

    @property
    def inertial_mass(self) -> np.ndarray: ...

    @property
    def least_mass_factor(self) -> float: ...

    @property
    def part_omega2(self) -> np.ndarray: ...

    @property
    def contact_offset(self) -> float: ...

    @property
    def shortest_length(self) -> float: ...

    @property
    def first_node(self) -> int: ...

    @property
    def first_element(self) -> int: ...

    @property
    def volume(self) -> float: ...

    @property
    def hourglass_tells(self) -> bool: ...

    @property
    def without_potential(self) -> tuple[str, ...]: ...

    @property
    def history_count(self) -> int: ...

    @property
    def kernel(self) -> str:
        """Kind of compiled element, which decides its computing time."""

    @staticmethod
    def mesh_of(blank: BlankMesh) -> Any:
        """Return the mesh that this family makes of a blank."""

    @classmethod
    def build(
        cls,
        name: str,
        mesh: Any,
        material: Material,
        choices: Any,
        first_node: int,
        first_element: int,
    ) -> Self:
        """Build the body of a mesh; ``choices`` is the scene's element table."""

    def with_mass_factor(self, factor: np.ndarray) -> Self:
        """Return the body with the inertia of its parts over their mass, as ``part_omega2``."""

    def stored_energy(self, positions: np.ndarray, history: np.ndarray) -> tuple[float, float]:
        """Return strain energy and hourglass energy [J] at positions (3, node_count)."""

    def hourglass_energies(self, positions: np.ndarray, history: np.ndarray) -> np.ndarray:
        """Return the hourglass energy of every element (element_count,) [J], as above."""

    def renew(
        self, positions: np.ndarray, history: np.ndarray, counted_at: np.ndarray | None = None
    ) -> float:
        """Renew in ``history`` what elements take from neighbours; return the energy put in [J].

        counted_at : positions at which the energy is taken, ``positions`` by default.
        """

    def normal_pressure(self, positions: np.ndarray, history: np.ndarray) -> NormalPressure | None:
        """Return the pressure through the thickness at positions (3, node_count); None without.

        The history is that of the end of the step before; it is left as it is.
        """

    def present_node_area(self, positions: np.ndarray) -> np.ndarray:
        """Return ``node_area`` at positions (3, node_count), on the present mid-surface [m²]."""

    def dissipated_energy(self, history: np.ndarray) -> float:
        """Return what the law has dissipated so far [J]; 0 without memory."""

    def viscous_energy(self, history: np.ndarray) -> float:
        """Return what the rate of the strain has dissipated so far [J]; 0 for a law without."""

    def no_history(self) -> np.ndarray:
        """Return the history values of the body, in blocks, before anything has happened."""

    def element_history(self, history: np.ndarray) -> np.ndarray:
        """Return what the law remembers by element (numbers, element_count)."""

    def effects(self) -> dict[str, tuple[bool, str]]:
        """Return whether each effect of the elements is compiled in, and why, by its name."""

    def highest_frequency(
        self, positions: np.ndarray, history: np.ndarray, mass: np.ndarray
    ) -> tuple[float, int, int]:
        """Return the largest ω² bound [1/s²], its element, and a code of what governs it.

        mass : (node_count,) of the whole model [kg].
        """

    def damping_rate(self, positions: np.ndarray, history: np.ndarray) -> float:
        """Return the largest rate c/m [1/s] of what resists a rate; 0 for a law without."""

    def reference_frequencies(self) -> ReferenceFrequencies:
        """Return ω² of the undeformed sheet by what governs it, without compiled code.

        It is what :meth:`highest_frequency` finds, up to the small moduli.
        """

    def cause(self, code: int) -> str:
        """Say in words what governs the step."""

    def condition(self, positions: np.ndarray, history: np.ndarray) -> Condition:
        """Return what tells whether the elements are sound."""

    def fibre_volume_fraction(self, condition: Condition) -> np.ndarray | None:
        """Return that of the elements (element_count,); None where the material has no fibres."""

    def may_stiffen(self, condition: Condition, omega2: float) -> bool:
        """Tell whether the bound may grow well above ``omega2`` [1/s²] within a few chunks."""

    def unsound(
        self,
        positions: np.ndarray,
        condition: Condition,
        tools_near: Callable[[np.ndarray], list[str]],
    ) -> Unsound | None:
        """Return the worst element if it cannot go on; ``tools_near`` names tools near nodes."""


# Part of the governing ω² from which on the shear wave is followed in every chunk of steps: within
# a chunk the tangent of a law that locks may grow several times.
SHEAR_SHARE = 0.1


def shear_may_stiffen(body: Body, condition: Condition, omega2: float) -> bool:
    """Tell whether the shear wave of a law that locks has come near ``omega2`` [1/s²].

    The area of a sheet with inextensible fibres shrinks by cos γ; its shear strain is sin γ.
    """
    if not body.material.locks:
        return False
    strain = np.zeros((2, 6))  # to both sides
    strain[:, 3] = np.sqrt(max(1.0 - float(condition.area_stretch.min()) ** 2, 0.0))
    strain[1] *= -1.0
    tangent = body.material.stress_and_tangent(strain)[1][:, 3, 3].max()
    # a shear wave bends both pairs of sides: twice the 4 c²/l² of a wave along one
    density = body.material.density * body.least_mass_factor
    present = 8.0 * tangent / (density * body.shortest_length**2)
    return bool(present > SHEAR_SHARE * omega2)
