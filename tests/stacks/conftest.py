"""A stack laid over a dome by hand: nothing is compiled, and what lies where is known."""

import numpy as np
import pytest

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
def laid(placed_by_hand):
    """Make the groups of a result whose plies lie flat, then on the dome."""

    def make(scene):
        level = scene.stack[0].blank.height
        return placed_by_hand(scene, lambda mesh: onto_dome(mesh.node_positions, level), 0.9)

    return make
