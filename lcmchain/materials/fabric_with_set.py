"""Fabric that does not spring back all the way: hysteresis of compaction by a permanent set.

A dry textile that was compacted keeps part of the compaction: its fibres have slid and nested.
While it is compacted it obeys the law of :mod:`lcmchain.materials.fabric`. On the way back its
strain is counted from a set, the share s of the largest compaction κ = min E33 so far,

    S33 = C33(E') E',  E' = (E33 - s κ) / (1 - s)  for E33 < s κ,  E' = E33 - s κ  above,

so that the curve starts where the loading has ended (E' = κ at E33 = κ) and reaches zero stress at
the set. The stored energy is (1 - s) W33(E'), the lost energy s W33(κ): together the work of the
loading. One number is remembered, κ. The tangent is that of the way back also while κ grows, since
small vibrations about a state go back and forth. Where the thickness depends on the shear, all
strains are those that the compaction law sees (:mod:`.features.shear_compaction`).

Source: the phenomenon, Robitaille and Gauvin, "Compaction of textile reinforcements for composites
manufacturing. II", Polymer Composites 19 (1998). The form is the simplest one that dissipates and
is not fitted to tests: ``permanent_set`` has no default.

This file is the example of the manual's page "Extending": a law with memory, added in one file.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from lcmchain.jit import equation
from lcmchain.materials.fabric import (
    Fabric,
    FabricCompaction,
    FabricLaw,
    FabricMaterial,
    evolved_shear,
    fabric_bending_stiffness,
    name_twins,
    with_shear_losses,
)
from lcmchain.materials.features.compaction import (
    compaction_stress_and_tangent,
    compaction_tangent_curvature,
    compaction_tangent_slope,
)
from lcmchain.materials.features.shear import (
    shear_stress_and_tangent,
    stabilising_shear_curvature,
    stabilising_shear_slope,
    stabilising_shear_tangent,
)
from lcmchain.materials.features.shear_compaction import (
    curvature_at_shear,
    shear_tangents,
    slope_at_shear,
    stabilising_at_shear,
    strain_of,
    thickening,
    with_thickening,
)
from lcmchain.materials.law import (
    Remembered,
    bending_stiffness,
    evolved_history,
    hourglass_tangent,
    implements,
    membrane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.quantities.entry_types import Number, Range, wrong

FabricWithSetLaw = NamedTuple(
    "FabricWithSetLaw",
    [*FabricLaw.__annotations__.items(), ("permanent_set", float)],  # type: ignore[misc]
)
FabricWithSetLaw.__doc__ = "Parameters of :class:`FabricLaw` and the share ``permanent_set``."
FabricWithSetLaw.remembers = (  # type: ignore[attr-defined]
    Remembered("largest_compaction_strain", "1", "normal strain E33 where the fabric was thinnest"),
)


@equation
def strain_from_set(law, E33, history):
    """Return E', its derivative with E33 for a given path, and the stiffening of the way back."""
    above = E33 - law.permanent_set * min(E33, history[0])
    stiffening = 1.0 / (1.0 - law.permanent_set) if above < 0.0 else 1.0
    rate = stiffening if E33 > history[0] else 1.0
    return stiffening * above, rate, stiffening


@equation
def slope_from_set(law, E33, history):
    """Return dC33/dE33 of the way back, the strain being that which the compaction law sees."""
    strain, rate, stiffening = strain_from_set(law, E33, history)
    return stiffening * rate * compaction_tangent_slope(law, strain)


@equation
def curvature_from_set(law, E33, history):
    """Return d²C33/dE33² of the way back."""
    strain, rate, stiffening = strain_from_set(law, E33, history)
    return stiffening * rate * rate * compaction_tangent_curvature(law, strain)


@implements(membrane_response, FabricWithSetLaw)
@equation
def response(law, E, history):
    sheared = thickening(law, E[2], E[3])
    strain, _, stiffening = strain_from_set(law, strain_of(sheared, E[2]), history)
    elastic, C12 = shear_stress_and_tangent(law, E[3])
    S33, C33 = compaction_stress_and_tangent(law, strain)
    S33, C33, S12, C12 = with_thickening(sheared, S33, stiffening * C33, elastic, C12)
    S12, C12 = with_shear_losses(law, S12, C12, E[3], elastic, history)
    S = (law.C11 * E[0], law.C22 * E[1], S33, S12, law.C23 * E[4], law.C13 * E[5])
    return S, (law.C11, law.C22, C33, C12, law.C23, law.C13)


@equation
def way_back_slope(sheared, law, E33, history):
    """Return dC33/dE33 of the way back."""
    if sheared is None:
        return slope_from_set(law, E33, history)
    return slope_at_shear(sheared, slope_from_set(law, sheared.strain, history))


@equation
def way_back_curvature(sheared, law, E33, history):
    """Return d²C33/dE33² of the way back."""
    if sheared is None:
        return curvature_from_set(law, E33, history)
    slope33 = slope_from_set(law, sheared.strain, history)
    return curvature_at_shear(sheared, slope33, curvature_from_set(law, sheared.strain, history))


@equation
def coupling_from_set(sheared, law, history):
    """Return the answer of ``tangent_coupling`` on the way back."""
    if sheared is None:
        return None
    strain, _, stiffening = strain_from_set(law, sheared.strain, history)
    S33, C33 = compaction_stress_and_tangent(law, strain)
    slope33 = slope_from_set(law, sheared.strain, history)
    curvature33 = curvature_from_set(law, sheared.strain, history)
    return shear_tangents(sheared, S33, stiffening * C33, slope33, curvature33)


@implements(tangent_slope, FabricWithSetLaw)
@equation
def slope(law, E, history):
    sheared = thickening(law, E[2], E[3])
    slope33 = way_back_slope(sheared, law, E[2], history)
    return (None, None, slope33, stabilising_shear_slope(law, E[3]), None, None)


@implements(tangent_curvature, FabricWithSetLaw)
@equation
def curvature(law, E, history):
    sheared = thickening(law, E[2], E[3])
    curvature33 = way_back_curvature(sheared, law, E[2], history)
    return (None, None, curvature33, stabilising_shear_curvature(law, E[3]), None, None)


@implements(tangent_coupling, FabricWithSetLaw)
@equation
def coupling(law, E, history):
    return coupling_from_set(thickening(law, E[2], E[3]), law, history)


@equation
def way_back_stabilising(sheared, law, C33, history):
    """Return the stabilising C33 of the way back of a law whose own is C33."""
    if sheared is None:
        return C33
    strain, _, stiffening = strain_from_set(law, sheared.strain, history)
    seen = stiffening * compaction_stress_and_tangent(law, strain)[1]
    return stabilising_at_shear(sheared, C33, seen)


@implements(hourglass_tangent, FabricWithSetLaw)
@equation
def stabilising(law, E, C_M, history):
    C33 = way_back_stabilising(thickening(law, E[2], E[3]), law, C_M[2], history)
    return (C_M[0], C_M[1], C33, stabilising_shear_tangent(law, E[3]), C_M[4], C_M[5])


@implements(evolved_history, FabricWithSetLaw)
@equation
def evolved(law, E, history):
    most = min(strain_of(thickening(law, E[2], E[3]), E[2]), history[0])
    return (most, *evolved_shear(law, E[3], history))


implements(bending_stiffness, FabricWithSetLaw)(fabric_bending_stiffness)

name_twins(FabricWithSetLaw, globals())


class FabricWithSet(Fabric):
    """A fabric with a permanent set; ``permanent_set`` is its share of the most compaction."""

    law: Any  # of class FabricWithSetLaw

    def __init__(self, law: FabricLaw, permanent_set: float, **sheet: Any) -> None:
        super().__init__(FabricWithSetLaw(*law, permanent_set), **sheet)  # type: ignore[arg-type, call-arg]

    def _compaction(self, E33):
        S33, C33 = super()._compaction(E33)
        return S33, C33 * self._strain_from_set(E33)[1]

    def _compaction_slope(self, E33):
        return super()._compaction_slope(E33) * self._strain_from_set(E33)[1]

    def _compaction_curvature(self, E33):
        return super()._compaction_curvature(E33) * self._strain_from_set(E33)[1]

    def membrane_energy(self, E: ArrayLike, history: np.ndarray | None = None) -> np.ndarray:
        """Return W^M [J/m³], with the stored part of the compaction in place of W33."""
        strain, stiffening = self._strain_from_set(self._seen(np.asarray(E, dtype=float)), history)
        stored = self._compaction_energy(strain) / stiffening
        return self._energy_in_plane(E) + stored + self._remembered_energy(history)

    def dissipated_energy(self, history: np.ndarray) -> np.ndarray:
        """Return s W33(κ) and what friction has taken [J/m³]."""
        set_in = self.law.permanent_set * self._compaction_energy(history[0])
        return set_in + super().dissipated_energy(history)

    def _pressure(self, stretch: np.ndarray, history: np.ndarray | None) -> np.ndarray:
        strain, _ = self._strain_from_set(0.5 * (stretch**2 - 1.0), history)
        stress, _ = self._compaction(strain)
        return np.where(stress < 0.0, -stretch * stress, 0.0)

    def _strain_from_set(self, E33, history=None):
        """Return E' and the stiffening of the way back; without a history in first loading."""
        most = np.minimum(E33, 0.0 if history is None else history[0])
        above = E33 - self.law.permanent_set * most
        stiffening = np.where(above < 0.0, 1.0 / (1.0 - self.law.permanent_set), 1.0)
        return stiffening * above, stiffening


# --- scene ----------------------------------------------------------------------------------------


class CompactionWithSet(FabricCompaction):
    """Compaction stiffness C33 = c0 exp(c1 |E33|^c2) (paper Eq. (23)), and what remains of it."""

    permanent_set: Annotated[float, Number(0.3, Range(0.0, 1.0, (1.0,)))] = Field(
        description="Share of the largest compaction strain that remains when the load is gone."
    )


class FabricWithSetMaterial(FabricMaterial):
    """Fabric whose compaction leaves a permanent set."""

    families: ClassVar[tuple[str, ...]] = ("solid-shell", "kinematic")

    law: Literal["fabric-with-set"] = "fabric-with-set"  # type: ignore[assignment]
    compaction: CompactionWithSet

    @model_validator(mode="after")
    def _check_relaxation(self) -> Self:
        if self.relaxes:
            raise wrong(
                "lets a compaction relax that leaves a set, of which no law is known; leave it "
                'out, or use law = "fabric"',
                field="viscous.compaction",
            )
        return self

    def build(self) -> FabricWithSet:
        return FabricWithSet(
            self.law_parameters(),
            self.compaction.permanent_set,
            **self.sheet_parameters(),
        )

    @property
    def remembers(self) -> bool:
        return True

    def without_memory(self) -> FabricMaterial:
        """Return the fabric that leaves no set."""
        compaction = dict(self.compaction)
        compaction.pop("permanent_set")
        entries = dict(self) | {"law": "fabric", "compaction": FabricCompaction(**compaction)}
        return FabricMaterial(**entries)
