"""Scene table of a drawing that gives the contours of a blank."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from lcmchain.mesh.contours import Drawn
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FileName,
    LengthUnit,
    PositiveLength,
    SceneModel,
    Text,
)


class Drawing(SceneModel):
    """Contours of a blank from a DXF file: the outermost is the outline, those inside are holes."""

    file: Annotated[str, FileName("part.dxf")] = Field(
        description="DXF file, text or binary; relative to the scene file."
    )
    layer: Annotated[Annotated[str, Text("CUT")] | None, AbsentMeans("all layers")] = Field(
        default=None,
        description="Layer of the outline and the holes; left out, all but slit_layer.",
    )
    slit_layer: Annotated[Annotated[str, Text("SLIT")] | None, AbsentMeans("no slits")] = Field(
        default=None, description="Layer whose open lines are slits."
    )
    length_unit: Annotated[
        Annotated[str, LengthUnit()] | None, AbsentMeans("that of the drawing")
    ] = Field(
        default=None,
        description="Unit of the coordinates; it goes before that of the drawing (INSUNITS).",
    )
    sagitta: PositiveLength = Field(  # type: ignore[assignment]
        default="0.02 mm",
        description="Largest distance of an arc or curve from the straight sides in its place.",
    )
    gap: PositiveLength = Field(  # type: ignore[assignment]
        default="0.01 mm", description="Ends of lines and arcs that are nearer are joined."
    )

    def read(self, directory: Path) -> Drawn:
        """Read the drawing; errors as :func:`lcmchain.mesh.dxf.read_drawing`."""
        # Imported where a blank is drawn: the library takes longer than other scenes do.
        from lcmchain.mesh.dxf import read_drawing

        return read_drawing(
            Path(directory) / self.file,
            layer=self.layer,
            slit_layer=self.slit_layer,
            length_unit=self.length_unit,
            sagitta=self.sagitta,
            gap=self.gap,
        )
