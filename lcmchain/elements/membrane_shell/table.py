"""Scene table of the 2D approach."""

from __future__ import annotations

from typing import ClassVar, Literal

from lcmchain.quantities.scene_model import SceneModel


class MembraneShellElement(SceneModel):
    """Superimposed membrane and shell triangles, the 2D approach; they predict no thickness."""

    has_thickness: ClassVar[bool] = False

    type: Literal["membrane-shell"] = "membrane-shell"
