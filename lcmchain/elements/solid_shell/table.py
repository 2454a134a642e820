"""Scene table of the solid-shell."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from lcmchain.quantities.entry_types import AbsentMeans, Number, Range, SceneModel, Switch, wrong


class Element(SceneModel):
    """The solid-shell of the paper's section 2, and the choices in it."""

    has_thickness: ClassVar[bool] = True
    has_forces: ClassVar[bool] = True
    remarks: ClassVar[tuple[str, ...]] = ()

    type: Literal["solid-shell"] = "solid-shell"
    integration_points: Annotated[int, Number(3, Range(2, 7), whole=True)] = Field(
        default=3, description="Integration points over the thickness."
    )
    compaction_strain: Literal["normal", "director"] = Field(
        default="normal",
        description="Compaction measured by the normal thickness, or by the length of the "
        "director as published (which collapses on small radii).",
    )
    cross_terms: Switch = Field(
        default=False,
        description="Keep the cross terms of Eqs. (15) and (19) as printed: where membrane and "
        "bending stiffness differ they have no potential and feed energy to a limp sheet.",
    )
    hourglass: Literal["conservative", "published"] = Field(
        default="conservative",
        description="Derive the hourglass forces from an energy, or take Eq. (16) as printed.",
    )
    fibre_hourglass: Annotated[
        Annotated[float, Number(1.0, Range(0.0, 1.0, (0.0,)))] | None,
        AbsentMeans("that of strips as wide as the fabric is thick"),
    ] = Field(
        default=None,
        description="Share of the fibre stiffness in the in-plane hourglass terms, by which "
        "elements bend their fibres within the plane: a regularisation, no measured property; 1 as "
        "published locks the tools' forces on coarse meshes.",
    )
    bending_thickness: Literal["current", "reference"] = Field(
        default="current",
        description="Thickness that the bending stiffness goes with: the present one as published, "
        "or the initial one, at which C^B was identified.",
    )
    in_plane_shear_hourglass: Switch = Field(
        default=True, description="Keep the in-plane shear row in the hourglass stabilisation."
    )

    _enhanced_strain: bool | None = PrivateAttr(default=None)

    @property
    def enhanced_strain(self) -> bool | None:
        """Whether the enhanced strain was asked for; None leaves it to material and mesh."""
        return self._enhanced_strain

    def with_enhanced_strain(self, there: bool) -> Self:
        """Return the choices with the enhanced strain, or without it, whatever calls for it."""
        changed = self.model_copy()
        changed._enhanced_strain = there
        return changed

    @model_validator(mode="after")
    def _check_bending(self) -> Self:
        if self.cross_terms and self.bending_thickness == "reference":
            raise wrong(
                'is "reference", which is derived from an energy; the cross terms have none: leave '
                "out one of them",
                field="bending_thickness",
            )
        return self
