"""Computes the plate with Kratos: ``python kratos_run.py ELEMENT PLATE.npz FOUND.npz``.

A program of its own that imports nothing of lcmchain but the constants of the plate.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from lcmchain.bench.peers.plate import DENSITY, POISSON_RATIO, YOUNG_MODULUS

NODAL = (
    "DISPLACEMENT", "REACTION", "VELOCITY", "ACCELERATION", "VOLUME_ACCELERATION",
    "FORCE_RESIDUAL", "NODAL_MASS",
)  # fmt: skip
# Corners of a hexahedron that make two prisms.
PRISMS = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))


def kratos() -> tuple[Any, Any]:
    """Return Kratos and its application for structures, which need not be installed."""
    import KratosMultiphysics
    import KratosMultiphysics.StructuralMechanicsApplication as Structural

    return KratosMultiphysics, Structural


def model_part(
    model: Any, element: str, nodes: np.ndarray, elements: np.ndarray, velocity: np.ndarray
) -> Any:
    """Return the plate at rest in its shape, with its velocity.

    nodes : (node_count, 3) [m]; elements : (element_count, 8); velocity : as nodes [m/s].
    """
    Kratos, Structural = kratos()
    part = model.CreateModelPart("plate")
    for variable in (*(getattr(Kratos, name) for name in NODAL), Structural.MIDDLE_VELOCITY):
        part.AddNodalSolutionStepVariable(variable)
    part.SetBufferSize(2)
    part.ProcessInfo[Kratos.DOMAIN_SIZE] = 3
    part.ProcessInfo[Kratos.COMPUTE_LUMPED_MASS_MATRIX] = True
    elastic = part.CreateNewProperties(1)
    elastic[Kratos.DENSITY] = DENSITY
    elastic[Kratos.YOUNG_MODULUS] = YOUNG_MODULUS
    elastic[Kratos.POISSON_RATIO] = POISSON_RATIO
    elastic[Kratos.CONSTITUTIVE_LAW] = Structural.LinearElastic3DLaw()
    for i, place in enumerate(nodes.tolist(), 1):
        part.CreateNewNode(i, *place)
    cells = elements + 1
    if "Sprism" in element:
        cells = np.concatenate([cells[:, corners] for corners in PRISMS])
    for i, cell in enumerate(cells.tolist(), 1):
        part.CreateNewElement(element, i, cell, elastic)
    for axis in "XYZ":
        force = getattr(Kratos, f"REACTION_{axis}")
        Kratos.VariableUtils().AddDof(getattr(Kratos, f"DISPLACEMENT_{axis}"), force, part)
    if "Sprism" in element:
        Structural.PrismNeighboursProcess(part).Execute()
    for node, start in zip(part.Nodes, velocity.tolist(), strict=True):
        for back in (0, 1):
            node.SetSolutionStepValue(Kratos.VELOCITY, back, start)
            node.SetSolutionStepValue(Structural.MIDDLE_VELOCITY, back, start)
    return part


def main(element: str, given: str, found: str) -> None:
    """Compute the steps that the file ``given`` asks for, and write what came of them."""
    Kratos, Structural = kratos()
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    plate = np.load(given)
    model, step = Kratos.Model(), float(plate["step"])
    part = model_part(model, element, plate["nodes"], plate["elements"], plate["velocity"])
    scheme = Structural.ExplicitCentralDifferencesScheme(step, 1.0, 0.0)
    # no reactions, no new degrees of freedom; elements measure strain by the moved mesh
    strategy = Structural.MechanicalExplicitStrategy(part, scheme, False, False, True)
    strategy.Initialize()
    before, begin = time.process_time(), time.perf_counter()
    for number in range(1, int(plate["steps"]) + 1):
        part.CloneTimeStep(number * step)
        part.ProcessInfo[Kratos.STEP] = number
        strategy.Solve()
    processor, wall = time.process_time() - before, time.perf_counter() - begin
    displacement = [list(node.GetSolutionStepValue(Kratos.DISPLACEMENT)) for node in part.Nodes]
    np.savez(found, displacement=displacement, processor=processor, wall=wall)


if __name__ == "__main__":
    main(*sys.argv[1:])
