"""Surface mesh from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FileName,
    LengthUnit,
    PositiveLength,
    Switch,
)
from lcmchain.quantities.units import length_factor
from lcmchain.tools.distance import FIELD
from lcmchain.tools.shapes.base import ToolShape, shape_entries
from lcmchain.tools.surfaces.surface import Surface


class SurfaceMesh(ToolShape):
    """Closed or open surface from a file, turned into a distance field."""

    type: Literal["surface_mesh"]
    file: Annotated[str, FileName("punch.stl")] = Field(
        description="STL, a deck, or any other mesh file; relative to the scene file."
    )
    length_unit: Annotated[str, LengthUnit()] = Field(
        description="Unit of the coordinates in the file."
    )
    spacing: Annotated[PositiveLength | None, AbsentMeans("automatic")] = Field(
        default=None, description="Grid spacing of the distance field."
    )

    union: Switch = Field(
        default=False,
        description="Unite closed solids of the file that overlap or touch; only the outer "
        "surface of the whole counts. Needs lcmchain[union].",
    )

    @property
    def length_scale(self) -> float:
        """Metres per unit of the file."""
        return length_factor(self.length_unit)

    def surface_mesh(self, directory: Path, blank: np.ndarray | None = None) -> Surface:
        # Imported where a tool is a file: what these need of scipy takes as long as other scenes
        # take to be read.
        from lcmchain.tools.surfaces.reading import read_surface

        path = Path(directory) / self.file
        return read_surface(path, self.length_unit, blank, union=self.union)

    def table_entries(
        self, directory: Path, *, key: str, blank: np.ndarray | None = None
    ) -> dict[str, Any]:
        from lcmchain.tools.surfaces.distance_field import build_distance_field

        try:
            surface = self.surface_mesh(directory, blank)
        except InputError as error:
            text = f"{error.file}: {error.message}"
            raise InputError(text, key=f"{key}.file", file=error.file) from None
        field = build_distance_field(surface, self.spacing, key=key)
        return shape_entries(
            FIELD,
            spacing=field.spacing,
            grid_origin=field.origin,
            grid_shape=np.array(field.shape),
            box=field.box,
            coefficients=field.coefficients.ravel(),
            far_bound=field.far_bound.ravel(),
        )

    def surface(self, directory: Path, reach: float, *, key: str) -> tuple[np.ndarray, np.ndarray]:
        surface = self.surface_mesh(directory)
        return surface.points, surface.triangles
