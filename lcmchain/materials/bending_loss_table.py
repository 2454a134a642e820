"""Scene tables of what the bending of a fabric loses: ``friction_1``, ``viscous_1`` and so on."""

from __future__ import annotations

from pydantic import Field

from lcmchain.materials.bending_losses import BendingLosses, DirectionLosses
from lcmchain.materials.dahl import Friction
from lcmchain.materials.maxwell import Relaxation
from lcmchain.materials.viscous_table import RateTable
from lcmchain.quantities.entry_types import PositiveCurvature, PositiveForce
from lcmchain.quantities.scene_model import SceneModel


class BendingFrictionTable(SceneModel):
    """Friction between bent fibres (Dahl): what is bent back follows another path."""

    moment: PositiveForce = Field(
        description="Limit of the friction's moment per width [N m/m]: half the width of a loop of "
        "moment over curvature, Kawabata's HB."
    )
    curvature: PositiveCurvature = Field(
        description="Curvature over which the friction comes to 63 % of its limit."
    )

    @property
    def friction(self) -> Friction:
        return Friction(self.moment, self.curvature)


class BendingRateTable(RateTable):
    """What resists the rate of bending: a dashpot, and Maxwell elements beside it.

    Moduli and viscosities are of the same kind as the bending stiffness C11.
    """


def bending_losses(
    frictions: tuple[BendingFrictionTable | None, BendingFrictionTable | None],
    rates: tuple[BendingRateTable | None, BendingRateTable | None],
    thickness: float,
) -> BendingLosses | None:
    """Return what a fabric of a thickness [m] loses along its fibres 1 and 2; None for nothing."""
    if not any(frictions) and not any(rates):
        return None
    inertia = thickness**3 / 12.0
    first, second = (
        _of_direction(friction, rate, inertia)
        for friction, rate in zip(frictions, rates, strict=True)
    )
    return BendingLosses((first, second), thickness)


def _of_direction(
    friction: BendingFrictionTable | None, rate: BendingRateTable | None, inertia: float
) -> DirectionLosses:
    viscous = None if rate is None else rate.viscous
    return DirectionLosses(
        friction=None if friction is None else friction.friction,
        viscosity=0.0 if viscous is None else viscous.viscosity * inertia,
        terms=()
        if viscous is None
        else tuple(Relaxation(term.modulus * inertia, term.time) for term in viscous.terms),
    )
