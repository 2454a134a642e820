"""A formed sheet as a map: from places of the flat blank to places of the part, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely

from lcmchain.errors import InputError
from lcmchain.fields.sheet import edge_length, reference_positions, sheet_faces, sheet_positions
from lcmchain.mesh.outline import in_mm

if TYPE_CHECKING:
    import xarray as xr

#: Faces that stand steeper have no place in plan: least part of their area that is seen from above.
LEAST_SEEN = 0.1


@dataclass(frozen=True, eq=False)
class FormedSheet:
    """Mid-surface of a sheet before and after forming, in triangles.

    Attributes
    ----------
    flat : places of the nodes in the flat blank [m], shape (n, 2).
    formed : their positions in the part [m], shape (n, 3).
    faces : nodes of the faces, shape (F, 4); a triangle repeats its last node.
    edge_length : median length of an edge of the blank [m].
    """

    flat: np.ndarray
    formed: np.ndarray
    faces: np.ndarray
    edge_length: float

    @classmethod
    def of_result(cls, sheet: xr.Dataset, frame: int = -1) -> FormedSheet:
        """Return the sheet of a group of ``forming.nc`` in a saved frame."""
        return cls(
            reference_positions(sheet)[:, :2],
            sheet_positions(sheet, frame),
            sheet_faces(sheet),
            edge_length(sheet),
        )

    @cached_property
    def triangles(self) -> np.ndarray:
        """Nodes (T, 3); each quadrilateral is two of them."""
        both = np.concatenate([self.faces[:, [0, 1, 2]], self.faces[:, [0, 2, 3]]])
        return both[both[:, 1] != both[:, 2]]

    def to_formed(self, points: np.ndarray) -> np.ndarray:
        """Return where places of the flat blank (k, 2) lie in the part (k, 3) [m].

        Places beside the mesh, less than an edge away, go on from the nearest triangle.
        """
        nodes, weights = self._in_triangles(self.flat, self._flat_tree, self.triangles, points)
        return (weights[:, :, None] * self.formed[nodes]).sum(axis=1)

    def to_flat(self, points: np.ndarray, *, key: str | None = None) -> np.ndarray:
        """Return which places of the flat blank lie at places of the part in plan, (k, 2) [m].

        Of several layers over each other, as in a fold, any one counts.

        Raises
        ------
        InputError : the part does not reach a place.
        """
        nodes, weights = self._in_triangles(self.formed, self._plan_tree, self._seen, points)
        outside = shapely.distance(self._plan, shapely.points(points))
        if outside.max() > 1e-6 * self.edge_length:
            worst = int(np.argmax(outside))
            raise InputError(
                f"does not lie on the formed sheet: at {in_mm(points[worst])} the sheet is "
                f"{1e3 * outside[worst]:.3g} mm away in plan; give a larger blank, or another line",
                key=key,
            )
        return (weights[:, :, None] * self.flat[nodes]).sum(axis=1)

    def back(self, points: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return the moves of flat places (k, 2) that move their images in plan by ``moves``."""
        corners = self.triangles[self._flat_tree.nearest(shapely.points(points))]
        found = []
        for nodes, move in zip(corners, moves):
            flat = (self.flat[nodes[1:]] - self.flat[nodes[0]]).T
            plan = (self.formed[nodes[1:], :2] - self.formed[nodes[0], :2]).T
            found.append(flat @ np.linalg.lstsq(plan, move, rcond=1e-3)[0])
        return np.array(found)

    @cached_property
    def _flat_tree(self) -> shapely.STRtree:
        return shapely.STRtree(shapely.polygons(self.flat[self.triangles]))

    @cached_property
    def _seen(self) -> np.ndarray:
        """Triangles that are seen from above."""
        corners = self.formed[self.triangles]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return self.triangles[np.abs(area[:, 2]) > LEAST_SEEN * np.linalg.norm(area, axis=1)]

    @cached_property
    def _plan_tree(self) -> shapely.STRtree:
        return shapely.STRtree(shapely.polygons(self.formed[self._seen][..., :2]))

    @cached_property
    def _plan(self) -> shapely.Geometry:
        """Area that the part covers in plan."""
        grown = shapely.buffer(self._plan_tree.geometries, 1e-9, join_style="mitre")
        return shapely.union_all(grown)

    @staticmethod
    def _in_triangles(
        places: np.ndarray, tree: shapely.STRtree, triangles: np.ndarray, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (k, 3) of the triangle nearest to each point, and weights of its corners."""
        nodes = triangles[tree.nearest(shapely.points(points))]
        a, b, c = (places[nodes[:, corner], :2] for corner in range(3))
        whole = _cross(b - a, c - a)
        second, third = _cross(points - a, c - a) / whole, _cross(b - a, points - a) / whole
        return nodes, np.stack([1.0 - second - third, second, third], axis=1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
