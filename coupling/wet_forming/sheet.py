"""The sheet that is being formed, as the part that resin flows through."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.infiltration.formed_part import FormedPart, blocks_of
from lcmchain.fields.ugrid import TIME
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene import Scene
from lcmchain.solver.simulation import Simulation, Snapshot


def part_of_sheet(
    scene: Scene, simulation: Simulation, snapshots: Sequence[Snapshot], points: np.ndarray
) -> FormedPart:
    """Return the sheet in the last of saved states; its cells are the elements in their order.

    Parameters
    ----------
    snapshots : the start, and any later ones. points : of its mid-surface then (N, 3) [m].
    """
    (body,) = simulation.model.bodies
    cells = np.asarray(body.mesh.sheet_faces, dtype=np.int64)
    target = TargetMesh(points, blocks_of(cells), {})
    fields = forming_datasets(scene, simulation, snapshots)["/"].isel({TIME: -1})
    return FormedPart(target, fields.drop_vars(TIME), str(scene.source.path or "the scene"))


def blank_of_scene(scene: Scene) -> FormedPart:
    """Return the blank of a scene, before it is formed."""
    simulation = Simulation.from_scene(scene)
    (body,) = simulation.model.bodies
    points = body.mesh.mid_surface(simulation.model.node_positions)
    return part_of_sheet(scene, simulation, [simulation.snapshot()], points)
