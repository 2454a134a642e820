"""Cut through a formed sheet by a plane: its upper and lower face, in order along the sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcmchain.mesh.lines import cut_edges

# A plane through nodes is moved aside by this part of the sheet's extent.
ASIDE = 1e-5


@dataclass(frozen=True)
class Plane:
    """A plane with axes of its own: point [m] (3,), unit vectors along, up and normal (3,).

    name : stands above the section.
    """

    point: np.ndarray
    along: np.ndarray
    up: np.ndarray
    normal: np.ndarray
    name: str = ""

    @classmethod
    def through(cls, point: np.ndarray, normal: np.ndarray, name: str = "") -> Plane:
        """Return a plane whose ``up`` is z as far as it can be, else y."""
        normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
        upwards = np.eye(3)[2] if abs(normal[2]) < 0.99 else np.eye(3)[1]
        up = upwards - (upwards @ normal) * normal
        up /= np.linalg.norm(up)
        along = np.cross(up, normal)
        if along[np.argmax(np.abs(along))] < 0.0:  # to the right, or upwards on the map
            along, normal = -along, -normal
        return cls(np.asarray(point, dtype=float), along, up, normal, name)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (..., 2) along and up of points (..., 3), seen from the origin."""
        return np.stack([points @ self.along, points @ self.up], axis=-1)

    def place(self, flat: np.ndarray) -> np.ndarray:
        """Return the points (..., 3) of the plane with such coordinates."""
        off = (self.point @ self.normal) * self.normal
        return flat[..., :1] * self.along + flat[..., 1:] * self.up + off


def cut_sheet(
    middle: np.ndarray, bottom: np.ndarray, top: np.ndarray, faces: np.ndarray, plane: Plane
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the lower and the upper face (n, 3) where a plane cuts a sheet, strip by strip.

    The mid-surface is cut; both faces are taken at the same places of its edges, so that a strip
    has the thickness along the directors.

    Parameters
    ----------
    middle, bottom, top : of the n nodes (n, 3) [m].
    faces : (F, 4) nodes; a triangle repeats its last one.
    """
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    aside = ASIDE * float(np.ptp(middle, axis=0).max())
    height = (middle - plane.point) @ plane.normal - aside
    cut = cut_edges(triangles, height)
    lower, upper = cut.places(bottom), cut.places(top)
    strips = _chains(cut.ends)
    found = []
    for strip in strips:
        if (lower[strip[-1]] - lower[strip[0]]) @ plane.along < 0.0:
            strip = strip[::-1]
        found.append((lower[strip], upper[strip]))
    return sorted(found, key=lambda faces: float((faces[0] @ plane.along).min()))


def _chains(pairs: np.ndarray) -> list[list[int]]:
    """Join pairs of numbers (S, 2), of which each number occurs at most twice, to chains."""
    neighbours: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    chains, seen = [], set()
    # open chains from their ends first, then closed ones from anywhere
    for start in sorted(neighbours, key=lambda number: len(neighbours[number])):
        if start in seen:
            continue
        chain, node = [start], start
        seen.add(start)
        while following := [other for other in neighbours[node] if other not in seen]:
            node = following[0]
            seen.add(node)
            chain.append(node)
        if len(chain) > 2 and start in neighbours[node] and len(neighbours[start]) == 2:
            chain.append(start)
        chains.append(chain)
    return chains
