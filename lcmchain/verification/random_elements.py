"""Random distorted elements and materials, for the element tests and the hard cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.elements.blocks import from_blocks, in_blocks
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.frequency import frequency_bounds
from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.elements.solid_shell.tangent import linearise, node_stiffness
from lcmchain.materials.fabric import Fabric, FabricLaw
from lcmchain.materials.features.bending_curve import BendingCurve
from lcmchain.materials.features.shear import ShearLocking
from lcmchain.materials.features.shear_compaction import Coupling
from lcmchain.materials.law import Material
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness
from lcmchain.mesh.blank import BlankMesh
from lcmchain.model import Model, assemble_model
from lcmchain.tools import build_tool_table

MPA = 1e6
#: Curves of both directions that soften within what a random element bends.
CURVES = (
    BendingCurve((0.5, 2.0, 6.0), (0.003, 0.006, 0.008)),
    BendingCurve((1.0, 3.0, 4.0, 20.0), (0.005, 0.009, 0.0095, 0.012)),
)
THICKNESS = 1.004e-3
EDGE = 5e-3

# VTK hexahedron, bottom face counter-clockwise seen from above, then the top face
CUBE = np.array(
    [
        [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
        [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1],
    ]
).astype(float)  # fmt: skip


def md600(
    locking: ShearLocking | None = None,
    *,
    coupling: Coupling | None = None,
    bending_curves: tuple[BendingCurve | None, BendingCurve | None] = (None, None),
    **changes: float,
) -> Fabric:
    """MD600 of the paper's Tables B.1-B.3 (engineering shear); ``changes`` in Pa."""
    law = FabricLaw(
        C11=1000 * MPA, C22=1000 * MPA, C23=0.1 * MPA, C13=0.1 * MPA,
        s0=0.1919 * MPA, s1=-2.3637 * MPA, s2=14.7593 * MPA, s3=-40.7199 * MPA, s4=42.3208 * MPA,
        c0=0.1563 * MPA, c1=60.4653, c2=2.4528,
        B11=38.0615 * MPA, B22=43.0668 * MPA, B33=0.1 * MPA, B12=4.2123 * MPA, B23=0.1 * MPA,
        B13=0.1 * MPA,
    )._replace(**changes)  # fmt: skip
    return Fabric(
        law,
        thickness=THICKNESS,
        areal_mass=0.6,
        fibre_density=1810.0,
        locking=locking,
        coupling=coupling,
        bending_curves=bending_curves,
    )


def isotropic(
    poisson_ratio: float = 0.3, young_modulus: float = 70e9, thickness: float = THICKNESS
) -> StVenantKirchhoff:
    C = isotropic_stiffness(young_modulus, poisson_ratio)
    return StVenantKirchhoff(C, thickness=thickness, density=2700.0)


def coupled(rng: np.random.Generator, *, equal: bool = False) -> StVenantKirchhoff:
    """A material with full, symmetric positive definite C^M and C^B."""
    A, B = rng.normal(size=(2, 6, 6))
    membrane = (A @ A.T + np.eye(6)) * MPA
    bending = membrane if equal else (B @ B.T + np.eye(6)) * 0.1 * MPA
    return StVenantKirchhoff(membrane, bending, thickness=THICKNESS, density=600.0)


def orthotropic(rng: np.random.Generator) -> StVenantKirchhoff:
    """A material whose C^M and C^B, unlike, couple the normal strains alone."""
    stiffnesses = []
    for modulus in (MPA, 0.1 * MPA):
        A = rng.normal(size=(3, 3))
        C = np.diag(rng.uniform(0.5, 2.0, 6))
        C[:3, :3] += A @ A.T
        stiffnesses.append(modulus * C)
    return StVenantKirchhoff(*stiffnesses, thickness=THICKNESS, density=600.0)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random rotation matrix, uniform over all of them."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def flat_reference(
    rng: np.random.Generator,
    *,
    aligned: bool = False,
    edge: float = EDGE,
    thickness: float = THICKNESS,
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (8, 3) of a parallelogram of constant thickness in space, and a fibre direction."""
    lengths = edge * rng.uniform(0.7, 1.4, 2)
    skew = 0.0 if aligned else rng.uniform(-0.5, 0.5)
    shape = np.array([[lengths[0], skew * lengths[1], 0], [0, lengths[1], 0], [0, 0, thickness]])
    turn = rotation(rng)
    angle = 0.0 if aligned else rng.uniform(0.0, np.pi)
    fibre = turn @ [np.cos(angle), np.sin(angle), 0.0]
    return 0.5 * CUBE @ shape.T @ turn.T + rng.normal(size=3) * 0.1, fibre


def curved_reference(
    rng: np.random.Generator,
    *,
    warp: float = 0.12,
    edge: float = EDGE,
    thickness: float = THICKNESS,
) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`flat_reference`, with every node moved by up to ``warp`` of the sizes."""
    nodes, fibre = flat_reference(rng, edge=edge, thickness=thickness)
    size = np.array([edge, edge, thickness]) * warp
    frame = material_frame(nodes, fibre)
    return nodes + rng.uniform(-1.0, 1.0, (8, 3)) * size @ frame, fibre


def material_frame(nodes: np.ndarray, fibre: np.ndarray) -> np.ndarray:
    """Rows: fibre direction, in-plane normal to it, sheet normal (of the mean plane)."""
    a1, a2 = CUBE[:, 0] @ nodes, CUBE[:, 1] @ nodes
    e3 = np.cross(a1, a2)
    e3 /= np.linalg.norm(e3)
    e1 = fibre - (fibre @ e3) * e3
    e1 /= np.linalg.norm(e1)
    return np.array([e1, np.cross(e3, e1), e3])


def deformed(
    rng: np.random.Generator,
    nodes: np.ndarray,
    fibre: np.ndarray,
    *,
    gradient: np.ndarray | None = None,
    warp: float = 0.1,
    stretch: float = 0.1,
    rotated: bool = True,
) -> np.ndarray:
    """Nodes after a homogeneous deformation in material axes, warping, rotation, translation.

    ``gradient`` (3, 3) defaults to a random one of size ``stretch``; ``warp`` is relative to the
    thickness out of plane and to the edge in plane.
    """
    if gradient is None:
        gradient = np.eye(3) + stretch * rng.uniform(-1.0, 1.0, (3, 3))
    frame = material_frame(nodes, fibre)
    local = (nodes - nodes.mean(axis=0)) @ frame.T
    size = np.ptp(local, axis=0)
    local = local @ np.transpose(gradient) + warp * size * rng.uniform(-0.5, 0.5, (8, 3))
    turn = rotation(rng) if rotated else frame.T
    return local @ turn.T + rng.normal(size=3) * 0.1


def sheared(angle: float, compaction: float = 1.0, stretch: float = 1.0) -> np.ndarray:
    """Gradient that closes the fibres by ``angle``, compacts, and stretches fibre 1."""
    half = 0.5 * angle
    a1 = stretch * np.array([np.cos(half), np.sin(half), 0.0])
    a2 = np.array([np.sin(half), np.cos(half), 0.0])
    return np.stack([a1, a2, [0.0, 0.0, compaction]], axis=1)


def separate_elements(
    nodes: ArrayLike, fibres: ArrayLike, material: Material, options: Any
) -> Model:
    """Model of elements (E, 8, 3) that share no node, and no tools."""
    nodes = np.asarray(nodes)
    count = len(nodes)
    fibres = np.asarray(fibres)
    blank = BlankMesh(
        nodes.reshape(-1, 3), np.arange(8 * count).reshape(count, 8), fibres, fibres, THICKNESS
    )
    contact = SimpleNamespace(penalty=1e9, tangential_ratio=0.5, damping_ratio=0.0)
    process = SimpleNamespace(
        mass_damping=0.0,
        damping_average=None,
        gravity=False,
        time=1.0,
        frames=2,
        step_safety=0.9,
        mass_scaling=None,
    )
    return assemble_model(
        blank,
        material,
        options,
        tools=build_tool_table([], None, 1.0),
        tool_names=(),
        contact=contact,
        process=process,
    )


def positions_of(nodes: ArrayLike) -> np.ndarray:
    """Node positions (3, 8 E) of separate elements (E, 8, 3)."""
    return np.ascontiguousarray(np.reshape(nodes, (-1, 3)).T)


def shared_history(model: Model, curvature: np.ndarray) -> np.ndarray:
    """Return the history of a model whose elements share these curvatures (E, 4)."""
    return in_blocks(np.asarray(curvature, dtype=float))


def random_curvature(rng: np.random.Generator, model: Model) -> np.ndarray:
    """Return β11, β22, β12, q (E, 4) as of elements whose directors turn by up to 25°."""
    span = (
        np.linalg.norm(model.only_body().geometry.modes[:, :2], axis=2).min(axis=1)
        * model.only_body().geometry.height
    )
    turns = rng.uniform(-0.2, 0.2, (model.element_count, 3)) / span[:, None]
    return np.column_stack([turns, rng.uniform(0.0, 0.04, model.element_count)])


def corner_forces(
    model: Model, positions: np.ndarray, history: np.ndarray | None = None
) -> np.ndarray:
    """Return the internal forces (E, corners, 3) [N] of the kernel; ``history`` goes on."""
    body = model.only_body()
    corner_force = np.full(model.corner_force_size, np.nan)
    past = np.empty(0) if history is None else history
    internal_forces(body.data, positions, corner_force, past)
    rows = 3 * body.force_nodes.shape[1]
    whole = corner_force[: model.placed[0].last_force]
    return from_blocks(whole, rows, model.element_count).reshape(model.element_count, -1, 3)


def difference_tangent(
    evaluate: Callable[[np.ndarray], Any], nodes: np.ndarray, step: float
) -> np.ndarray:
    """Derivative (24, 24) of an element's forces (8, 3) by central differences of fourth order."""
    K = np.zeros((24, 24))
    for i in range(24):
        dx = step * np.eye(24)[i].reshape(8, 3)
        near = evaluate(nodes + dx).force - evaluate(nodes - dx).force
        far = evaluate(nodes + 2 * dx).force - evaluate(nodes - 2 * dx).force
        K[:, i] = ((8 * near - far) / (12 * step)).ravel()
    return K


def bounds_and_frequencies(
    references: Sequence[tuple[np.ndarray, np.ndarray]],
    x: ArrayLike,
    material: Material,
    options: Any = None,
    rng: np.random.Generator | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return bound and true highest frequency [1/s] of elements (E, 8, 3) deformed to ``x``.

    The true one is that of the tangent in NumPy, which knows nothing of the compiled bound. With
    ``rng`` elements share random curvatures with neighbours.
    """
    X, fibres = map(np.array, zip(*references, strict=True))
    x = np.array(x)
    model = separate_elements(X, fibres, material, options or ElementOptions())
    data = model.only_body().data
    padded = data.corner_node.size // 8
    omega2, mode = np.zeros(padded), np.zeros(padded, dtype=np.int64)
    history = np.empty(0) if rng is None else shared_history(model, random_curvature(rng, model))
    frequency_bounds(data, positions_of(x), history, omega2, mode)

    shared = np.zeros(model.history_size) if rng is None else history
    displacement = positions_of(x) - model.node_positions.T
    K = node_stiffness(linearise(model, displacement, history=shared).stiffness)
    nodal_mass = material.density * model.only_body().geometry.volume / 8
    eigenvalues = np.linalg.eigvals(K / nodal_mass[:, None, None]).astype(complex)
    # a tangent that is not symmetric: the imaginary part of a frequency is growth, not period
    return np.sqrt(omega2[: len(x)]), np.sqrt(eigenvalues).real.max(axis=1)
