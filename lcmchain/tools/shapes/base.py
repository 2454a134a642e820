"""What every tool shape offers to the tool table, to drawings and to checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.quantities.entry_types import SceneModel
from lcmchain.tools.distance import EXTRUDED, REVOLVED
from lcmchain.tools.profile_surface import profile_surface
from lcmchain.tools.profiles import CORNER_COLUMNS, SEGMENT_COLUMNS, Profile
from lcmchain.tools.surfaces.surface import Surface


def shape_entries(kind: int, **given: Any) -> dict[str, Any]:
    """Entries of one tool in the shape columns of the tool table; what is not given is empty."""
    return {
        "kind": kind,
        "segments": np.zeros((0, SEGMENT_COLUMNS)),
        "corners": np.zeros((0, CORNER_COLUMNS)),
        "spacing": 0.0,
        "grid_origin": np.zeros(3),
        "grid_shape": np.zeros(3, np.int64),
        "box": np.zeros(6),
        "coefficients": np.zeros(0, np.float32),
        "far_bound": np.zeros(0, np.int8),
        **given,
    }


class ToolShape(SceneModel):
    """Shape of a rigid tool in its local frame; sub-classes are tables of a scene."""

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        """Entries of the shape in the tool table, see :func:`shape_entries`.

        Parameters
        ----------
        directory : folder of the scene file, to which mesh files are relative.
        key : scene key of the shape, named in errors.
        blank : points [m] of the blank at the start in the local frame, shape [point_count, 3],
            which are not in the tool; None where they are not known.

        Raises
        ------
        InputError : a shape that cannot be built, or a file that cannot be used.
        """
        raise NotImplementedError

    def surface_mesh(self, directory: Path, blank: np.ndarray | None = None) -> Surface | None:
        """Triangles that define the shape, None for one that needs none.

        Parameters and errors as for :meth:`table_entries`.
        """
        return None

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Triangulate the shape for drawings; normals point away from the solid.

        Parameters
        ----------
        directory, key : as for :meth:`table_entries`.
        reach : length [m] of what is infinite.

        Returns
        -------
        points [m], shape [point_count, 3], and triangles, shape [triangle_count, 3].
        """
        raise NotImplementedError

    def oriented(self, axes: np.ndarray) -> np.ndarray:
        """Local axes that the compiled distance works in, from those of the tool, shape [3, 3]."""
        return axes

    def remarks(self, tool_name: str, edge_length: float, whose: str = "") -> list[str]:
        """Say what is allowed but probably not meant, for elements of an edge length [m].

        whose : the plies that the elements belong to, as in " of the ply patch".
        """
        return []


class ProfileShape(ToolShape):
    """Shape that a plane curve bounds, revolved or extruded."""

    def profile(self, *, key: str) -> Profile:
        """Curve of the shape in its local frame; errors as :meth:`table_entries`."""
        raise NotImplementedError

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        profile = self.profile(key=key)
        return shape_entries(
            REVOLVED if profile.revolved else EXTRUDED,
            segments=profile.segments(),
            corners=profile.corners(),
        )

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        return profile_surface(self.profile(key=key), reach)
