"""Neo-Hookean film: rubber by one shear modulus, W = μ/2 (λ1² + λ2² + λ3² - 3).

Adds: a film that keeps its volume, for diaphragms and bags of silicone or rubber. Right up to
stretches of about 1.5; beyond, rubbers are softer and then stiffer (:mod:`.ogden`).
Source: Treloar, Trans. Faraday Soc. 39 (1943) 36; Rivlin, Phil. Trans. A 240 (1948) 459.
How volume and thickness are treated: :mod:`lcmchain.materials.hyperelastic`.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from lcmchain.jit import equation
from lcmchain.materials.hyperelastic import (
    Hyperelastic,
    HyperelasticMaterial,
    PlaneTerms,
    of_determinant,
    plus_terms,
    sheet_bending,
    sheet_bending_rows,
    sheet_response,
    sheet_stabilising,
)
from lcmchain.materials.law import (
    bending_bound,
    bending_stiffness,
    hourglass_tangent,
    implements,
    membrane_response,
)
from lcmchain.quantities.entry_types import Modulus, Text


class NeoHookeLaw(NamedTuple):
    """Shear modulus μ and bulk modulus K [Pa]."""

    shear: float
    bulk: float


@equation
def neo_hooke_terms(shear, E):
    """Return the derivatives of μ/2 (c1 + c2 + 1/(c1 c2) - 3)."""
    C11, C22, C12 = 1.0 + 2.0 * E[0], 1.0 + 2.0 * E[1], E[3]
    m, inverse = 0.5 * (C11 + C22), 1.0 / (C11 * C22 - C12 * C12)
    slope = -0.5 * shear * inverse * inverse
    return plus_terms(
        PlaneTerms(shear, 0.0, 0.0, 0.0, 0.0),
        of_determinant(m, slope, -2.0 * slope * inverse),
    )


@implements(membrane_response, NeoHookeLaw)
@equation
def neo_hooke_response(law, E, history):
    return sheet_response(neo_hooke_terms(law.shear, E), law.shear, law.bulk, E)


@implements(bending_stiffness, NeoHookeLaw)
@equation
def neo_hooke_bending(law):
    return sheet_bending(law.shear)


@implements(bending_bound, NeoHookeLaw)
@equation
def neo_hooke_bending_bound(law):
    return sheet_bending_rows(law.shear)


@implements(hourglass_tangent, NeoHookeLaw)
@equation
def neo_hooke_stabilising(law, E, C_M, history):
    return sheet_stabilising(law.shear)


class NeoHooke(Hyperelastic):
    """A neo-Hookean sheet in plain NumPy; see :class:`Hyperelastic`."""

    def _energy_of(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        half = 0.5 * self.law.shear
        return half * (c - 1.0), half * np.ones_like(c), np.zeros_like(c)


class NeoHookeMaterial(HyperelasticMaterial):
    """Neo-Hookean film that keeps its volume."""

    law: Literal["neo-hooke"] = "neo-hooke"
    name: Annotated[str, Text("silicone")] = Field(
        default="neo-hooke", description="Name of the material in reports."
    )
    shear_modulus: Modulus = Field(
        description="Shear modulus µ, a third of the initial modulus of elasticity."
    )

    @property
    def shear_modulus_at_rest(self) -> float:
        return self.shear_modulus

    def build(self) -> NeoHooke:
        """Return the material."""
        return NeoHooke(
            NeoHookeLaw(self.shear_modulus, self.bulk),
            thickness=self.thickness,
            density=self.density,
            name=self.name,
        )
