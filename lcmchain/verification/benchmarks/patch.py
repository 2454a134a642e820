"""Patch tests of plates, MacNeal and Harder (1985): five distorted elements in constant stress."""

from __future__ import annotations

import numpy as np

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.scene import Element
from lcmchain.statics import PairSystem, StaticProblem, linear_solution
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    NO_SHEAR_ROW,
    X,
    Y,
    Z,
    from_quads,
    isotropic_model,
    options_of,
)
from lcmchain.verification.benchmarks.result import BenchmarkResult

THICKNESS = 0.001
POINTS = np.array(
    [
        [0.0, 0.0], [0.24, 0.0], [0.24, 0.12], [0.0, 0.12],
        [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08],
    ]
)  # fmt: skip
QUADS = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]])
OUTER = np.arange(4)


def patch_test(kind: str, element: Element = AS_PUBLISHED) -> BenchmarkResult:
    """Stress component that is farthest from the constant one, "membrane" or "bending".

    The displacement of a constant strain or curvature is prescribed at the outer corners, normal to
    the plate at their lower nodes only: the thickness is free.
    """
    middle = np.column_stack([POINTS, np.zeros(len(POINTS))])
    mesh = from_quads(
        middle, [0.0, 0.0, 1.0], QUADS, THICKNESS, np.empty((0, 0), int), fibre=[1.0, 0.0, 0.0]
    )
    model = isotropic_model(mesh, 1e6, 0.25, element)
    x, y, z = mesh.blank.node_positions.T
    field = np.stack([1e-3 * (x + y / 2), 1e-3 * (y + x / 2), np.zeros_like(x)])
    if kind == "bending":
        field = np.stack([-z * field[X], -z * field[Y], 0.5e-3 * (x**2 + x * y + y**2)])
    held = mesh.held((OUTER, [X, Y]))
    held[Z, OUTER] = True
    u = linear_solution(StaticProblem(model=model, held=held, displacements=field))

    # resultants of the linear theory: the constant term and three times <ζ S> at the upper face
    state = linearise(model, np.zeros_like(u))
    modes = PairSystem(model, held).modes(u)
    R = np.einsum("eij,ej->ei", state.resultant_gradient, modes).reshape(-1, 7, 6)
    stress = R[:, 0] if kind == "membrane" else 3.0 * R[:, 1]
    # 11, 22, 12 of a state of plane stress; the transverse components vanish
    exact = 1e-3 * np.array([1e6 / 0.75, 1e6 / 0.75, 0.0, 1e6 / 2.5, 0.0, 0.0])
    if kind == "bending":
        exact = -0.5 * THICKNESS * exact
    scale = np.where(exact == 0.0, exact[0], exact)
    error = (stress - exact) / scale
    worst = error.flat[abs(error).argmax()]
    reference = abs(exact[0])
    return BenchmarkResult(
        f"patch test, {kind}",
        "5 quads",
        options_of(element),
        reference * (1.0 + worst),
        reference,
        "MacNeal, Harder 1985; exact",
        1.0 if element in (AS_PUBLISHED, NO_SHEAR_ROW) else None,
    )
