"""Scene table of the 2D approach."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field

from lcmchain.quantities.entry_types import SceneModel, Switch


class MembraneShellElement(SceneModel):
    """Superimposed membrane and shell triangles, the 2D approach; they predict no thickness."""

    has_thickness: ClassVar[bool] = False
    has_forces: ClassVar[bool] = True

    type: Literal["membrane-shell"] = "membrane-shell"
    bending: Switch = Field(
        default=True,
        description="The shell part; without it the sheet is a membrane that folds at no cost.",
    )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the elements cannot predict, beside the thickness."""
        if self.bending:
            return ()
        return (
            "element.bending = false folds at no cost: neither where wrinkles come nor how large "
            "they are is predicted, and folds are as short as the elements",
        )

    def without_bending(self) -> Self:
        """Return triangles that are membranes alone."""
        return self.model_copy(update={"bending": False})
