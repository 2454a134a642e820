"""Mass scaling: inertia that is added to a sheet so that its stable time step grows.

Adds: mass to the inertia of the sheet and to nothing else: its weight, areal mass and fibre volume
fraction are those of the fabric. With a factor all of the sheet gets it. With a target step only
those elements (of triangles: nodes) get it whose own step is shorter, and as much as they need. It
does not show in a process that is slow enough to be quasi-static. In free motion it does: a sheet
with n times the inertia falls and vibrates as if time ran √n times as fast.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2; Olovsson, Simonsson,
Unosson, Int. J. Numer. Meth. Eng. 63 (2005) 1436-1445 (selective mass scaling).
Stability limit: ω² of an element falls as its mass grows. The bound of a sheet is the largest of
its elements', each with its own mass: the lumped mass is the sum of theirs.
Scene: ``process.mass_scaling``.
Fields: none; ``mass_added_kg``, ``mass_added_total``, ``mass_added_largest`` of ``summary.json``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from lcmchain.effects.effect import Effect, EffectModel, Switch, of_table, refused
from lcmchain.effects.fibre_bending import FibreBending, frequency_bound
from lcmchain.elements.family import Body
from lcmchain.quantities.entry_types import AbsentMeans, Number, PositiveTime, Range, SceneModel

# The share of the fibres' bending in ω² depends on the masses, and the masses on it. So many
# corrections are made, or until the step is met within this part.
CORRECTIONS = 20
STEP_MET = 1e-6


class MassScaling(SceneModel):
    """Mass that is added to the inertia of the sheet, not to its weight, for a larger time step."""

    factor: Annotated[float, Number(4.0, Range(1.0, 1e6))] = Field(
        default=1.0, description="Inertia of all of the sheet over its mass."
    )
    target_step: Annotated[PositiveTime | None, AbsentMeans("no mass is added selectively")] = (
        Field(
            default=None,
            description="Time step that the undeformed sheet, without contact, shall allow: "
            "elements whose own step is shorter get the mass that they lack.",
        )
    )


def with_added_mass(
    bodies: Sequence[Body],
    scaling: MassScaling | None,
    *,
    step_safety: float,
    fibre_bending: FibreBending | None,
) -> list[Body]:
    """Return the bodies with the inertia that a scene asks for.

    Parameters
    ----------
    bodies : see :class:`lcmchain.elements.family.Body`.
    scaling : None leaves them as they are.
    step_safety : part of the critical step that is used; the target step includes it.
    fibre_bending : of the fibres within the plane, whose frequency adds to that of the elements.
    """
    if scaling is None:
        return list(bodies)
    if scaling.target_step is None:
        return [_scaled(body, scaling.factor, np.inf) for body in bodies]
    target = (2.0 * step_safety / scaling.target_step) ** 2
    room = target
    for _ in range(CORRECTIONS):
        heavier = [_scaled(body, scaling.factor, room) for body in bodies]
        if fibre_bending is None:
            break
        mass = np.concatenate([body.inertial_mass for body in heavier])
        total = room + frequency_bound(fibre_bending, mass)
        if total <= target * (1.0 + STEP_MET):
            break
        room *= target / total
    return heavier


def _scaled(body: Body, factor: float, omega2: float) -> Body:
    """Return a body ``factor`` times as heavy, and heavier where it exceeds ``omega2`` [1/s²]."""
    return body.with_mass_factor(factor * np.maximum(body.part_omega2 / (factor * omega2), 1.0))


def weight_per_inertia(bodies: Sequence[Body], gravity: float) -> float | np.ndarray:
    """Return the acceleration [m/s²] by the weight of the sheets; (node_count,) where it differs.

    The weight is that of the fabric: the added mass is inertia alone.
    """
    mass = np.concatenate([body.node_mass for body in bodies])
    inertia = np.concatenate([body.inertial_mass for body in bodies])
    if gravity == 0.0 or np.array_equal(mass, inertia):
        return gravity
    share = mass / inertia
    if np.ptp(share) <= 1e-12 * share.max():
        return gravity * float(share.mean())
    return gravity * share


def added_mass(model: EffectModel) -> dict[str, float]:
    """Return the added mass under the names of ``summary.json``.

    ``mass_added_kg`` in all; ``mass_added_total`` the same over the mass of the sheets;
    ``mass_added_largest`` the largest of a node's added mass over its own mass.
    """
    mass, added = model.sheet_mass, model.nodes.mass - model.sheet_mass
    return {
        "mass_added_kg": float(added.sum()),
        "mass_added_total": float(added.sum() / mass.sum()),
        "mass_added_largest": float((added / mass).max()),
    }


SWITCH = Switch(
    entry="process.mass_scaling",
    without="the larger time step; the sheet has its own inertia",
    called=lambda scene: scene.process.mass_scaling is not None,
    off=of_table("process", mass_scaling=None),
    on=refused("no factor and no target step is given; give process.mass_scaling"),
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect."""
    added = added_mass(model)
    if added["mass_added_largest"] == 0.0:
        return [Effect("mass scaling", False, "no mass is added")]
    reason = (
        f"{1e3 * added['mass_added_kg']:.3g} g added, {100 * added['mass_added_total']:.3g} % of "
        f"the sheet, at most {100 * added['mass_added_largest']:.3g} % of a node's mass"
    )
    return [Effect("mass scaling", True, reason)]
