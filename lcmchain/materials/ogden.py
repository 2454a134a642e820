"""Ogden film: rubber by one to three terms, W = Σ µ_p/α_p (λ1^α_p + λ2^α_p + λ3^α_p - 3).

Adds: a film that keeps its volume and softens, then stiffens, with the stretch. One term with the
exponent 2 is neo-Hooke; exponents 2 and -2 are Mooney-Rivlin.
Source: Ogden, Proc. R. Soc. A 326 (1972) 565. The shear modulus at rest is µ = ½ Σ µ_p α_p. Some
programs write 2 µ_p/α_p² instead: their µ_p are those here times ½ α_p.
How volume and thickness are treated: :mod:`lcmchain.materials.hyperelastic`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

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
from lcmchain.quantities.entry_types import Number, Range, Row, Stiffness, Text, wrong
from lcmchain.quantities.units import split_row

MOST_TERMS = 3
#: Exponents of a term.
EXPONENTS = Range(-30.0, 30.0)
#: Below this square of r/m quotients by r are taken as series: their digits would be lost.
NEARLY_EQUAL = 1e-3


class OgdenLaw(NamedTuple):
    """Shear modulus at rest and bulk modulus [Pa], µ_p [Pa] and α_p of the terms, None without."""

    shear: float
    bulk: float
    mu_1: float
    alpha_1: float
    mu_2: Any = None
    alpha_2: Any = None
    mu_3: Any = None
    alpha_3: Any = None


@equation
def odd_series(b, q):
    """Return ((1 + ρ)^b - (1 - ρ)^b) / (2 ρ) for small q = ρ²."""
    b3 = b * (b - 1.0) * (b - 2.0) / 6.0
    b5 = b3 * (b - 3.0) * (b - 4.0) / 20.0
    b7 = b5 * (b - 5.0) * (b - 6.0) / 42.0
    b9 = b7 * (b - 7.0) * (b - 8.0) / 72.0
    return b + q * (b3 + q * (b5 + q * (b7 + q * b9)))


@equation
def change_series(b, q):
    """Return the sum of 2j binom(b, 2j + 1) q^(j - 1) for small q."""
    b3 = b * (b - 1.0) * (b - 2.0) / 6.0
    b5 = b3 * (b - 3.0) * (b - 4.0) / 20.0
    b7 = b5 * (b - 5.0) * (b - 6.0) / 42.0
    b9 = b7 * (b - 7.0) * (b - 8.0) / 72.0
    b11 = b9 * (b - 9.0) * (b - 10.0) / 110.0
    return 2.0 * b3 + q * (4.0 * b5 + q * (6.0 * b7 + q * (8.0 * b9 + q * (10.0 * b11))))


@equation
def with_ogden_term(total, mu, alpha, m, r2, D):
    """Add the derivatives of µ/α (c1^(α/2) + c2^(α/2) + (c1 c2)^(-α/2)); as it is without a term.

    r2 : r², D : m² - r² = c1 c2.
    """
    if mu is None:
        return total
    b = 0.5 * alpha
    k = 0.5 * mu  # µ/α times b
    q = r2 / (m * m)
    near = q < NEARLY_EQUAL
    r = r2**0.5
    c1, c2 = m + r, m - r
    low1, low2 = c1 ** (b - 2.0), c2 ** (b - 2.0)
    mean, mean2 = k * (low1 * c1 + low2 * c2), k * (b - 1.0) * (low1 + low2)
    if near:
        scale = 2.0 * k * m ** (b - 2.0)
        ratio = scale * odd_series(b - 1.0, q)
        mixed = scale / m * (b - 1.0) * odd_series(b - 2.0, q)
        change = scale / (m * m) * change_series(b - 1.0, q)
    else:
        ratio = k * (low1 * c1 - low2 * c2) / r
        mixed = k * (b - 1.0) * (low1 - low2) / r
        change = (mean2 - ratio) / (r * r)
    power = D ** (-b - 2.0)
    slope, curvature = -k * power * D, k * (b + 1.0) * power
    total = plus_terms(total, PlaneTerms(mean, ratio, mean2, mixed, change))
    return plus_terms(total, of_determinant(m, slope, curvature))


@implements(membrane_response, OgdenLaw)
@equation
def ogden_response(law, E, history):
    C11, C22, C12 = 1.0 + 2.0 * E[0], 1.0 + 2.0 * E[1], E[3]
    m, d, D = 0.5 * (C11 + C22), 0.5 * (C11 - C22), C11 * C22 - C12 * C12
    r2 = d * d + C12 * C12
    terms = PlaneTerms(0.0, 0.0, 0.0, 0.0, 0.0)
    terms = with_ogden_term(terms, law.mu_1, law.alpha_1, m, r2, D)
    terms = with_ogden_term(terms, law.mu_2, law.alpha_2, m, r2, D)
    terms = with_ogden_term(terms, law.mu_3, law.alpha_3, m, r2, D)
    return sheet_response(terms, law.shear, law.bulk, E)


@implements(bending_stiffness, OgdenLaw)
@equation
def ogden_bending(law):
    return sheet_bending(law.shear)


@implements(bending_bound, OgdenLaw)
@equation
def ogden_bending_bound(law):
    return sheet_bending_rows(law.shear)


@implements(hourglass_tangent, OgdenLaw)
@equation
def ogden_stabilising(law, E, C_M, history):
    return sheet_stabilising(law.shear)


class Ogden(Hyperelastic):
    """An Ogden sheet in plain NumPy; see :class:`Hyperelastic`."""

    law: OgdenLaw

    def _energy_of(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        pairs = zip(self.law[2::2], self.law[3::2], strict=True)
        terms = [(mu, 0.5 * alpha) for mu, alpha in pairs if mu is not None]
        return (
            sum(0.5 * mu / b * (c**b - 1.0) for mu, b in terms),
            sum(0.5 * mu * c ** (b - 1.0) for mu, b in terms),
            sum(0.5 * mu * (b - 1.0) * c ** (b - 2.0) for mu, b in terms),
        )


_moduli = Row('"0.63 0.0012 -0.01 MPa"', None, 1, MOST_TERMS, entries="moduli")
_exponents = Row("[1.3, 5.0, -2.0]", None, 1, MOST_TERMS, entries="exponents", units=False)


class OgdenMaterial(HyperelasticMaterial):
    """Ogden film that keeps its volume, of one to three terms."""

    law: Literal["ogden"] = "ogden"
    name: Annotated[str, Text("latex")] = Field(
        default="ogden", description="Name of the material in reports."
    )
    mu: Annotated[tuple[Stiffness, ...], _moduli] = Field(
        description="Moduli µ_p of the terms, one to three; ½ Σ µ_p α_p is the shear modulus."
    )
    alpha: Annotated[tuple[Annotated[float, Number(1.3, EXPONENTS)], ...], _exponents] = Field(
        description="Exponents α_p of the terms; µ_p α_p is above 0 in each."
    )

    @field_validator("mu", "alpha", mode="before")
    @classmethod
    def _take_one(cls, value: object) -> object:
        """Take the value of a single term without brackets."""
        is_one = isinstance(value, int | float) and not isinstance(value, bool)
        is_one |= isinstance(value, str) and split_row(value) is None
        return [value] if is_one else value

    @model_validator(mode="after")
    def _check_terms(self) -> Self:
        if len(self.mu) != len(self.alpha):
            raise wrong(
                f"has {len(self.alpha)} exponents for {len(self.mu)} moduli; give one each",
                field="alpha",
            )
        for index, (mu, alpha) in enumerate(zip(self.mu, self.alpha, strict=True)):
            if not mu * alpha > 0.0:
                raise wrong(
                    f"has {alpha:g} as entry [{index}], whose product with the modulus "
                    f"{1e-6 * mu:g} MPa is not above 0: the film would be unstable; give both the "
                    "same sign",
                    field="alpha",
                )
        return self

    @property
    def shear_modulus_at_rest(self) -> float:
        return 0.5 * sum(mu * alpha for mu, alpha in zip(self.mu, self.alpha, strict=True))

    def build(self) -> Ogden:
        """Return the material."""
        terms = [value for pair in zip(self.mu, self.alpha, strict=True) for value in pair]
        return Ogden(
            OgdenLaw(self.shear_modulus_at_rest, self.bulk, *terms),
            thickness=self.thickness,
            density=self.density,
            name=self.name,
        )
