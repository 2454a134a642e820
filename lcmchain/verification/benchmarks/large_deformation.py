"""Shells with large rotations, of Sze, Liu and Lo (2004).

Cantilever under end shear and end moment (3.1, 3.2), hemisphere with a hole (3.4), pinched cylinder
(3.6). Their results of the two shells come from shell elements of Abaqus, 16x16 for the quarter of
the hemisphere and 48x48 for the octant of the cylinder.

Sze, Liu, Lo: Popular benchmark problems for geometric nonlinear analysis of shells, Finite
Elements in Analysis and Design 40 (2004) 1551-1569.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from lcmchain.scene import Element
from lcmchain.statics import DirectorCouples, StaticProblem, solve
from lcmchain.statics.paths import StaticStep
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    X,
    Y,
    Z,
    cylinder_sector,
    hemisphere_quarter,
    isotropic_model,
    options_of,
    rectangle,
)
from lcmchain.verification.benchmarks.result import CurveResult

E, WIDTH, THICKNESS = 1.2e6, 1.0, 0.1
RIGIDITY = E * WIDTH * THICKNESS**3 / 12.0

# load over its maximum -> (-u, w) of the tip, 16x1 shell elements (their table 1)
END_SHEAR = np.array(
    [
        [0.05, 0.026, 0.663], [0.10, 0.103, 1.309], [0.15, 0.224, 1.922], [0.20, 0.381, 2.493],
        [0.25, 0.563, 3.015], [0.30, 0.763, 3.488], [0.35, 0.971, 3.912], [0.40, 1.184, 4.292],
        [0.45, 1.396, 4.631], [0.50, 1.604, 4.933], [0.55, 1.807, 5.202], [0.60, 2.002, 5.444],
        [0.65, 2.190, 5.660], [0.70, 2.370, 5.855], [0.75, 2.541, 6.031], [0.80, 2.705, 6.190],
        [0.85, 2.861, 6.335], [0.90, 3.010, 6.467], [0.95, 3.151, 6.588], [1.00, 3.286, 6.698],
    ]
)  # fmt: skip


def end_shear(
    n1: int = 16,
    element: Element = AS_PUBLISHED,
    *,
    on_step: Callable[[StaticStep], None] | None = None,
) -> CurveResult:
    """Cantilever of length 10 under a dead force 4 EI/L² across its end."""
    length = 10.0
    mesh = rectangle(length, WIDTH, THICKNESS, n1, 1)
    model = isotropic_model(mesh, E, 0.0, element)
    tip = mesh.grid[-1]
    forces = mesh.edge_load(tip, [0.0, 0.0, 4.0 * RIGIDITY / length**2])
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    problem = StaticProblem(model=model, held=held, forces=forces)
    history = solve(problem, END_SHEAR[:, 0], on_step=on_step)
    moved = np.array([mesh.middle(step.displacement, tip).mean(axis=0) for step in history])
    return CurveResult(
        "cantilever, end shear",
        mesh.mesh,
        options_of(element),
        END_SHEAR[:, 0],
        ("-u tip", "w tip"),
        moved[:, [X, Z]] * [-1.0, 1.0],
        END_SHEAR[:, 1:],
        "Sze, Liu, Lo 2004, 3.1",
    )


def roll_up(
    n1: int = 16,
    load_factors: Sequence[float] | np.ndarray | None = None,
    element: Element = AS_PUBLISHED,
    *,
    on_step: Callable[[StaticStep], None] | None = None,
) -> CurveResult:
    """Cantilever of length 12 that an end moment 2πEI/L rolls up to a full circle."""
    length = 12.0
    mesh = rectangle(length, WIDTH, THICKNESS, n1, 1)
    model = isotropic_model(mesh, E, 0.0, element)
    tip = mesh.grid[-1]
    largest = 2.0 * np.pi * RIGIDITY / length
    couple = DirectorCouples(tip, np.array([0.0, -1.0, 0.0]), np.full(2, 0.5 * largest))
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    problem = StaticProblem(model=model, held=held, couples=(couple,))
    if load_factors is None:
        load_factors = np.linspace(0.05, 1.0, 20)
    history = solve(problem, load_factors, on_step=on_step)
    moved = np.array([mesh.middle(step.displacement, tip).mean(axis=0) for step in history])
    angle = 2.0 * np.pi * np.asarray(load_factors)
    exact = np.stack(
        [length * (1.0 - np.sin(angle) / angle), length * (1.0 - np.cos(angle)) / angle], axis=1
    )
    return CurveResult(
        "cantilever, roll-up",
        mesh.mesh,
        options_of(element),
        np.asarray(load_factors),
        ("-u tip", "w tip"),
        moved[:, [X, Z]] * [-1.0, 1.0],
        exact,
        "exact: circular arc",
    )


# --- hemisphere with a hole, and pinched cylinder -------------------------------------------------


# load over 400 -> outward and inward deflection under the forces
HEMISPHERE = np.array(
    [
        [0.05, 0.855, 0.955], [0.10, 1.499, 1.840], [0.15, 1.969, 2.604], [0.20, 2.321, 3.261],
        [0.25, 2.596, 3.833], [0.30, 2.819, 4.339], [0.35, 3.002, 4.790], [0.40, 3.158, 5.196],
        [0.45, 3.291, 5.565], [0.50, 3.406, 5.902], [0.55, 3.508, 6.212], [0.60, 3.598, 6.497],
        [0.65, 3.678, 6.761], [0.70, 3.750, 7.006], [0.75, 3.816, 7.234], [0.80, 3.875, 7.448],
        [0.85, 3.929, 7.647], [0.90, 3.979, 7.835], [0.95, 4.025, 8.011], [1.00, 4.067, 8.178],
    ]
)  # fmt: skip

# load over 12000 -> deflection under the force and of the side (outwards)
PINCHED_CYLINDER = np.array(
    [
        [0.05, 9.561, -0.233], [0.075, 15.648, -0.922], [0.10, 23.164, -2.391],
        [0.125, 29.375, -3.872], [0.15, 36.208, -2.154], [0.175, 51.499, 6.792],
        [0.20, 56.373, 10.448], [0.25, 61.877, 14.905], [0.30, 65.498, 17.979],
        [0.35, 68.229, 20.365], [0.40, 70.424, 22.321], [0.45, 72.204, 23.916],
        [0.50, 73.790, 25.381], [0.55, 75.139, 26.631], [0.60, 76.331, 27.735],
        [0.65, 77.472, 28.843], [0.70, 78.451, 29.772], [0.75, 79.339, 30.604],
        [0.80, 80.218, 31.471], [0.85, 81.045, 32.299], [0.90, 81.766, 32.989],
        [0.95, 82.435, 33.619], [1.00, 83.102, 34.272],
    ]
)  # fmt: skip


def hemisphere(
    count: int = 16,
    element: Element = AS_PUBLISHED,
    *,
    table: np.ndarray = HEMISPHERE,
    on_step: Callable[[StaticStep], None] | None = None,
) -> CurveResult:
    """Hemisphere with an 18° hole under alternating radial forces of 400 at the equator."""
    mesh = hemisphere_quarter(10.0, 0.04, math.radians(18.0), count, count)
    model = isotropic_model(mesh, 6.825e7, 0.3, element)
    grid = mesh.grid
    held = mesh.held((grid[0], [Y]), (grid[-1], [X]))
    held[Z, grid[count // 2, 0]] = True  # one node: a pair would hold the rotation there too
    loads = mesh.pair_loads(grid[[0, -1], 0], [[200.0, 0.0, 0.0], [0.0, -200.0, 0.0]])
    problem = StaticProblem(model=model, held=held, forces=loads)
    history = solve(problem, table[:, 0], on_step=on_step)
    moved = np.array(
        [
            [
                mesh.middle(step.displacement, grid[0, 0])[X],
                -mesh.middle(step.displacement, grid[-1, 0])[Y],
            ]
            for step in history
        ]
    )
    return CurveResult(
        "hemisphere with an 18° hole, large deformation",
        mesh.mesh,
        options_of(element),
        table[:, 0],
        ("outward", "inward"),
        moved,
        table[:, 1:],
        "Sze, Liu, Lo 2004, 3.4",
    )


def pinched_cylinder(
    count: int = 48,
    element: Element = AS_PUBLISHED,
    *,
    table: np.ndarray = PINCHED_CYLINDER,
    on_step: Callable[[StaticStep], None] | None = None,
) -> CurveResult:
    """Cylinder with rigid end diaphragms under two opposite forces of 12000."""
    mesh = cylinder_sector(100.0, 100.0, 1.0, 0.5 * math.pi, count, count)
    model = isotropic_model(mesh, 30e3, 0.3, element)
    grid = mesh.grid  # second index: from the side to the force
    held = mesh.held((grid[-1], [Y]), (grid[:, -1], [X]), (grid[:, 0], [Z]))
    # the diaphragm holds the mid-surface: held faces would clamp its large rotation at the end
    diaphragm = np.zeros((3, mesh.blank.pair_count), dtype=bool)
    diaphragm[np.ix_(np.array([X, Z]), grid[0])] = True
    loads = mesh.pair_loads([grid[-1, -1]], [0.0, 0.0, -3000.0])
    problem = StaticProblem(model=model, held=held, held_middle=diaphragm, forces=loads)
    history = solve(problem, table[:, 0], on_step=on_step)
    moved = np.array(
        [
            [
                -mesh.middle(step.displacement, grid[-1, -1])[Z],
                mesh.middle(step.displacement, grid[-1, 0])[X],
            ]
            for step in history
        ]
    )
    return CurveResult(
        "pinched cylinder, large deformation",
        mesh.mesh,
        options_of(element),
        table[:, 0],
        ("under the force", "side"),
        moved,
        table[:, 1:],
        "Sze, Liu, Lo 2004, 3.6",
    )
