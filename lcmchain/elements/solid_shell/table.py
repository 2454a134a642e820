"""Scene table of the solid-shell."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from lcmchain.quantities.entry_types import AbsentMeans, Number, Range, Switch
from lcmchain.quantities.scene_model import SceneModel


class Element(SceneModel):
    """The solid-shell of the paper's section 2, and the choices in it."""

    has_thickness: ClassVar[bool] = True

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
        AbsentMeans("the fibres' bending stiffness C^B"),
    ] = Field(
        default=None,
        description="Stiffness of the fibres in the in-plane hourglass terms: their bending "
        "stiffness, or this share of their membrane stiffness; 1 as published locks the tools' "
        "forces.",
    )
    in_plane_shear_hourglass: Switch = Field(
        default=True, description="Keep the in-plane shear row in the hourglass stabilisation."
    )
