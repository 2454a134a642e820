"""Pinched semi-cylinder, isotropic and laminated, with large rotations: Sze, Liu, Lo (2004), 3.7.

Sze, Liu, Lo: Popular benchmark problems for geometric nonlinear analysis of shells, Finite
Elements in Analysis and Design 40 (2004) 1551-1569. Their results come from shell elements of
Abaqus, 40x40 for one half.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from lcmchain.errors import SimulationError
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness
from lcmchain.model import assemble_sheet
from lcmchain.scene import Element
from lcmchain.statics import StaticProblem, solve
from lcmchain.statics.paths import StaticStep
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    X,
    Y,
    Z,
    cylinder_sector,
    options_of,
)
from lcmchain.verification.benchmarks.result import CurveResult

RADIUS, LENGTH, THICKNESS = 101.6, 304.8, 3.0
FORCE = 2000.0
E_L, E_T, G_LT, NU = 2068.5, 517.125, 795.6, 0.3  # of the layers; L along their fibres
G_TT = E_T / (2.0 * (1.0 + NU))

# Angles of the layers to the axis of the cylinder, from the inside; none: isotropic, E_L and NU.
LAYUPS: dict[str, tuple[float, ...]] = {
    "isotropic": (),
    "0/90/0": (0.0, 90.0, 0.0),
    "90/0/90": (90.0, 0.0, 90.0),
}

# load over 2000 -> deflection under the force by layup, as MBDyn's sources list it
# (tests/plates/sze2004/sze37/sze37_ref.dat)
DEFLECTION = np.array(
    [
        [0.050, 5.421, 15.340, 7.558], [0.100, 16.100, 37.920, 22.722],
        [0.125, 22.195, 55.145, 30.594], [0.150, 27.657, 93.433, 37.897],
        [0.175, 32.700, 129.575, 45.427], [0.200, 37.582, 141.562, 54.455],
        [0.225, 42.633, 149.034, 65.814], [0.250, 48.537, 154.634, 79.512],
        [0.275, 56.355, 159.141, 92.524], [0.300, 66.410, 162.896, 102.357],
        [0.325, 79.810, 166.099, 109.793], [0.350, 94.669, 168.884, 115.746],
        [0.400, 113.704, 173.560, 125.094], [0.450, 124.751, 177.404, 132.488],
        [0.500, 132.653, 180.680, 138.740], [0.550, 138.920, 183.544, 144.238],
        [0.600, 144.185, 186.099, 149.191], [0.650, 148.770, 188.415, 153.728],
        [0.700, 152.863, 190.543, 157.930], [0.750, 156.584, 192.520, 161.854],
        [0.800, 160.015, 194.376, 165.540], [0.850, 163.211, 196.132, 169.017],
        [0.900, 166.200, 197.808, 172.308], [0.950, 168.973, 199.420, 175.430],
        [1.000, 171.505, 200.983, 178.386],
    ]
)  # fmt: skip


def semi_cylinder(
    layup: str,
    count: int = 40,
    element: Element = AS_PUBLISHED,
    *,
    rows: slice = slice(None),
    on_step: Callable[[StaticStep], None] | None = None,
) -> CurveResult:
    """Clamped semi-cylinder pinched by a force at the crown of its free end.

    Its straight edges may neither sink nor turn about themselves. ``rows`` of :data:`DEFLECTION`
    are computed. Where the solver finds no way to the last load the curve ends before it.
    """
    mesh = cylinder_sector(RADIUS, LENGTH, THICKNESS, 0.5 * math.pi, count, count)
    material = layered_material(LAYUPS[layup])
    model = assemble_sheet(mesh.blank, material, element)
    grid = mesh.grid  # second index: from the straight edge to the crown
    held = mesh.held((grid[0], [X, Y, Z]), (grid[:, 0], [Z]), (grid[:, -1], [X]))
    loads = mesh.pair_loads([grid[-1, -1]], [0.0, 0.0, -0.5 * FORCE])
    problem = StaticProblem(model=model, held=held, forces=loads)
    table = DEFLECTION[rows]
    reached: list[StaticStep] = []

    def keep(step: StaticStep) -> None:
        reached.append(step)
        if on_step is not None:
            on_step(step)

    end = ""
    try:
        solve(problem, table[:, 0], past_limits=True, on_step=keep)
    except SimulationError as error:
        end = str(error)
    by_load = {step.load_factor: step.displacement for step in reached}
    moved = [
        [-mesh.middle(by_load[load], grid[-1, -1])[Z]] if load in by_load else [math.nan]
        for load in table[:, 0]
    ]
    return CurveResult(
        f"pinched semi-cylinder, {layup}",
        mesh.mesh,
        options_of(element),
        table[:, 0],
        ("under the force",),
        np.array(moved),
        table[:, [1 + list(LAYUPS).index(layup)]],
        "Sze, Liu, Lo 2004, 3.7",
        end,
    )


def layered_material(angles: Sequence[float]) -> StVenantKirchhoff:
    """Return the material of equal layers at ``angles`` [°], isotropic without any."""
    membrane = bending = isotropic_stiffness(E_L, NU)
    if angles:
        membrane, bending = laminate_stiffness(angles)
    return StVenantKirchhoff(membrane, bending, thickness=THICKNESS, density=1.0)


def laminate_stiffness(angles: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return C^M and C^B (6, 6) of a symmetric laminate of equal layers at 0° and 90°.

    Every layer is in plane stress, as in the classical theory of laminates: membrane A/h, bending
    12 D/h³. Strains over the thickness meet the layers' transverse modulus and do not couple with
    those in the plane; transverse shear meets the mean of the layers' moduli.
    """
    major = 1.0 / (1.0 - NU**2 * E_T / E_L)
    plane = major * np.array([[E_L, NU * E_T, 0.0], [NU * E_T, E_T, 0.0], [0.0, 0.0, 0.0]])
    plane[2, 2] = G_LT
    face = np.linspace(-0.5, 0.5, len(angles) + 1)  # over the thickness
    membrane, bending = np.zeros((6, 6)), np.zeros((6, 6))
    for angle, below, above in zip(angles, face[:-1], face[1:], strict=True):
        order = [0, 1, 2] if angle == 0.0 else [1, 0, 2]
        layer = np.zeros((6, 6))
        layer[np.ix_([0, 1, 3], [0, 1, 3])] = plane[np.ix_(order, order)]
        layer[2, 2] = E_T
        layer[[4, 5], [4, 5]] = (G_TT, G_LT) if angle == 0.0 else (G_LT, G_TT)
        membrane += (above - below) * layer
        bending += 4.0 * (above**3 - below**3) * layer
    shear = [4, 5]  # linear shear over the thickness has no counterpart in the theory of laminates
    bending[shear, shear] = membrane[shear, shear]
    return membrane, bending
