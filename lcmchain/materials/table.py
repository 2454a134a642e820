"""What the scene table of every material law offers beside its entries."""

from __future__ import annotations

import math
from typing import ClassVar

from lcmchain.materials.law import Material
from lcmchain.quantities.scene_model import SceneModel


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
        """Whether the thickness knows the shear."""
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
        """Whether sheared fabric rubs on itself."""
        return False

    @property
    def bending_rubs(self) -> bool:
        """Whether fibres that are bent rub on each other."""
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
        """Say what is allowed but probably not meant."""
        return []
