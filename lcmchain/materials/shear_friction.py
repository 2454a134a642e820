"""Friction in the shear of a fabric: yarns that turn on each other at their crossings.

Fabric that was sheared does not come back the way it went. Loops of picture frames and of
Kawabata's shear test are open from the first degree on, in every cycle, and to both sides; they
are wider where the yarns are pressed on each other more, at larger angles. To the stress of the
fabric's own law comes, with the moment T per volume between the fibres as in
:mod:`lcmchain.materials.viscous_shear`,

    S12 += T / cos γ,   dT = G dγ - G T/T_y |dγ|,   T_y = T_0 + c |T_el(γ)|,   G = T_0/γ_f,

Dahl's friction (:mod:`lcmchain.materials.dahl`), whose limit grows with the moment
T_el = S12 cos γ of the elastic part, free of pressure. Where the fabric is sheared on it bears
T_el + T_y, on the way back T_el - T_y: the elastic part is the mean of both branches of a loop. The
set of a law that counts its strain from the largest angle (as ``fabric-with-set`` does in
compaction) closes after the first cycle and never takes a force to bring the fabric back, as tests
do; that is why it is not taken here.

The limit is that at the end of a step; with it the step is exact, and none makes T larger than the
largest limit. Energies as in :mod:`lcmchain.materials.dahl`, lost ones ``inelastic``.

Source: hysteresis "determined wholly by the frictional restraints arising in the rotation of the
yarns", in proportion to the rigidity from fabric to fabric (2HG and 2HG5 over G): Lo and Hu,
Textile Research Journal 72 (2002), after Grosberg and Park; a limit that grows with the angle in
picture frames of dry textiles: Duong and Sauer, J. Mech. Phys. Solids (2025), arXiv 2412.20131.

A law of a fabric with it is a class of its own, made on demand (:mod:`lcmchain.materials.twins`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.dahl import Friction, dahl_loss, dahl_moment
from lcmchain.materials.law import Remembered, history_count, remembered, unrolled
from lcmchain.materials.shear_compaction import LARGEST_SQUARE
from lcmchain.materials.twins import made_on_demand, twin_named, twin_of
from lcmchain.materials.viscous_shear import secant_of

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

    def at(self, elastic: Any) -> Friction:
        """Return the friction where the elastic moment is of a size [Pa]."""
        limit = self.stress + self.growth * np.abs(elastic)
        return Friction(limit, limit / self.modulus)

    def in_words(self) -> str:
        grows = f", growing with {self.growth:.3g} of the shear stress" if self.growth else ""
        return f"up to {1e-3 * self.stress:.4g} kPa within {np.degrees(self.angle):.3g}°{grows}"

    def in_step(self, g: Any, memory: Any, elastic_stress: Any) -> np.ndarray:
        """Return the memory (3, ...) at the end of a step to shear strains g.

        elastic_stress : S12 of the elastic part there [Pa], free of pressure.
        """
        before, moment, lost = np.asarray(memory, dtype=float)
        middle, now = 0.5 * (np.asarray(g) + before), np.minimum(np.square(g), LARGEST_SQUARE)
        turn = (g - before) / np.sqrt(1.0 - np.minimum(middle**2, LARGEST_SQUARE))
        friction = self.at(np.asarray(elastic_stress) * np.sqrt(1.0 - now))
        after = friction.after(moment, turn)
        return np.array(np.broadcast_arrays(g, after, lost + friction.lost(moment, after, turn)))

    def stress_of(self, before: Any, g: Any, moment: Any) -> Any:
        """Return what a moment after a step from one shear strain to another adds to S12."""
        middle = 0.5 * (np.asarray(g) + before)
        return moment / np.sqrt(1.0 - np.minimum(middle**2, LARGEST_SQUARE))

    def own_memory(self, law: Any, history: np.ndarray) -> np.ndarray:
        """Return what a law with it remembers of it (3, ...), of all that it remembers."""
        return history[law.shear_friction_place : law.shear_friction_place + len(MEMORY)]

    @property
    def memory(self) -> tuple[Remembered, ...]:
        return MEMORY


def shear_friction_of(material: Any) -> ShearFriction | None:
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


def _own_text(own: Any) -> str:
    first = own.shear_friction_place
    return f"lambda law, history: (history[{first}], history[{first + 1}], history[{first + 2}])"


@unrolled(_own_text)
def own_numbers(law, history):
    """Return shear strain, moment and loss of the step before."""


@equation
def rubbed(law, own, g, elastic):
    """Return the moment after a step, the length of its friction, the turn, and 1/cos γ."""
    secant = secant_of(0.5 * (g + own[0]))
    turn = secant * (g - own[0])
    limit = law.friction_stress + law.friction_growth * abs(elastic) / secant_of(g)
    length = limit / law.friction_modulus
    return dahl_moment(own[1], law.friction_modulus, length, turn), length, turn, secant


@equation
def shear_with_friction(law, S12, C12, g, elastic, history):
    moment, _, _, secant = rubbed(law, own_numbers(law, history), g, elastic)
    return S12 + secant * moment, C12 + 2.0 * secant * secant * law.friction_modulus


@equation
def shear_friction_memory(law, g, elastic, history):
    own = own_numbers(law, history)
    moment, length, turn, _ = rubbed(law, own, g, elastic)
    return (g, moment, own[2] + dahl_loss(own[1], moment, law.friction_modulus, length, turn))


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"FrictionShear(?P<base>\w+)")
def _twin(name: re.Match[str], base: Any) -> Any:
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
    twin.shear_friction_place = history_count(base)
    twin.remembers = remembered(base) + MEMORY
    return twin


def __getattr__(name: str) -> Any:
    """Return a twin by its name, as compiled kernels on disk look it up."""
    return twin_named(name)


def with_rubbing_shear(law: Any, friction: ShearFriction | None) -> Any:
    """Return a law with friction in shear, or the law itself where none is stated."""
    if friction is None:
        return law
    twin = twin_named(f"FrictionShear{type(law).__name__}")
    return twin(*law, friction.stress, friction.modulus, friction.growth)
