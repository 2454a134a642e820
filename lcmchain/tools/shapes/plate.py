"""Infinite plane."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from lcmchain.tools.distance import PLANE
from lcmchain.tools.shapes.base import ToolShape, shape_entries

Side = Literal["below", "above"]


class Plate(ToolShape):
    """Infinite plane z = 0, solid on one side."""

    type: Literal["plate"]
    side: Side = Field(description="Side of the plane that is solid.")

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        return shape_entries(PLANE)

    def oriented(self, axes: np.ndarray) -> np.ndarray:
        # The distance takes local z as the outward normal.
        return np.diag([1.0, -1.0, -1.0]) @ axes if self.side == "above" else axes

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        points = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        return points, faces if self.side == "below" else faces[:, ::-1]
