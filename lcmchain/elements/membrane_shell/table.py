"""Scene table of the 2D approach."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import PrivateAttr

from lcmchain.quantities.scene_model import SceneModel


class MembraneShellElement(SceneModel):
    """Superimposed membrane and shell triangles, the 2D approach; they predict no thickness."""

    has_thickness: ClassVar[bool] = False

    type: Literal["membrane-shell"] = "membrane-shell"

    _bends: bool = PrivateAttr(default=True)

    @property
    def bends(self) -> bool:
        """Whether the triangles resist bending."""
        return self._bends

    def without_bending(self) -> Self:
        """Return triangles that are membranes alone."""
        changed = self.model_copy()
        changed._bends = False
        return changed
