"""Meshes of the ideally formed hemisphere that receive the forming fields of this example.

Writes ``infiltration.vtu`` (triangles) and ``structure.vtu`` (quadrilateral shells, trimmed
smaller and coarser) beside this file; coordinates in metres. Both describe the mid-surface of the
sheet when it follows the tools: on the spherical punch, over the fillet of the die, flat in the
flange, and straight where it spans from punch to fillet. Run again after a change of the tools:

    python make_meshes.py
"""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

# Tools as in scene.toml; all lengths in m. The top of the die lies at z = 0.
PUNCH_RADIUS = 75e-3
HOLE_RADIUS = 77e-3
FILLET_RADIUS = 10e-3
STROKE = 75e-3
THICKNESS = 1.004e-3

# Half widths of the square flanges. The fibres through the pole do not stretch, so the middle of
# each side of the 300 mm blank is drawn in to 112.5 mm: both parts end inside.
INFILTRATION_HALF_WIDTH = 105e-3
STRUCTURE_HALF_WIDTH = 95e-3
INFILTRATION_CELLS_ACROSS = 62
STRUCTURE_CELLS_ACROSS = 34


class Meridian:
    """Mid-surface of the formed sheet in the r-z plane, by arc length from the pole."""

    def __init__(self) -> None:
        half = 0.5 * THICKNESS
        # At the start the punch touches the sheet, which lies on the die.
        self.sphere_radius = PUNCH_RADIUS + half
        self.sphere_centre = np.array([0.0, THICKNESS - STROKE + PUNCH_RADIUS])
        self.fillet_radius = FILLET_RADIUS + half
        self.fillet_centre = np.array([HOLE_RADIUS + FILLET_RADIUS, -FILLET_RADIUS])
        self.flange_height = half
        # Common tangent between the circles: its normal n, pointing from the sphere's centre to
        # the sheet, has (fillet centre - sphere centre) . n = sum of the radii.
        between = self.fillet_centre - self.sphere_centre
        distance = np.hypot(*between)
        opening = np.arccos((self.sphere_radius + self.fillet_radius) / distance)
        self.tangent_angle = np.arctan2(between[1], between[0]) - opening
        span = distance * np.sin(opening)
        on_sphere = self.sphere_radius * (0.5 * np.pi + self.tangent_angle)
        on_fillet = self.fillet_radius * (0.5 * np.pi + self.tangent_angle)
        self.ends = np.cumsum([on_sphere, span, on_fillet])

    def length_to(self, radius: np.ndarray) -> np.ndarray:
        """Arc length from the pole to a place in the flange at this distance from the axis."""
        return self.ends[2] + radius - self.fillet_centre[0]

    def at(self, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (r, z) at an arc length from the pole."""
        sphere_end, span_end, fillet_end = self.ends
        on_sphere = np.minimum(length, sphere_end) / self.sphere_radius - 0.5 * np.pi
        r = self.sphere_centre[0] + self.sphere_radius * np.cos(on_sphere)
        z = self.sphere_centre[1] + self.sphere_radius * np.sin(on_sphere)
        along = np.clip(length - sphere_end, 0.0, span_end - sphere_end)
        r += -np.sin(self.tangent_angle) * along
        z += np.cos(self.tangent_angle) * along
        turned = np.clip(length - span_end, 0.0, fillet_end - span_end) / self.fillet_radius
        start = self.tangent_angle + np.pi
        r += self.fillet_radius * (np.cos(start - turned) - np.cos(start))
        z += self.fillet_radius * (np.sin(start - turned) - np.sin(start))
        r += np.maximum(length - fillet_end, 0.0)
        return r, z


def formed_grid(cells_across: int, half_width: float) -> tuple[np.ndarray, np.ndarray]:
    """Square grid laid over the formed part: points (N, 3) and quadrilaterals (C, 4).

    Each ray from the pole keeps its direction; its arc length is scaled so that the edge of the
    grid lands on the edge of the square flange.
    """
    meridian = Meridian()
    line = np.linspace(-1.0, 1.0, cells_across + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
    out = np.maximum(np.abs(u), np.abs(v))
    away = np.hypot(u, v)
    safe_away, safe_out = np.where(away > 0.0, away, 1.0), np.where(out > 0.0, out, 1.0)
    edge_radius = half_width * safe_away / safe_out
    r, z = meridian.at(out * meridian.length_to(edge_radius))
    points = np.stack([r * u / safe_away, r * v / safe_away, z], axis=1)
    node = np.arange((cells_across + 1) ** 2).reshape(cells_across + 1, cells_across + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return points, np.stack([corner.ravel() for corner in corners], axis=1)


def as_triangles(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Cut each quadrilateral along its shorter diagonal."""
    first = np.linalg.norm(points[quads[:, 2]] - points[quads[:, 0]], axis=1)
    second = np.linalg.norm(points[quads[:, 3]] - points[quads[:, 1]], axis=1)
    # Rounding must not decide on symmetric cells: equal diagonals take the first.
    turned = np.where((first > second * (1.0 + 1e-9))[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def main() -> None:
    here = Path(__file__).resolve().parent
    points, quads = formed_grid(INFILTRATION_CELLS_ACROSS, INFILTRATION_HALF_WIDTH)
    triangles = as_triangles(points, quads)
    meshio.Mesh(points, [("triangle", triangles.astype(np.int32))]).write(here / "infiltration.vtu")
    points, quads = formed_grid(STRUCTURE_CELLS_ACROSS, STRUCTURE_HALF_WIDTH)
    meshio.Mesh(points, [("quad", quads.astype(np.int32))]).write(here / "structure.vtu")


if __name__ == "__main__":
    main()
