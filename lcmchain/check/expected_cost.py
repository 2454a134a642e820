"""Expected cost of a run, from the undeformed blank."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.triangulation import TriangleMesh
from lcmchain.model import AUTOMATIC_PENALTY
from lcmchain.scene import (
    FabricMaterial,
    IsotropicMaterial,
    MembraneShellElement,
    OrthotropicMaterial,
    Scene,
)

#: Time per element and step on one core that the estimate assumes, by the kind of element.
SECONDS_PER_ELEMENT_STEP = {"solid-shell": 0.12e-6, "membrane-shell": 0.05e-6}


@dataclass(frozen=True)
class Estimate:
    """Expected cost of a run.

    Parameters
    ----------
    critical_step : stable time step of the undeformed blank [s].
    step_count : steps of the whole process, with the scene's safety factor.
    seconds : expected computing time [s], without compilation.
    controlled_by : what limits the step, in words.
    """

    critical_step: float
    step_count: int
    seconds: float
    controlled_by: str


def estimate_run(scene: Scene, mesh: BlankMesh | TriangleMesh) -> Estimate:
    """Estimate time step, step count and computing time from the undeformed blank.

    The step follows from the fastest elastic wave: in-plane over the shortest edge, or over the
    thickness, and from the automatic contact stiffness. Compaction and a given
    ``contact.penalty`` may shorten it during a run.
    """
    density = scene.material.areal_mass / scene.material.thickness
    in_plane_stiffness, normal_stiffness = _wave_stiffnesses(scene)
    shortest_edge = _shortest_edge(mesh)
    steps = {"in-plane waves": shortest_edge / math.sqrt(in_plane_stiffness / density)}
    if not isinstance(scene.element, MembraneShellElement):
        thickness_wave = math.sqrt(normal_stiffness / density)
        steps["waves over the thickness"] = scene.material.thickness / thickness_wave
    controlled_by = min(steps, key=steps.get)
    critical_step = steps[controlled_by] * _contact_share(scene)
    step_count = math.ceil(scene.process.time / (critical_step * scene.process.step_safety))
    seconds = step_count * mesh.element_count * SECONDS_PER_ELEMENT_STEP[scene.element.type]
    return Estimate(critical_step, step_count, seconds, controlled_by)


def _contact_share(scene: Scene) -> float:
    """Return the part of the time step that the automatic contact stiffness leaves."""
    if not scene.tools or scene.contact.penalty is not None:
        return 1.0
    return 1.0 / math.sqrt(1.0 + AUTOMATIC_PENALTY)


def _wave_stiffnesses(scene: Scene) -> tuple[float, float]:
    """Largest in-plane and largest normal stiffness of the undeformed material [Pa]."""
    material = scene.material
    if isinstance(material, FabricMaterial):
        membrane, bending = material.membrane, material.bending
        in_plane = max(membrane.C11, membrane.C22, bending.C11, bending.C22)
        return in_plane, max(material.compaction.c0, bending.C33)
    if isinstance(material, IsotropicMaterial):
        nu = material.poisson_ratio
        stiffness = material.young_modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        return stiffness, stiffness
    if isinstance(material, OrthotropicMaterial):
        matrix = np.linalg.inv(material.normal_compliance) * material.E1
        matrix *= max(1.0, material.bending_factor)
        return float(max(matrix[0, 0], matrix[1, 1])), float(matrix[2, 2])
    diagonal = np.maximum(np.diag(material.membrane), np.diag(material.bending))
    return float(max(diagonal[0], diagonal[1])), float(diagonal[2])


def _shortest_edge(mesh: BlankMesh | TriangleMesh) -> float:
    corners = mesh.node_positions[mesh.elements[:, :4]]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return float(lengths[lengths > 0.0].min())  # a triangle repeats its last node
