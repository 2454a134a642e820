"""Cantilever under end shear and end moment with large rotations: Sze, Liu, Lo (2004), 3.1 and 3.2.

Sze, Liu, Lo: Popular benchmark problems for geometric nonlinear analysis of shells, Finite
Elements in Analysis and Design 40 (2004) 1551-1569.
"""

from __future__ import annotations

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
