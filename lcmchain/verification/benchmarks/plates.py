"""Clamped square plate from thick to very thin, in linear theory."""

from __future__ import annotations

import numpy as np

from lcmchain.scene import Element
from lcmchain.statics import StaticProblem, linear_solution
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    X,
    Y,
    Z,
    isotropic_model,
    options_of,
    rectangle,
)
from lcmchain.verification.benchmarks.result import BenchmarkResult

# deflection of the centre over P L²/D and q L⁴/D, Kirchhoff plate (series)
COEFFICIENTS = {"point": 0.0056046, "uniform": 0.00126532}
# Value over reference of an independent linear implementation of the element as published, by
# (load, slenderness) and the elements along the edge of a quarter.
EXPECTED = {
    ("point", 100): {2: 0.855, 4: 0.963, 8: 0.993, 16: 1.002, 32: 1.005},
    ("point", 1000): {4: 0.961, 8: 0.990, 16: 0.998, 32: 1.001},
    ("uniform", 100): {2: 0.947, 4: 0.987, 8: 0.998, 16: 1.001, 32: 1.001},
    ("uniform", 1000): {4: 0.986, 8: 0.996, 16: 0.999, 32: 1.000},
}


def clamped_plate(
    load: str, slenderness: int, count: int, element: Element = AS_PUBLISHED
) -> BenchmarkResult:
    """Deflection of the centre under a central force ("point") or a pressure ("uniform")."""
    length, E, nu = 100.0, 1e7, 0.3
    thickness = length / slenderness
    mesh = rectangle(0.5 * length, 0.5 * length, thickness, count, count)
    model = isotropic_model(mesh, E, nu, element)
    grid = mesh.grid
    held = mesh.held(
        (grid[0], [X]), (grid[:, 0], [Y]), (grid[-1], [X, Y, Z]), (grid[:, -1], [X, Y, Z])
    )
    rigidity = E * thickness**3 / (12.0 * (1.0 - nu**2))
    if load == "point":
        forces = mesh.pair_loads([grid[0, 0]], [0.0, 0.0, 0.25 * rigidity / length**2])
    else:
        forces = np.zeros((3, model.node_count))
        forces[Z] = 0.5 * model.nodes.area * rigidity / length**4
    u = linear_solution(StaticProblem(model=model, held=held, forces=forces))
    return BenchmarkResult(
        f"clamped plate L/t = {slenderness:g}, {load} load",
        mesh.mesh,
        options_of(element),
        float(mesh.middle(u, grid[0, 0])[Z]),
        COEFFICIENTS[load],
        "series of the Kirchhoff plate",
        EXPECTED.get((load, slenderness), {}).get(count) if element == AS_PUBLISHED else None,
    )
