"""A stack laid over a dome by hand: nothing is compiled, and what lies where is known."""

import numpy as np
import pytest

from lcmchain.fields import FrameSeries
from lcmchain.fields.dataset import LaidSheet, SheetFrames, sheets_datasets
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.scene import scene_from_text

SHEET = """
title = "{title}"
process = {{ time = "10 ms", frames = 2 }}
{more}
"""
RADIUS = 0.1  # of the dome under the lowest ply's mid-surface [m]


@pytest.fixture(scope="session")
def scene_of():
    """Make a scene of lines of TOML."""

    def make(more: str, overrides=(), title="stack"):
        return scene_from_text(SHEET.format(title=title, more=more), overrides=overrides)

    return make


def onto_dome(flat: np.ndarray, level: float) -> np.ndarray:
    """Points (n, 3) over a sphere: z above a level is the distance from its surface."""
    x, y, height = flat[:, 0], flat[:, 1], flat[:, 2] - level
    way = np.hypot(x, y)
    angle = way / RADIUS
    direction = np.stack([x, y], axis=1) / np.where(way > 0.0, way, 1.0)[:, None]
    out = np.column_stack([np.sin(angle)[:, None] * direction, np.cos(angle)])
    return (RADIUS + height)[:, None] * out


@pytest.fixture(scope="session")
def laid():
    """Make the groups of a result whose plies lie flat, then on the dome."""

    def make(scene):
        stack, sheets, positions = scene.stack, {}, []
        for ply in stack:
            mesh, material = MidSurfaceMesh.of_blank(ply.build_blank()), ply.built_material()
            flat = mesh.node_positions
            both = np.stack([flat, onto_dome(flat, stack[0].blank.height)])
            thickness = np.full((2, mesh.element_count), material.thickness)
            thickness[1] *= 0.9
            none = np.empty((2, 0, mesh.element_count))
            given = {"thickness": thickness}
            if material.fibre_density is not None:
                fraction = material.areal_mass / (material.fibre_density * thickness)
                given["fibre_volume_fraction"] = fraction
            sheets[ply.name] = SheetFrames(
                LaidSheet(mesh, material), both, none, given, None, None, np.nan
            )
            positions.append(both)
        frames = FrameSeries(
            time=np.array([0.0, scene.process.time]),
            positions=np.concatenate(positions, axis=1),
            tool_travel=np.zeros((2, 0)),
            tool_force=np.zeros((2, 0, 3)),
        )
        return sheets_datasets(scene, sheets, frames)

    return make
