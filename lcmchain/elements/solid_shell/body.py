"""A sheet of solid-shells: building it, and what the solver asks about it between steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self, cast

import numpy as np

from lcmchain.elements.blocks import LANES, find_runs, from_blocks, in_blocks
from lcmchain.elements.family import (
    Condition,
    NormalPressure,
    ReferenceFrequencies,
    Unsound,
    shear_may_stiffen,
)
from lcmchain.elements.fibre_volume import initial_fibre_volume_fraction, overfilled
from lcmchain.elements.solid_shell.curvature import renew_curvature
from lcmchain.elements.solid_shell.cut_frequency import CutElements
from lcmchain.elements.solid_shell.effects import solid_shell_effects
from lcmchain.elements.solid_shell.energies import centre_stretches, strain_energies
from lcmchain.elements.solid_shell.frequency import IN_PLANE_MODES, frequency_bounds
from lcmchain.elements.solid_shell.geometry import (
    Kind,
    ReferenceGeometry,
    curved_rows,
    flat_rows,
    in_kind_blocks,
    kind_of,
    quick_blocks,
    quick_kind_of,
    reference_geometry,
    strain_transformation,
)
from lcmchain.elements.solid_shell.kernel import CURVATURE_ROWS, GENERAL, Options, SolidShellData
from lcmchain.elements.solid_shell.pressure import normal_pressure
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import InputError
from lcmchain.materials.law import (
    Material,
    MaterialWithMemory,
    bending_losses_of,
    bends_at_reference_thickness,
    couples_shear,
    history_count,
    knows_step,
    takes_fibre_share,
    viscosity_of,
)
from lcmchain.mesh.blank import BlankMesh

if TYPE_CHECKING:  # no run needs the reference in NumPy
    from lcmchain.elements.solid_shell.reference import ElementOptions

CORNERS = 8
# Width of the strips of fibre that bend within an element, over the thickness of the fabric.
STRIP_WIDTH = 1.0
# The in-plane frequency changes slowly: its bound is renewed every so many chunks of steps, unless
# the thickness wave comes near it.
THICKNESS_SHARE = 0.3
# Change of the thickness up to which its wave, of a law that has not stiffened, is as fast as in
# the reference: the step's safety allows for more.
UNCHANGED_STRETCH = 0.05
# Below this fraction of its initial thickness an element counts as collapsed; one with fibres does
# so where it would hold more fibre than space.
COLLAPSED_STRETCH = 0.05


# A body is found by identity: arrays have no single truth of being equal.
@dataclass(frozen=True, eq=False)
class SolidShellBody:
    """Solid-shells of one material; see :class:`lcmchain.elements.family.Body`.

    mass_factor : (element_count,) inertia of the elements over their mass, None for their mass.
    """

    name: str
    mesh: BlankMesh
    material: Material
    geometry: ReferenceGeometry
    data: SolidShellData
    first_node: int
    first_element: int
    cut: CutElements | None = None
    mass_factor: np.ndarray | None = None

    type = "solid-shell"
    contact_offset = 0.0  # the nodes lie on the faces

    @staticmethod
    def mesh_of(blank: BlankMesh) -> BlankMesh:
        return blank

    @classmethod
    def build(
        cls,
        name: str,
        mesh: BlankMesh,
        material: Material,
        choices: Element | ElementOptions,
        first_node: int,
        first_element: int,
    ) -> Self:
        """Build the body; ``choices`` is the scene's element table or the like.

        Raises
        ------
        InputError : elements without volume, or an option that the material does not know.
        """
        _require_known(material, choices)
        geometry = reference_geometry(mesh.node_positions[mesh.elements], mesh.fibre_direction_1)
        kind = kind_of(geometry)
        padded = LANES * -(-len(mesh.elements) // LANES)
        share = choices.fibre_hourglass
        if share is None:
            share = strip_share(material, geometry)
        T = strain_transformation(geometry.K, geometry.K)
        if kind == "flat":
            change = np.zeros((1, 3, 6, 6))
        else:
            change = np.stack(
                [strain_transformation(geometry.K, 2.0 * geometry.dK[:, d]) for d in range(3)],
                axis=1,
            )
            change = _padded(change, padded)
        rows = flat_rows(geometry) if kind == "flat" else curved_rows(geometry)
        quick_data, quick_options = quick_blocks(geometry), None
        if quick_data is not None:
            quick_kind = quick_kind_of(geometry)
            assert quick_kind is not None
            quick_options = kernel_options(material, choices, kind=quick_kind, fibre_share=share)
        left = quick_data is None or bool((quick_data.start == GENERAL).any())
        corner_node = in_blocks(mesh.elements + first_node).astype(np.int32)
        data = SolidShellData(
            law=material.law,
            options=kernel_options(material, choices, kind=kind, fibre_share=share),
            corner_node=corner_node,
            corner_run=find_runs(corner_node.reshape(-1, LANES)).ravel(),
            element_data=in_kind_blocks(rows, kind),
            quick_data=quick_data,
            quick_options=quick_options,
            general=True if left else None,
            transformation=_padded(T, padded),
            transformation_change=change,
            density=float(material.density),
            neighbour=_padded(mesh.neighbours.T, padded).T.copy(),
            # lets E33 vanish in the reference
            reference_curvature=_padded(
                mesh.initial_bend_part / (2.0 * geometry.height**2), padded
            ),
        )
        body = cls(name, mesh, material, geometry, data, first_node, first_element)
        if mesh.is_triangle.any() and takes_fibre_share(material):
            cut = CutElements.of_body(mesh.elements, geometry, data, rows, body.history_count)
            body = replace(body, cut=cut)
        return body

    @property
    def kernel(self) -> str:
        if self.data.options.curved is None:
            return self.type
        return f"{'curved' if self.data.quick_data is None else 'partly curved'} {self.type}"

    @property
    def force_nodes(self) -> np.ndarray:
        return self.mesh.elements

    @cached_property
    def node_mass(self) -> np.ndarray:
        """Lumped masses of the nodes [kg], an eighth of each element's."""
        return self.material.density * self._at_nodes(self.geometry.volume / 8.0)

    @cached_property
    def inertial_mass(self) -> np.ndarray:
        if self.mass_factor is None:
            return self.node_mass
        share = self.mass_factor * self.geometry.volume / 8.0
        return self.material.density * self._at_nodes(share)

    @cached_property
    def least_mass_factor(self) -> float:
        return 1.0 if self.mass_factor is None else float(self.mass_factor.min())

    @cached_property
    def part_omega2(self) -> np.ndarray:
        """Of the elements; those near the cut share mass, and have the bound of their group."""
        in_plane, normal = np.array(self.material.wave_stiffness()) / self.material.density
        fibre = self._fibre_bounds_of_elements.copy()
        if self.cut is not None:
            fibre[self.cut.elements] = self.cut.fibre_bound
        return np.maximum(in_plane * fibre, normal / self.geometry.height**2)

    def with_mass_factor(self, factor: np.ndarray) -> Self:
        cut = None if self.cut is None else self.cut.with_mass_factor(factor)
        return replace(self, cut=cut, mass_factor=factor)

    @cached_property
    def node_area(self) -> np.ndarray:
        """Reference area of the nodes on their face [m²], a quarter of each element's."""
        return self._at_nodes(self.geometry.volume / (2.0 * self.geometry.height) / 4.0)

    @property
    def history_count(self) -> int:
        shared = CURVATURE_ROWS if self.data.options.director is None else 0
        return shared + history_count(self.material.law)

    @cached_property
    def shortest_length(self) -> float:
        if self.cut is not None:  # cut elements share mass with their neighbours
            whole, cut = self._fibre_bounds
            return 2.0 / math.sqrt(max(whole, cut))
        return float(2.0 * np.linalg.norm(self.geometry.modes[:, :2], axis=2).min())

    @property
    def volume(self) -> float:
        return float(self.node_mass.sum()) / self.material.density

    @property
    def hourglass_tells(self) -> bool:
        # directors that tilt fill the hourglass terms too; `unsound` names them
        return self.data.options.director is None

    @property
    def without_potential(self) -> tuple[str, ...]:
        options = self.data.options
        found = ["element.cross_terms = true"] if options.cross != 0.0 else []
        if options.conservative is None and not self.material.constant_tangent:
            found.append('element.hourglass = "published"')
        return tuple(found)

    def effects(self) -> dict[str, tuple[bool, str]]:
        return solid_shell_effects(self.material, self.data)

    def _strain_energies(
        self, positions: np.ndarray, history: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return centre strain, bending and hourglass energy of all elements, padding included."""
        count = self._padded_count
        strain, bending, hourglass = np.empty((count, 6)), np.empty(count), np.empty(count)
        strain_energies(self.data, positions, history, strain, bending, hourglass)
        return strain, bending, hourglass

    def hourglass_energies(self, positions: np.ndarray, history: np.ndarray) -> np.ndarray:
        return self._strain_energies(positions, history)[2][: self.mesh.element_count]

    def stored_energy(self, positions: np.ndarray, history: np.ndarray) -> tuple[float, float]:
        real = slice(self.mesh.element_count)
        strain, bending, hourglass = self._strain_energies(positions, history)
        past = self.element_history(history)
        membrane = self.material.membrane_energy(strain[real], past) * self.geometry.volume
        return membrane.sum() + bending[real].sum(), hourglass[real].sum()

    def renew(
        self, positions: np.ndarray, history: np.ndarray, counted_at: np.ndarray | None = None
    ) -> float:
        if self.data.options.director is not None:
            return 0.0
        given = renew_curvature(self.data, positions, history, counted_at)
        return float(given[: self.mesh.element_count].sum())

    def normal_pressure(self, positions: np.ndarray, history: np.ndarray) -> NormalPressure:
        return normal_pressure(self.data, self.mesh, self.first_node, positions, history)

    def present_node_area(self, positions: np.ndarray) -> np.ndarray:
        return self._at_nodes(self.mesh.areas(self._own(positions)) / 4.0)

    def dissipated_energy(self, history: np.ndarray) -> float:
        if not history_count(self.material.law):
            return 0.0
        material = cast(MaterialWithMemory, self.material)
        density = material.dissipated_energy(self.element_history(history))
        return float((density * self.geometry.volume).sum())

    def viscous_energy(self, history: np.ndarray) -> float:
        found = getattr(self.material, "viscous_energy", None)
        if found is None or not history_count(self.material.law):
            return 0.0
        return float((found(self.element_history(history)) * self.geometry.volume).sum())

    def highest_frequency(
        self, positions: np.ndarray, history: np.ndarray, mass: np.ndarray
    ) -> tuple[float, int, int]:
        """The code is the mode vector whose row sum the bound is."""
        omega2 = np.empty(self._padded_count)
        mode = np.empty(self._padded_count, dtype=np.int64)
        frequency_bounds(self.data, positions, history, omega2, mode, damping=self._no_damping())
        omega2 = omega2[: self.mesh.element_count]
        if self.mass_factor is not None:
            omega2 /= self.mass_factor
        if self.cut is not None:
            # two bounds of the elements near the cut, of which the lower one counts
            bound, element = self.cut.highest_frequency(positions, history, len(omega2))
            near = self.cut.elements
            if bound < omega2[near].max():
                omega2[near] = np.where(near == element, bound, 0.0)
        element = int(np.argmax(omega2))
        return float(omega2[element]), element, int(mode[element])

    def damping_rate(self, positions: np.ndarray, history: np.ndarray) -> float:
        if (damping := self._no_damping()) is None:
            return 0.0
        omega2, mode = np.empty(self._padded_count), np.empty(self._padded_count, dtype=np.int64)
        frequency_bounds(self.data, positions, history, omega2, mode, damping=damping)
        factor = 1.0 if self.mass_factor is None else self.mass_factor
        return float((damping[: self.mesh.element_count] / factor).max())

    def _no_damping(self) -> np.ndarray | None:
        """Return room for the damping rates of the elements, None for a law that knows no rate."""
        return np.zeros(self._padded_count) if knows_step(self.material.law) else None

    def reference_frequencies(self) -> ReferenceFrequencies:
        in_plane, normal = np.array(self.material.wave_stiffness()) / self.material.density
        factor = 1.0 if self.mass_factor is None else self.mass_factor
        # the squares of the gradients of 2 E12, and of E11 and E22 linear in ζ, in the reference
        rows = self.geometry.K[:, :2, :2] ** 2
        damping = viscosity_of(self.material, np.zeros(6))[3] * rows.sum(axis=(1, 2))
        losses = bending_losses_of(self.material)
        if losses is not None:
            damping += self.data.options.zeta2 * rows.sum(axis=1) @ losses.viscosities()
        whole, cut, usual = self._fibre_bounds_of_elements / factor, 0.0, 0.0
        if self.cut is not None:
            whole[self.cut.elements] = 0.0
            least = self.cut.least_mass_factor
            cut, usual = self.cut.fibre_bound / least, self.cut.usual_bound / least
        return ReferenceFrequencies(
            in_plane=float(in_plane * max(whole.max(), cut)),
            at_nodes=float(in_plane * usual),
            over_thickness=float((normal / (factor * self.geometry.height**2)).max()),
            damping_rate=float((damping / (factor * self.material.density)).max()),
        )

    @cached_property
    def _fibre_bounds(self) -> tuple[float, float]:
        """Bounds of ω²/c² of whole elements and of those near the cut in the reference [1/m²]."""
        whole = self._fibre_bounds_of_elements.copy()
        if self.cut is None:
            return float(whole.max()), 0.0
        whole[self.cut.elements] = 0.0
        return float(whole.max()), self.cut.fibre_bound

    @cached_property
    def _fibre_bounds_of_elements(self) -> np.ndarray:
        """Bounds (element_count,) of ω²/c² of the elements in the reference [1/m²]."""
        return (self.geometry.K[:, :2, :2] ** 2).sum(axis=1).max(axis=1)

    def cause(self, code: int) -> str:
        return "in-plane stiffness" if code in IN_PLANE_MODES else "compaction (thickness)"

    def condition(self, positions: np.ndarray, history: np.ndarray) -> Condition:
        stretches = np.empty((2, self._padded_count))
        centre_stretches(
            np.ascontiguousarray(positions),
            self.data.corner_node,
            self.data.corner_run,
            self._padded_height,
            self._padded_area,
            history,
            self.data.options,
            *stretches,
        )
        return Condition(*stretches[:, : self.mesh.element_count])

    def fibre_volume_fraction(self, condition: Condition) -> np.ndarray | None:
        if self._initial_fraction is None:
            return None
        return self._initial_fraction / condition.volume_ratio

    def may_stiffen(self, condition: Condition, omega2: float) -> bool:
        """The thickness wave, or the shear wave of a law that locks, may come to govern."""
        thinnest = int(np.argmin(condition.thickness_stretch))
        strain = np.zeros(6)
        strain[2] = 0.5 * (condition.thickness_stretch[thinnest] ** 2 - 1.0)
        tangent = self.material.stress_and_tangent(strain)[1][2, 2]
        height = self.geometry.height[thinnest]
        density = self.material.density * self.least_mass_factor
        near = tangent / (density * height**2) > THICKNESS_SHARE * omega2
        if near and not self._as_stiff_as_at_rest(tangent, condition.thickness_stretch):
            return True
        return shear_may_stiffen(self, condition, omega2)

    def _as_stiff_as_at_rest(self, tangent: float, stretch: np.ndarray) -> bool:
        """Whether the thickness wave is still that of the reference, which was looked at first."""
        unchanged = bool(np.abs(stretch - 1.0).max() < UNCHANGED_STRETCH)
        return tangent <= self._tangent_at_rest and unchanged

    @cached_property
    def _tangent_at_rest(self) -> float:
        """Stiffness against compaction of the reference [Pa]."""
        return float(self.material.stress_and_tangent(np.zeros(6))[1][2, 2])

    def unsound(
        self,
        positions: np.ndarray,
        condition: Condition,
        tools_near: Callable[[np.ndarray], list[str]],
    ) -> Unsound | None:
        """An element that is inverted, collapsed, or holds more fibre than it has space for."""
        worst = int(np.argmin(condition.thickness_stretch))
        stretch = condition.thickness_stretch[worst]
        if stretch > COLLAPSED_STRETCH:
            return overfilled(
                self, positions, condition, lambda e: self._cause_of_collapse(e, tools_near)
            )
        what = "inverted" if stretch <= 0.0 else "collapsed"
        text = f"element {worst} is {what} (thickness {stretch:.3f} of the initial one)"
        return Unsound(worst, text, self._cause_of_collapse(worst, tools_near))

    def no_history(self) -> np.ndarray:
        history = np.zeros(self._padded_count * self.history_count)
        initial = getattr(self.material, "initial_history", None)
        if initial is not None and history_count(self.material.law):
            centres = self.mesh.node_positions[self.mesh.elements].mean(axis=1)
            rows = history.reshape(-1, self.history_count, LANES)
            own = initial(centres)
            element = np.arange(self.mesh.element_count)
            first = self.history_count - len(own)
            for k, values in enumerate(own):
                rows[element // LANES, first + k, element % LANES] = values
        return history

    def element_history(self, history: np.ndarray) -> np.ndarray:
        """Return what the law remembers by element (history_count, element_count)."""
        remembered = history_count(self.material.law)
        rows = from_blocks(history, self.history_count, self.mesh.element_count).T
        return rows[self.history_count - remembered :]

    def _cause_of_collapse(self, worst: int, tools_near) -> str:
        if self.data.options.director is not None:
            return (
                'compaction_strain = "director" measures the length of the director: under a '
                "pressure above the transverse shear stiffness the director tilts instead of "
                "shortening and the element folds over; use element.compaction_strain = "
                '"normal"'
            )
        tools = tools_near(self.mesh.elements[worst])
        if len(tools) > 1:
            return f"it is squeezed between tools ({', '.join(tools)}); check their gap and stroke"
        return (
            "the sheet folds on itself or the mesh cannot resolve the tool; use a smaller "
            "blank.edge_length or a larger radius"
        )

    @property
    def _padded_count(self) -> int:
        return self.data.corner_node.size // CORNERS

    @cached_property
    def _padded_height(self) -> np.ndarray:
        return _padded(self.geometry.height, self._padded_count)

    @cached_property
    def _padded_area(self) -> np.ndarray:
        return _padded(self.geometry.volume / (8.0 * self.geometry.height), self._padded_count)

    @cached_property
    def _initial_fraction(self) -> np.ndarray | None:
        if self.material.fibre_density is None:
            return None
        return initial_fibre_volume_fraction(self.material, 2.0 * self.geometry.height)

    def _own(self, positions: np.ndarray) -> np.ndarray:
        """Return the body's part (mesh.node_count, 3) of positions (3, node_count)."""
        nodes = slice(self.first_node, self.first_node + self.mesh.node_count)
        return np.ascontiguousarray(positions[:, nodes].T)

    def _at_nodes(self, share: np.ndarray) -> np.ndarray:
        """Return the sum of what the elements give to each of their corners, (node_count,)."""
        corners, weights = self.mesh.elements.ravel(), np.repeat(share, CORNERS)
        return np.bincount(corners, weights=weights, minlength=self.mesh.node_count)


def strip_share(material: Material, geometry: ReferenceGeometry) -> float:
    """Return the part of the fibre stiffness with which elements bend their fibres in the plane.

    Where strips of the width b slide over each other a sheet has the bending stiffness C11 b²/12
    per area within its plane, whatever the mesh; an element of the width L with C^M in the
    hourglass terms has C11 L²/12. The strips are taken as wide as the fabric is thick (manual:
    departures).
    """
    if not takes_fibre_share(material):
        return 1.0
    area = np.mean(geometry.volume / (2.0 * geometry.height))
    width = STRIP_WIDTH * material.thickness
    return min(1.0, float(width**2 / area))


def _require_known(material: Material, choices: Element | ElementOptions) -> None:
    """Refuse options of the element that a material does not know."""
    if choices.fibre_hourglass not in (None, 1.0) and not takes_fibre_share(material):
        raise InputError(
            f"is {choices.fibre_hourglass:g}, but only a law with fibres has a share of them; "
            "leave it out",
            key="element.fibre_hourglass",
        )
    if choices.hourglass == "published" and couples_shear(material):
        raise InputError(
            'is "published", which is derived for a thickness that does not know the shear; '
            'use "conservative", or leave out shear_coupling and table of material.compaction',
            key="element.hourglass",
        )
    if choices.hourglass == "published" and knows_step(material.law):
        raise InputError(
            'is "published", which takes the tangent of a law that knows no rate; use '
            '"conservative", or leave out what resists the rate (material.viscous, '
            "material.bending.viscous_1 and viscous_2)",
            key="element.hourglass",
        )
    own_terms = hasattr(material, "stabilising_terms")
    changes = not (material.is_diagonal or material.constant_tangent)
    if choices.hourglass == "published" and (own_terms or changes):
        raise InputError(
            'is "published", which is derived for a diagonal stiffness; use "conservative"',
            key="element.hourglass",
        )


def bends_at_reference(material: Material, choices: Element | ElementOptions) -> bool:
    """Tell whether strains of the bending are those of the initial thickness.

    Measured moments are always those of the sheet with the thickness that it had.
    """
    return choices.bending_thickness == "reference" or bends_at_reference_thickness(material)


def kernel_options(
    material: Material, choices: Element | ElementOptions, *, kind: Kind, fibre_share: float = 1.0
) -> Options:
    """Choose the effects of the element: what material and reference geometry call for."""
    # E33^ζ vanishes by ANS in a flat element: only coupling to other strains calls for it
    enhanced = getattr(choices, "enhanced_strain", None)
    if enhanced is None:
        enhanced = material.couples_thickness or kind == "curved"
    conservative = choices.hourglass == "conservative" and not material.constant_tangent
    return Options(
        aligned=True if kind == "aligned" else None,
        flat=True if kind == "flat" else None,
        curved=True if kind == "curved" else None,
        director=True if choices.compaction_strain == "director" else None,
        # a constant tangent needs no correction of the hourglass energy
        conservative=True if conservative else None,
        enhanced=True if enhanced else None,
        reference_bending=True if bends_at_reference(material, choices) else None,
        coupled=True if choices.cross_terms else None,
        zeta2=1.0 / 3.0,
        zeta4=1.0 / 9.0 if choices.integration_points == 2 else 1.0 / 5.0,
        cross=1.0 / 3.0 if choices.cross_terms else 0.0,
        in_plane_shear=1.0 if choices.in_plane_shear_hourglass else 0.0,
        fibre_share=fibre_share,
    )


def _padded(array: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([array, np.repeat(array[-1:], count - len(array), axis=0)])
