"""Friction between yarns at their crossings: tension makes a fabric harder to shear.

A law outside the package, made from its public parts: importing this file registers it. To the
shear stress of the fabric comes what the crossings bear by friction. It grows with the shear by a
stiffness k, up to a limit that goes with the tension of both families,

    τ <- clip(τ + k Δg, -L, L),   L = m (<S11> + <S22>),   S12 += τ,

with g = 2 E12, the share m and <x> = max(x, 0). Stored is τ²/(2 k); lost is the work of τ, by the
mean of two steps, less what is stored more. As friction does, the tension changes the shear stress,
but the shear does not change the tension: no potential could do that. A potential with the same
effect would have the fibres shorten as the fabric is sheared, by m g under constant tension.

Step: k comes to the shear tangent, always. S12 changes with the fibre strains too where crossings
slide, but not the other way round: that leaves the frequencies of a step as they are. The
hourglass terms know nothing of the crossings.

Source: that tension makes woven fabric harder to shear, Harrison, Abdiwi, Guo, Potluri, Yu,
"Characterising the shear-tension coupling and wrinkling behaviour of woven engineering fabrics",
Composites Part A 43 (2012) 903-914. The form is Coulomb's, its numbers are nobody's.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from lcmchain.jit import equation
from lcmchain.materials.fabric import (
    Fabric,
    FabricLaw,
    FabricMaterial,
    fabric_bending_stiffness,
    fabric_hourglass_tangent,
    fabric_response,
    fabric_tangent_curvature,
    fabric_tangent_slope,
)
from lcmchain.materials.law import (
    Remembered,
    bending_stiffness,
    evolved_history,
    hourglass_tangent,
    implements,
    membrane_response,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.quantities.entry_types import NOT_NEGATIVE, Number, PositiveStiffness
from lcmchain.scene.presets import PRESETS

CrossingLaw = NamedTuple(
    "CrossingLaw",
    [*FabricLaw.__annotations__.items(), ("share", float), ("stiffness", float)],  # type: ignore[misc]
)
CrossingLaw.__doc__ = "Parameters of ``FabricLaw``, the share m and the stiffness k [Pa]."
CrossingLaw.remembers = (  # type: ignore[attr-defined]
    Remembered("crossing_shear_before", "1", "shear strain 2 E12 at the end of the step before"),
    Remembered("crossing_stress", "Pa", "part of S12 that friction at the crossings bears"),
    Remembered("crossing_loss", "J/m3", "energy lost to friction at the crossings, per volume"),
)


# --- compiled -------------------------------------------------------------------------------------


@equation
def crossing_stress(law, E, history):
    """Return τ at the end of a step to E."""
    tension = law.C11 * max(E[0], 0.0) + law.C22 * max(E[1], 0.0)
    limit = law.share * tension
    trial = history[1] + law.stiffness * (E[3] - history[0])
    return min(max(trial, -limit), limit)


@implements(membrane_response, CrossingLaw)
@equation
def response(law, E, history):
    S, C = fabric_response(law, E, history)
    stress = crossing_stress(law, E, history)
    return (
        (S[0], S[1], S[2], S[3] + stress, S[4], S[5]),
        (C[0], C[1], C[2], C[3] + law.stiffness, C[4], C[5]),
    )


@implements(evolved_history, CrossingLaw)
@equation
def evolved(law, E, history):
    stress = crossing_stress(law, E, history)
    work = 0.5 * (history[1] + stress) * (E[3] - history[0])
    stored_more = (stress * stress - history[1] * history[1]) / (2.0 * law.stiffness)
    return (E[3], stress, history[2] + work - stored_more)


implements(bending_stiffness, CrossingLaw)(fabric_bending_stiffness)
implements(hourglass_tangent, CrossingLaw)(fabric_hourglass_tangent)
implements(tangent_slope, CrossingLaw)(fabric_tangent_slope)
implements(tangent_curvature, CrossingLaw)(fabric_tangent_curvature)


# --- plain Python ---------------------------------------------------------------------------------


class CrossingFabric(Fabric):
    """A fabric with friction at its crossings, in plain NumPy."""

    law: Any  # of class CrossingLaw

    def __init__(self, law: FabricLaw, share: float, stiffness: float, **sheet: Any) -> None:
        super().__init__(CrossingLaw(*law, share, stiffness), **sheet)  # type: ignore[arg-type, call-arg]

    def limit(self, E: ArrayLike) -> np.ndarray:
        """Return the most that the crossings bear [Pa] at strains E (..., 6)."""
        tension = np.maximum(np.asarray(E)[..., :2], 0.0) @ [self.law.C11, self.law.C22]
        return self.law.share * tension

    def stress_and_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M and C^M of a fabric whose crossings bear nothing yet."""
        S, C = super().stress_and_tangent(E)
        C[..., 3, 3] += self.law.stiffness
        return S, C

    def membrane_energy(self, E: ArrayLike, history: np.ndarray | None = None) -> np.ndarray:
        """Return W^M [J/m³], with what the crossings store."""
        stored = 0.0 if history is None else history[1] ** 2 / (2.0 * self.law.stiffness)
        return super().membrane_energy(E) + stored

    def dissipated_energy(self, history: np.ndarray) -> np.ndarray:
        """Return what friction at the crossings has taken [J/m³]."""
        return history[2]


class CrossingMaterial(FabricMaterial):
    """The fabric of a scene with friction at its crossings; Python alone can give it."""

    families: ClassVar[tuple[str, ...]] = ("solid-shell",)

    share: Annotated[float, Number(0.05, NOT_NEGATIVE)] = Field(
        description="Shear stress that the crossings bear, over the sum of both tensions."
    )
    stiffness: PositiveStiffness = Field(description="Of crossings that do not slide, in shear.")

    def build(self) -> CrossingFabric:
        return CrossingFabric(
            self.law_parameters(), self.share, self.stiffness, **self.sheet_parameters()
        )

    @property
    def remembers(self) -> bool:
        return True


def rubbing_md600() -> CrossingMaterial:
    """Return MD600 with friction at crossings, which no fabric gave its numbers."""
    entries = {key: value for key, value in PRESETS["MD600"].items() if key != "law"}
    return CrossingMaterial(**entries, share=0.05, stiffness="2 MPa")
