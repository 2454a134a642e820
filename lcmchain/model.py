"""Everything about a scene that stays constant during a run, as arrays and effect slots.

Slots are the arguments of the kernels that are ``None`` where the scene does not need the effect;
compiling prunes their code (see ``elements/solid_shell/kernel.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lcmchain.blank import BlankMesh, build_blank
from lcmchain.effects.supports import Support, SupportTable, build_supports
from lcmchain.elements.membrane_shell.kernel import (
    MembraneShellSlots,
    patch_nodes_in_blocks,
    patch_rows,
)
from lcmchain.elements.membrane_shell.patch import TriangleGeometry, angle_shares, triangle_geometry
from lcmchain.elements.solid_shell.equations import Moments
from lcmchain.elements.solid_shell.geometry import (
    ReferenceGeometry,
    reference_geometry,
    strain_transformation,
)
from lcmchain.elements.solid_shell.kernel import LANES
from lcmchain.elements.solid_shell.packing import curved_rows, flat_rows, in_blocks
from lcmchain.materials.fabric import Fabric
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff
from lcmchain.scene.schema import Contact, Element, MembraneShellElement, Process
from lcmchain.tools.motion import STANDARD_GRAVITY
from lcmchain.tools.table import ToolTable, build_tool_table
from lcmchain.triangulation import TriangleMesh, triangulate

# Contact stiffness over nodal mass, relative to the square of the highest element frequency at the
# start: 0.1 costs 5 % of the time step and leaves penetrations of some micrometres.
AUTOMATIC_PENALTY = 0.1


class ElementSlots(NamedTuple):
    """Arguments of the solid-shell's kernels after the node positions and the connectivity."""

    fabric: Any
    stiffness: Any
    flat: Any
    curved: Any
    director: Any
    conservative: Any
    enhanced: Any
    moments: Moments
    in_plane_shear: float


class NodeSlots(NamedTuple):
    """Constants of the node kernel; every float is in SI.

    force_slot : (valence, node_count) where to find a node's corner forces.
    mass : (node_count,) [kg]; area : (node_count,) reference area per face node [m²].
    free : (3, node_count) 1 where a displacement component is free, 0 where it is held.
    """

    force_slot: np.ndarray
    mass: np.ndarray
    area: np.ndarray
    free: np.ndarray


class Environment(NamedTuple):
    """Scalars of contact, damping and gravity."""

    penalty: float  # [Pa/m]
    tangential_ratio: float
    contact_damping_ratio: float
    mass_damping: float  # [1/s]
    gravity: float  # acceleration along -z [m/s²]
    contact_offset: float  # distance of the sheet's surface from its nodes [m]


@dataclass(frozen=True)
class Model:
    """Constants of one forming simulation (see the classes above for the arrays).

    The sheet is made of solid-shells (``elements``, with their transformations) or of triangles
    with membrane and shell part (``membrane_shell``); what belongs to the other kind is ``None``.
    """

    blank: BlankMesh | TriangleMesh
    material: Fabric | StVenantKirchhoff
    geometry: ReferenceGeometry | TriangleGeometry
    corner_node: np.ndarray
    element_data: np.ndarray
    elements: ElementSlots | None
    membrane_shell: MembraneShellSlots | None
    transformation: np.ndarray | None
    transformation_change: np.ndarray | None
    nodes: NodeSlots
    tools: ToolTable
    tool_names: tuple[str, ...]
    supports: SupportTable | None
    support_names: tuple[str, ...]
    environment: Environment
    process_time: float
    frame_count: int
    step_safety: float

    @property
    def element_count(self) -> int:
        return len(self.blank.elements)

    @property
    def node_count(self) -> int:
        return len(self.blank.node_positions)

    @property
    def volume(self) -> float:
        """Initial volume of the sheet [m³]."""
        return float(self.nodes.mass.sum()) / self.material.density

    @property
    def corner_force_size(self) -> int:
        """Corner forces of all blocks, then zeros for nodes with fewer elements."""
        return self.corner_node.size * 3 + 2 * LANES + 1


def build_material(spec) -> Fabric | StVenantKirchhoff:
    """Return the material of a scene's ``[material]`` table."""
    return Fabric.from_scene(spec) if spec.law == "fabric" else StVenantKirchhoff.from_scene(spec)


def element_slots(material, element, geometry: ReferenceGeometry) -> ElementSlots:
    """Choose the effects of the element: what the material and the reference geometry call for."""
    flat = bool(np.all(geometry.flat))
    two_points = element.integration_points == 2
    moments = Moments(
        zeta2=1.0 / 3.0,
        zeta4=1.0 / 9.0 if two_points else 1.0 / 5.0,
        cross=1.0 / 3.0 if element.cross_terms else 0.0,
    )
    fabric = None
    if material.is_diagonal:
        fabric = material.law._replace(fibre_hourglass=float(element.fibre_hourglass))
    return ElementSlots(
        fabric=fabric,
        stiffness=None if material.is_diagonal else material.law,
        flat=True if flat else None,
        curved=None if flat else True,
        director=True if element.compaction_strain == "director" else None,
        # a constant tangent needs no correction of the hourglass energy
        conservative=True if material.is_diagonal and element.hourglass == "conservative" else None,
        # E33^ζ vanishes by ANS in a flat element: only coupling to in-plane strains calls for it
        enhanced=None if flat and material.is_diagonal else True,
        moments=moments,
        in_plane_shear=1.0 if element.in_plane_shear_hourglass else 0.0,
    )


def build_model(
    scene, supports: Callable[[BlankMesh | TriangleMesh], Sequence[Support]] = lambda mesh: ()
) -> Model:
    """Build the model of a scene.

    Parameters
    ----------
    supports : chooses nodes of the sheet's mesh whose motion is prescribed.

    Raises
    ------
    InputError : a blank, tool or material that cannot be used; names the scene key.
    """
    material = build_material(scene.material)
    mesh = build_blank(scene.blank, material.thickness)
    if isinstance(scene.element, MembraneShellElement):
        mesh = triangulate(mesh)
    tools = build_tool_table(scene.tools, scene.source.directory, scene.process.time)
    return assemble_model(
        mesh,
        material,
        scene.element,
        tools=tools,
        tool_names=tuple(tool.name for tool in scene.tools),
        contact=scene.contact,
        process=scene.process,
        supports=supports(mesh),
    )


def assemble_model(
    mesh: BlankMesh | TriangleMesh,
    material,
    element,
    *,
    tools,
    tool_names,
    contact,
    process,
    supports: Sequence[Support] = (),
) -> Model:
    """Build the model of a given mesh, tool table and supports.

    A mesh of triangles makes membrane-shells, for which ``element`` holds no choices.

    Raises
    ------
    InputError : see :func:`lcmchain.effects.supports.build_supports`.
    """
    triangles = isinstance(mesh, TriangleMesh)
    support_table, free = build_supports(supports, mesh.node_positions, float(process.time))
    if triangles:
        sheet, shortest_length = _membrane_shell_sheet(mesh, material, free)
    else:
        sheet, shortest_length = _solid_shell_sheet(mesh, material, element, free)
    penalty = contact.penalty
    if penalty is None:
        penalty = _automatic_penalty(material, shortest_length)
    return Model(
        blank=mesh,
        material=material,
        **sheet,
        tools=tools,
        tool_names=tool_names,
        supports=support_table,
        support_names=tuple(support.name for support in supports),
        environment=Environment(
            penalty=float(penalty),
            tangential_ratio=float(contact.tangential_ratio),
            contact_damping_ratio=float(contact.damping_ratio),
            mass_damping=float(process.mass_damping),
            gravity=STANDARD_GRAVITY if process.gravity else 0.0,
            contact_offset=0.5 * float(material.thickness) if triangles else 0.0,
        ),
        process_time=float(process.time),
        frame_count=int(process.frames),
        step_safety=float(process.step_safety),
    )


def assemble_sheet(blank: BlankMesh, material, element=None) -> Model:
    """Build the model of a sheet without tools, for statics and vibrations.

    ``element`` holds the choices of a scene's ``[element]`` table; the defaults are the scene's.
    """
    return assemble_model(
        blank,
        material,
        element if element is not None else Element(),
        tools=build_tool_table((), None, 1.0),
        tool_names=(),
        contact=Contact(),
        process=Process(time="1 s"),
    )


def _solid_shell_sheet(
    blank: BlankMesh, material, element, free: np.ndarray
) -> tuple[dict[str, Any], float]:
    """Return the entries of the model that belong to the sheet, and the shortest element [m]."""
    geometry = reference_geometry(blank.node_positions[blank.elements], blank.fibre_direction_1)
    slots = element_slots(material, element, geometry)
    rows = flat_rows(geometry) if slots.flat else curved_rows(geometry)
    block_count = -(-len(blank.elements) // LANES)
    T = strain_transformation(geometry.K, geometry.K)
    if slots.flat:
        change = np.zeros((1, 3, 6, 6))
    else:
        change = np.stack(
            [strain_transformation(geometry.K, 2.0 * geometry.dK[:, d]) for d in range(3)], axis=1
        )
        change = _padded(change, block_count * LANES)
    volume_share = np.repeat(geometry.volume / 8.0, 8)
    area_share = np.repeat(geometry.volume / (2.0 * geometry.height) / 4.0, 8)
    corners = blank.elements.ravel()
    entries = {
        "geometry": geometry,
        "corner_node": in_blocks(blank.elements).astype(np.int32),
        "element_data": in_blocks(rows),
        "elements": slots,
        "membrane_shell": None,
        "transformation": _padded(T, block_count * LANES),
        "transformation_change": change,
        "nodes": NodeSlots(
            force_slot=_force_slots(blank.elements, blank.node_count),
            mass=material.density
            * np.bincount(corners, weights=volume_share, minlength=blank.node_count),
            area=np.bincount(corners, weights=area_share, minlength=blank.node_count),
            free=free,
        ),
    }
    return entries, float(2.0 * np.linalg.norm(geometry.modes[:, :2], axis=2).min())


def _membrane_shell_sheet(
    mesh: TriangleMesh, material: Fabric, free: np.ndarray
) -> tuple[dict[str, Any], float]:
    """As :func:`_solid_shell_sheet` for triangles with membrane and shell part."""
    law = material.law
    geometry = triangle_geometry(mesh, (law.B11, law.B22, law.B12))
    shares = angle_shares(mesh.node_positions[mesh.elements]) * geometry.area[:, None]
    area = np.bincount(mesh.elements.ravel(), weights=shares.ravel(), minlength=mesh.node_count)
    entries = {
        "geometry": geometry,
        "corner_node": patch_nodes_in_blocks(geometry),
        "element_data": in_blocks(patch_rows(geometry)),
        "elements": None,
        "membrane_shell": MembraneShellSlots(law, float(material.thickness)),
        "transformation": None,
        "transformation_change": None,
        "nodes": NodeSlots(
            force_slot=_force_slots(geometry.nodes, mesh.node_count),
            mass=material.areal_mass * area,
            area=area,
            free=free,
        ),
    }
    return entries, float(2.0 / np.abs(geometry.gradient).sum(axis=1).max())


def _padded(array: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([array, np.repeat(array[-1:], count - len(array), axis=0)])


def _force_slots(elements: np.ndarray, node_count: int) -> np.ndarray:
    """Return where each node finds the forces of its elements, (valence, node_count) int32.

    ``elements`` (E, C) holds node numbers; -1 is a corner that is absent. The corner forces lie in
    blocks of 16 elements with 3 C rows; slots without an element point to a zero behind them.
    """
    element_count, corner_count = elements.shape
    corners = elements.ravel()
    element, corner = np.divmod(np.arange(corners.size), corner_count)
    block, lane = np.divmod(element, LANES)
    slot = (block * 3 * corner_count + 3 * corner) * LANES + lane

    # a fixed order of the corners of each node keeps sums bit-identical for any thread count
    order = np.argsort(corners, kind="stable")
    order = order[corners[order] >= 0]
    node = corners[order]
    rank = np.arange(node.size) - np.searchsorted(node, node)
    block_count = -(-element_count // LANES)
    zero_slot = block_count * 3 * corner_count * LANES
    force_slot = np.full((rank.max() + 1, node_count), zero_slot, dtype=np.int32)
    force_slot[rank, node] = slot[order]
    return force_slot


def _automatic_penalty(material, shortest_length: float) -> float:
    """Return the contact stiffness [Pa/m] that keeps contact from governing the time step."""
    C = material.stress_and_tangent(np.zeros(6))[1]
    stiffness = max(C[0, 0], C[1, 1])
    wave2 = stiffness / material.density
    omega2 = 4.0 * wave2 / shortest_length**2
    return AUTOMATIC_PENALTY * omega2 * 0.5 * material.density * material.thickness
