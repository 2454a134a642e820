"""What the scene tables of material laws share: all of them, and those of fabrics.

All tell what their law knows; fabrics also share their mass, their compaction, and checks of both.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from lcmchain.materials.law import Material
from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    Number,
    PositiveStiffness,
    Range,
    SceneModel,
    wrong,
)


class MaterialTable(SceneModel):
    """Base of the tables that ``[material]`` can be: all have ``law``, ``name`` and ``thickness``.

    families : types of elements that the law serves. has_fibres : whether it tells stiff fibres
    from the rest. has_directions : whether its axes mean anything, as those of fibres do.
    """

    families: ClassVar[tuple[str, ...]] = ("solid-shell",)
    has_fibres: ClassVar[bool] = False
    has_directions: ClassVar[bool] = True

    @classmethod
    def law_name(cls) -> str:
        """Return the ``law`` that chooses this table."""
        return cls.model_fields["law"].default

    def build(self) -> Material:
        """Return the law with the constants of the sheet."""
        raise NotImplementedError

    @property
    def compacts(self) -> bool:
        """Whether the stiffness over the thickness grows with the compaction."""
        return False

    @property
    def couples_shear(self) -> bool:
        """Whether the thickness depends on the shear."""
        return False

    @property
    def remembers(self) -> bool:
        """Whether the law has a memory."""
        return False

    @property
    def resists_rates(self) -> bool:
        """Whether a stress depends on a rate."""
        return False

    @property
    def resists_shear_rates(self) -> bool:
        """Whether the shear depends on its rate."""
        return False

    @property
    def shear_rubs(self) -> bool:
        """Whether there is friction in the shear."""
        return False

    @property
    def bending_rubs(self) -> bool:
        """Whether there is friction in the bending."""
        return False

    @property
    def bending_resists_rates(self) -> bool:
        """Whether the bending depends on its rate."""
        return False

    @property
    def relaxes(self) -> bool:
        """Whether the compaction relaxes."""
        return False

    @property
    def temperature_varies(self) -> bool:
        """Whether the temperature differs over the blank."""
        return False

    @property
    def locks(self) -> bool:
        """Whether the fabric locks in shear."""
        return False

    @property
    def bends_in_plane(self) -> bool:
        """Whether fibres resist bending within the plane."""
        return False

    @property
    def fibre_angles(self) -> tuple[float, ...]:
        """Angles of the families of fibres from the first axis of the ply [rad]."""
        return (0.0, 0.5 * math.pi)

    @property
    def is_biaxial(self) -> bool:
        """Whether fibres lie along both axes of the ply, so that a net can be laid along them."""
        return self.fibre_angles == (0.0, 0.5 * math.pi)

    def remarks(self) -> list[str]:
        """Return what is allowed but probably not meant, a sentence each."""
        return []


# --- fabrics --------------------------------------------------------------------------------------


class ExponentialCompaction(SceneModel):
    """Compaction stiffness C33 = c0 exp(c1 |E33|^c2) (paper Eq. (23))."""

    c0: PositiveStiffness = Field(description="Stiffness of the undeformed fabric.")
    c1: Annotated[float, Number(60.4653, NOT_NEGATIVE)] = Field(description="Growth factor.")
    c2: Annotated[float, Number(2.4528, Range(1.0, 10.0))] = Field(description="Growth exponent.")

    @model_validator(mode="after")
    def _check_growth(self) -> Self:
        # E33 = -1/2 is the strain of a thickness of zero.
        if self.c1 * 0.5**self.c2 > 200.0:
            raise wrong(
                f"together with c2 = {self.c2:g} lets the stiffness grow by "
                f"exp({self.c1 * 0.5**self.c2:.0f}) up to full compaction, which cannot be "
                "computed; check both exponents (MD600: c1 = 60.4653, c2 = 2.4528)",
                field="c1",
            )
        return self


class FabricTable(MaterialTable):
    """Base of the tables of fabrics, which state the entries below in an order of their own."""

    has_fibres: ClassVar[bool] = True

    if TYPE_CHECKING:
        thickness: float
        areal_mass: float
        fibre_density: float
        compaction: Any
        bending: Any

    @model_validator(mode="after")
    def _check_fibre_volume_fraction(self) -> Self:
        if self.fibre_volume_fraction >= 1.0:
            raise wrong(
                f"gives a fibre volume fraction of {self.fibre_volume_fraction:.2f}, more than all "
                "space: check areal_mass, fibre_density and thickness",
                field="areal_mass",
            )
        return self

    @property
    def compacts(self) -> bool:
        return self.compaction.c1 > 0.0

    @property
    def bends_in_plane(self) -> bool:
        return self.bending.in_plane > 0.0

    def without_compaction(self) -> Self:
        """Return the fabric with the thickness stiffness of the undeformed one."""
        return self._with("compaction", c1=0.0)

    def without_in_plane_bending(self) -> Self:
        """Return the fabric whose fibres have no stiffness against bending within the plane."""
        return self._with("bending", in_plane=0.0)

    def _with(self, table: str, /, **entries: object) -> Self:
        return self.model_copy(update={table: getattr(self, table).model_copy(update=entries)})

    @property
    def density(self) -> float:
        """Mass per volume of the unloaded fabric [kg/m³], areal mass over thickness."""
        return self.areal_mass / self.thickness

    @property
    def fibre_volume_fraction(self) -> float:
        """Fibre volume fraction of the unloaded fabric [1]."""
        return self.areal_mass / (self.fibre_density * self.thickness)

    def remarks(self) -> list[str]:
        if self.fibre_volume_fraction <= 0.9:
            return []
        return [
            f"the fibre volume fraction of the unloaded fabric is {self.fibre_volume_fraction:.2f},"
            " more than fibres can be packed to"
        ]
