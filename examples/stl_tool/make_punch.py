"""Write punch.stl: an elongated dome with two different curvatures, closed, coordinates in mm.

The lower half of an ellipsoid (half-axes 45, 30, 30 mm, pole at the origin, pointing to -z) is
continued upwards by a straight wall and closed by a lid. Run it in this folder to write the file
again; the result is the same to the bit.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

HALF_AXES = (45.0, 30.0, 30.0)  # mm
HEIGHT = 60.0  # mm, pole to lid
AROUND, DOWN = 72, 20  # facets around the dome and from its pole to its rim


def dome_triangles() -> np.ndarray:
    """Triangles of the punch, outward orientation, shape (triangle_count, 3, 3), in mm."""
    a, b, c = HALF_AXES
    azimuth = 2 * np.pi * np.arange(AROUND) / AROUND
    polar = 0.5 * np.pi * np.arange(1, DOWN + 1) / DOWN
    ring = np.stack([a * np.cos(azimuth), b * np.sin(azimuth)], axis=1)
    rings = [
        np.column_stack([np.sin(angle) * ring, np.full(AROUND, c * (1 - np.cos(angle)))])
        for angle in polar
    ]
    rings.append(np.column_stack([ring, np.full(AROUND, HEIGHT)]))
    pole, lid = np.zeros(3), np.array([0.0, 0.0, HEIGHT])

    triangles = []
    for i in range(AROUND):
        j = (i + 1) % AROUND
        triangles.append((pole, rings[0][j], rings[0][i]))
        for lower, upper in zip(rings, rings[1:]):
            triangles.append((lower[i], lower[j], upper[j]))
            triangles.append((lower[i], upper[j], upper[i]))
        triangles.append((rings[-1][i], rings[-1][j], lid))
    return np.array(triangles)


def write_binary_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles as binary STL."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    with path.open("wb") as file:
        file.write(b"elongated dome punch, mm".ljust(80, b" "))
        file.write(struct.pack("<I", len(triangles)))
        for normal, corners in zip(normals, triangles):
            file.write(struct.pack("<12fH", *normal, *corners.ravel(), 0))


if __name__ == "__main__":
    write_binary_stl(Path(__file__).with_name("punch.stl"), dome_triangles())
