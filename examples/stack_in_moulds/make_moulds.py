"""Write lower.stl and upper.stl: a basin and the mould that closes on it, coordinates in mm.

The basin is an elongated dome upside down, 20 mm deep, in a flat rim: z = -10 (1 + cos πq) with
q² = (x / 70)² + (y / 50)². The upper mould is the same surface moved by the gap along its normals,
so that the closed moulds are everywhere as far apart. Run it in this folder to write the files
again; the result is the same to the bit.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

HALF_AXES = np.array([70.0, 50.0])  # of the basin [mm]
DEPTH = 20.0  # of the basin [mm]
GAP = 2.7  # between the closed moulds [mm]
AROUND, RINGS, RIM = 64, 20, 2.2  # facets around and from middle to rim; where the rim ends, in q


def basin(gap: float) -> list[np.ndarray]:
    """Rings of points (AROUND, 3) from the middle to the rim, moved by a gap along the normals."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = []
    for q in [*np.linspace(0.0, 1.0, RINGS + 1), RIM]:
        inside = min(q, 1.0)
        place = q * HALF_AXES * direction
        height = np.full(AROUND, -0.5 * DEPTH * (1.0 + np.cos(np.pi * inside)))
        # slope dz/dq = ½ DEPTH π sin πq, dq/dx = cos(angle) / half-axis
        slope = 0.5 * DEPTH * np.pi * np.sin(np.pi * inside) * direction / HALF_AXES
        normal = np.column_stack([-slope, np.ones(AROUND)])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        rings.append(np.column_stack([place, height]) + gap * normal)
    return rings


def triangles(rings: list[np.ndarray], upwards: bool) -> np.ndarray:
    """Triangles (n, 3, 3) between the rings, whose normals point up or down."""
    found = []
    for i in range(AROUND):
        j = (i + 1) % AROUND
        found.append((rings[0][0], rings[1][i], rings[1][j]))
        for inner, outer in zip(rings[1:], rings[2:]):
            found += [(inner[i], outer[i], outer[j]), (inner[i], outer[j], inner[j])]
    corners = np.array(found)
    return corners if upwards else corners[:, ::-1]


def write_binary_stl(path: Path, corners: np.ndarray) -> None:
    """Write triangles as binary STL."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    with path.open("wb") as file:
        file.write(f"{path.stem} mould of a basin, mm".encode().ljust(80, b" "))
        file.write(struct.pack("<I", len(corners)))
        for normal, own in zip(normals, corners):
            file.write(struct.pack("<12fH", *normal, *own.ravel(), 0))


if __name__ == "__main__":
    folder = Path(__file__).parent
    write_binary_stl(folder / "lower.stl", triangles(basin(0.0), upwards=True))
    write_binary_stl(folder / "upper.stl", triangles(basin(GAP), upwards=False))
