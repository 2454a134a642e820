"""Scene tables of the permeability laws.

They stand here and not in the package with the laws: that package is built on the core, which holds
the scene and never imports what is built on it.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from lcmchain.quantities.entry_types import POSITIVE, FibreRadius, Number
from lcmchain.quantities.scene_model import SceneModel


class GebartPermeability(SceneModel):
    """Permeability of ordered fibres after Gebart."""

    law: Literal["gebart"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    packing: Literal["quadratic", "hexagonal"] = Field(
        default="quadratic", description="Arrangement of the fibres."
    )


class KozenyCarmanPermeability(SceneModel):
    """Kozeny-Carman permeability K = r²/(4 k) (1 - v)³/v² with one constant per direction."""

    law: Literal["kozeny_carman"]
    fibre_radius: FibreRadius = Field(description="Radius of a single fibre.")
    k_along: Annotated[float, Number(0.6, POSITIVE)] = Field(
        description="Kozeny constant along the fibres, usually 0.5 to 0.7."
    )
    k_across: Annotated[float, Number(15.0, POSITIVE)] = Field(
        description="Kozeny constant across the fibres, usually 11 to 18."
    )


Permeability = Annotated[GebartPermeability | KozenyCarmanPermeability, Field(discriminator="law")]
