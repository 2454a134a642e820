"""Friction in the shear of a fabric: yarns rub where they turn on each other at their crossings.

Sheared fabric does not come back the way it went. Loops of picture frames and of Kawabata's shear
test are open from the first degree on, in every cycle and to both sides. They are wider at larger
angles, where the yarns are pressed on each other more. To the stress of the fabric's own law comes,
with the moment T per volume between the fibres as in :mod:`.viscous_shear`,

    S12 += T / cos γ,   dT = G dγ - G T/T_y |dγ|,   T_y = T_0 + c |T_el(γ)|,   G = T_0/γ_f,

Dahl's friction (:mod:`.rheology`). Its limit grows with the moment T_el = S12 cos γ of the elastic
part, free of pressure. Sheared on, the fabric bears T_el + T_y, on the way back T_el - T_y: the
elastic part is the mean of both branches of a loop. A permanent set that counts the strain from the
largest angle, as ``fabric-with-set`` does in compaction, would close after the first cycle and
never take a force to bring the fabric back, as tests do. So it is not used here.

A step takes the limit at its end. With it the step is exact, and no step makes T larger than the
largest limit. Energies as in :mod:`.rheology`; lost ones are ``inelastic``.

Source: hysteresis "determined wholly by the frictional restraints arising in the rotation of the
yarns", in proportion to the rigidity from fabric to fabric (2HG and 2HG5 over G): Lo and Hu,
Textile Research Journal 72 (2002), after Grosberg and Park; a limit that grows with the angle in
picture frames of dry textiles: Duong and Sauer, J. Mech. Phys. Solids (2025), arXiv 2412.20131.

A law of a fabric with it is a class of its own, made on demand (:mod:`lcmchain.materials.twins`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.features.rheology import Friction, Values, dahl_loss, dahl_moment
from lcmchain.materials.features.shear_compaction import LARGEST_SQUARE
from lcmchain.materials.features.viscous_shear import secant_of
from lcmchain.materials.law import Material, Remembered, place_in_memory, remembered, unrolled
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of
from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    AcuteAngle,
    Number,
    PositiveStiffness,
    SceneModel,
)

MEMORY = (
    Remembered("shear_strain_rubbed", "1", "shear strain 2 E12 a step before, for its friction"),
    Remembered("shear_friction_moment", "Pa", "moment per volume of the friction in shear"),
    Remembered("shear_friction_loss", "J/m3", "energy lost to friction in shear, per volume"),
)


@dataclass(frozen=True)
class ShearFriction:
    """Friction of a fabric's shear, in plain NumPy.

    Parameters
    ----------
    stress : limit T_0 of the moment per volume, unsheared [Pa].
    angle : γ_f in which it comes up [rad].
    growth : c, what the limit gains with the moment of the elastic part.
    """

    stress: float
    angle: float
    growth: float = 0.0

    @property
    def modulus(self) -> float:
        """Stiffness G against the angle at rest; twice that where the way turns round."""
        return self.stress / self.angle

    def at(self, elastic: Values) -> Friction:
        """Return the friction where the elastic moment is of a size [Pa]."""
        limit: Any = self.stress + self.growth * np.abs(elastic)  # an array for an array
        return Friction(limit, limit / self.modulus)

    def in_words(self) -> str:
        grows = f", growing with {self.growth:.3g} of the shear stress" if self.growth else ""
        return f"up to {1e-3 * self.stress:.4g} kPa within {np.degrees(self.angle):.3g}°{grows}"

    def in_step(self, g: Values, memory: ArrayLike, elastic_stress: Values) -> np.ndarray:
        """Return the memory (3, ...) at the end of a step to shear strains g.

        elastic_stress : S12 of the elastic part there [Pa], free of pressure.
        """
        before, moment, lost = np.asarray(memory, dtype=float)
        middle, now = 0.5 * (np.asarray(g) + before), np.minimum(np.square(g), LARGEST_SQUARE)
        turn = (g - before) / np.sqrt(1.0 - np.minimum(middle**2, LARGEST_SQUARE))
        friction = self.at(np.asarray(elastic_stress) * np.sqrt(1.0 - now))
        after = friction.after(moment, turn)
        return np.array(np.broadcast_arrays(g, after, lost + friction.lost(moment, after, turn)))

    def stress_of(self, before: Values, g: Values, moment: Values) -> Values:
        """Return what a moment after a step from one shear strain to another adds to S12."""
        middle = 0.5 * (np.asarray(g) + before)
        return moment / np.sqrt(1.0 - np.minimum(middle**2, LARGEST_SQUARE))

    @property
    def memory(self) -> tuple[Remembered, ...]:
        return MEMORY


def shear_friction_of(material: Material) -> ShearFriction | None:
    """Return the friction of a material's shear, None without."""
    return getattr(material, "shear_friction", None)


# --- compiled -------------------------------------------------------------------------------------


@optional
def with_shear_friction(law, S12, C12, g, elastic, history):
    """Return S12 and dS12/dg with friction; as they are for a law without.

    elastic : S12 of the elastic part, free of pressure.
    """
    return S12, C12


@optional
def evolved_shear_friction(law, g, elastic, history):
    """Return what the law remembers of its friction in shear; nothing for a law without."""
    return ()


def _past_text(law_class: type) -> str:
    first = place_in_memory(law_class, MEMORY[0])
    return f"lambda law, history: (history[{first}], history[{first + 1}], history[{first + 2}])"


@unrolled(_past_text)
def past_numbers(law, history):
    """Return shear strain, moment and loss of the step before."""


@equation
def rubbed(law, past, g, elastic):
    """Return the moment after a step, the length of its friction, the turn, and 1/cos γ."""
    secant = secant_of(0.5 * (g + past[0]))
    turn = secant * (g - past[0])
    limit = law.friction_stress + law.friction_growth * abs(elastic) / secant_of(g)
    length = limit / law.friction_modulus
    return dahl_moment(past[1], law.friction_modulus, length, turn), length, turn, secant


@equation
def shear_with_friction(law, S12, C12, g, elastic, history):
    moment, _, _, secant = rubbed(law, past_numbers(law, history), g, elastic)
    return S12 + secant * moment, C12 + 2.0 * secant * secant * law.friction_modulus


@equation
def shear_friction_memory(law, g, elastic, history):
    past = past_numbers(law, history)
    moment, length, turn, _ = rubbed(law, past, g, elastic)
    return (g, moment, past[2] + dahl_loss(past[1], moment, law.friction_modulus, length, turn))


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"FrictionShear(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws with friction in shear."""
    twin = twin_of(
        base,
        "FrictionShear",
        about=" and of :class:`ShearFriction`.",
        entries=[(f"friction_{field}", float) for field in ("stress", "modulus", "growth")],
        answers={
            with_shear_friction: shear_with_friction,
            evolved_shear_friction: shear_friction_memory,
        },
    )
    twin.remembers = remembered(base) + MEMORY
    return twin


def with_rubbing_shear(law: LawOrTwin, friction: ShearFriction | None) -> LawOrTwin:
    """Return a law with friction in shear, or the law itself where none is stated."""
    if friction is None:
        return law
    twin = twin_named(f"FrictionShear{type(law).__name__}")
    return twin(*law, friction.stress, friction.modulus, friction.growth)


# --- scene ----------------------------------------------------------------------------------------


class ShearFrictionTable(SceneModel):
    """Friction of yarns that turn on each other (Dahl): fabric comes back another way."""

    stress: PositiveStiffness = Field(
        description="Limit of the friction's moment per volume: half the width of a loop of the "
        "shear stress at a small angle."
    )
    angle: AcuteAngle = Field(
        description="Change of the shear angle over which the friction comes to 63 % of its limit."
    )
    growth: Annotated[float, Number(0.2, NOT_NEGATIVE)] = Field(
        default=0.0,
        description="What the limit gains with the shear stress of the elastic part, over it.",
    )

    @property
    def friction(self) -> ShearFriction:
        return ShearFriction(self.stress, self.angle, self.growth)
