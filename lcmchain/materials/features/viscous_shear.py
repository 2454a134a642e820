"""Shear of a fabric that depends on its rate: a dashpot, and Maxwell elements beside the law.

Fabric that is wet with resin or a molten thermoplastic resists the rate of its shear angle γ. To
the stress of the fabric's own law comes, with the moment T per reference volume between the fibres,

    S12 += T / cos γ,   T = η γ' + Σ_k T_k,   T_k' + T_k / l_k = G_k γ',

a dashpot η (Kelvin-Voigt) and Maxwell elements of moduli G_k and relaxation times l_k. T γ' is the
power per reference volume. The stress is J F⁻¹ (2 η D) F⁻ᵀ of that part of the rate of deformation
D alone that turns the fibres towards each other, without a change of volume (J = 1): the Cauchy
shear stress along a fibre is η γ'. The part of this stress along the fibres does no work where they
keep their length, and is left out. γ' follows from the shear strain g = 2 E12 = sin γ of the
element's centre at both ends of a step, so that rigid motions make no stress,

    Δγ = Δg / cos γ at the middle of both.

Maxwell elements are exact at a constant rate, T_k <- e T_k + G_k l_k (1 - e) Δγ/Δt with
e = exp(-Δt/l_k). They store T_k²/(2 G_k). The dissipated energy is the work of both stresses, by
the mean of two steps, less what is stored more.

The viscosity is constant (Newton) or falls with the rate (Cross),

    η = η∞ + (η0 - η∞) / (1 + (M |γ'|)^(1 - N)).

A temperature shifts η, M and l_k by one factor (:mod:`.temperature_field`).

Source: Kelvin-Voigt and generalised Maxwell of thermoplastic fabrics, Dörr, Henning, Kärger (2018);
the exponential update, Simo and Hughes, "Computational Inelasticity", chapter 10; Cross, J. Colloid
Sci. 20 (1965) 417-437.

A law of a fabric with such a shear is a class of its own, with as many Maxwell elements as stated
(:func:`viscous_class`), made when it is asked for (:mod:`lcmchain.materials.twins`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.features.rheology import Relaxation, Values, maxwell_moment, moment_after
from lcmchain.materials.features.shear_compaction import LARGEST_SQUARE
from lcmchain.materials.features.temperature_field import elapsed, time_factor
from lcmchain.materials.law import (
    Material,
    Remembered,
    Step,
    history_count,
    place_in_memory,
    remembered,
    sum_text,
    unrolled,
    viscosity,
)
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of

# Below this rate times the time constant M a Cross viscosity is that at rest, to double precision.
SMALLEST_CROSS = 1e-30
#: What every law with a rate remembers before the moments of its Maxwell elements.
OWN_MEMORY = (
    Remembered("shear_strain_before", "1", "shear strain 2 E12 at the end of the step before"),
    Remembered("viscous_shear_stress", "Pa", "part of S12 that depends on the rate of the shear"),
    Remembered("viscous_dissipation", "J/m3", "energy lost to the rate of the shear, per volume"),
)


def viscous_of(material: Material) -> ViscousShear | None:
    """Return what resists the rate of a material's shear, None for one that does not know it."""
    return getattr(material, "viscous", None)


@dataclass(frozen=True)
class ViscousShear:
    """What resists the rate of a fabric's shear, in plain NumPy.

    Parameters
    ----------
    viscosity : η, or η0 at rest where it falls with the rate [Pa s]; 0 without a dashpot.
    infinite_viscosity, time_constant, exponent : η∞ [Pa s], M [s] and N of Cross's law; a time
        constant of 0 is a constant viscosity.
    terms : Maxwell elements.
    """

    viscosity: float = 0.0
    infinite_viscosity: float = 0.0
    time_constant: float = 0.0
    exponent: float = 0.0
    terms: tuple[Relaxation, ...] = ()

    @property
    def thins(self) -> bool:
        """Whether the viscosity falls with the rate."""
        return self.time_constant > 0.0

    @property
    def glassy_modulus(self) -> float:
        """Modulus of all Maxwell elements together [Pa], that of a step in no time."""
        return sum(term.modulus for term in self.terms)

    @property
    def memory(self) -> tuple[Remembered, ...]:
        """What a law with it remembers, behind what it remembered before."""
        return memory_of(len(self.terms))

    def in_words(self) -> str:
        """Say what it is made of."""
        told = []
        if self.thins:
            told.append(f"viscosity {self.viscosity:.4g} Pa s at rest, falling with the rate")
        elif self.viscosity > 0.0:
            told.append(f"viscosity {self.viscosity:.4g} Pa s")
        if self.terms:
            elements = [
                f"{1e-6 * term.modulus:.4g} MPa in {term.time:.4g} s" for term in self.terms
            ]
            told.append(f"relaxing {', '.join(elements)}")
        return "; ".join(told)

    def shifted(self, factor: float) -> ViscousShear:
        """Return it with all times longer by a factor, as at another temperature."""
        return replace(
            self,
            viscosity=factor * self.viscosity,
            infinite_viscosity=factor * self.infinite_viscosity,
            time_constant=factor * self.time_constant,
            terms=tuple(term._replace(time=factor * term.time) for term in self.terms),
        )

    def viscosity_at(self, rate: ArrayLike) -> np.ndarray:
        """Return η [Pa s] at rates of the shear angle [1/s]."""
        size: np.ndarray = np.abs(np.asarray(rate, dtype=float))
        if not self.thins:
            return np.full(size.shape, self.viscosity)
        thinning = (self.time_constant * size) ** (1.0 - self.exponent)
        extra = self.viscosity - self.infinite_viscosity
        return self.infinite_viscosity + extra / (1.0 + thinning)

    def bound(self, g: ArrayLike) -> np.ndarray:
        """Return the largest dS12 over dg/dt [Pa s] of any rate at shear strains g."""
        return self.viscosity / (1.0 - np.minimum(np.square(g), LARGEST_SQUARE))

    def in_step(self, g: ArrayLike, memory: np.ndarray, size: ArrayLike) -> np.ndarray:
        """Return the memory (3 + n, ...) at the end of a step to g; its row 1 is the stress.

        Parameters
        ----------
        memory : at the start of the step. size : of the step [s], one or (...); 0: no time passes.
        """
        size = np.asarray(size, dtype=float)
        before, stress, lost, *moments = np.asarray(memory, dtype=float)
        middle = 0.5 * (np.asarray(g) + before)
        secant = 1.0 / np.sqrt(1.0 - np.minimum(middle**2, LARGEST_SQUARE))
        turn = secant * (g - before)
        rate = np.where(size > 0.0, turn / np.where(size > 0.0, size, 1.0), 0.0)
        after = []
        for term, moment in zip(self.terms, moments, strict=True):
            after.append(moment_after(moment, term.modulus, term.time, turn, size))
        now = secant * (self.viscosity_at(rate) * rate + sum(after))
        more = self.stored([*after]) - self.stored(moments)
        lost = lost + 0.5 * (stress + now) * (g - before) - more
        return np.array(np.broadcast_arrays(g, now, lost, *after))

    def stored(self, moments: Sequence[Values] | np.ndarray) -> Values:
        """Return Σ T_k²/(2 G_k) [J/m³] of moments T_k, one after the other."""
        pairs = zip(self.terms, moments, strict=True)
        return sum((moment**2 / (2.0 * term.modulus) for term, moment in pairs), start=0.0)


def memory_of(count: int) -> tuple[Remembered, ...]:
    """Return what a law with so many Maxwell elements remembers."""
    return OWN_MEMORY + tuple(
        Remembered(
            f"relaxing_moment_{k + 1}", "Pa", f"moment per volume of Maxwell element {k + 1}"
        )
        for k in range(count)
    )


# --- compiled -------------------------------------------------------------------------------------


@optional
def with_viscous_shear(law, S12, C12, g, history):
    """Return S12 and dS12/dg with what resists the rate; as they are for a law without."""
    return S12, C12


@optional
def evolved_viscous_shear(law, g, history):
    """Return what the law remembers of its rate; nothing for a law without."""
    return ()


@optional
def viscosity_at(law, rate):
    """Return η [Pa s] at the size of a rate of the shear angle [1/s]."""
    return law.viscosity


@equation
def cross_viscosity(law, rate):
    x = max(law.time_constant * rate, SMALLEST_CROSS)
    thinning = exponential((1.0 - law.exponent) * logarithm(x))
    extra = law.viscosity - law.infinite_viscosity
    return law.infinite_viscosity + extra / (1.0 + thinning)


@equation
def secant_of(g):
    """Return 1/cos γ; beyond 84 degrees it grows no more."""
    return 1.0 / np.sqrt(1.0 - min(g * g, LARGEST_SQUARE))


@equation
def dashpot_moment(law, turn, size):
    """Return η γ' for a turn Δγ of the fibres in a step; nothing where no time passes."""
    rate = turn / size if size > 0.0 else 0.0
    return viscosity_at(law, abs(rate)) * rate


class ViscousLaw(Protocol):
    """A class of laws with so many Maxwell elements of the shear."""

    maxwell_count: int


def _places(law_class: type[ViscousLaw]) -> tuple[int, ...]:
    """Return where in a history stand what the law remembers of its rate, and the step."""
    first, last = place_in_memory(law_class, OWN_MEMORY[0]), history_count(law_class)
    return (*range(first, first + len(OWN_MEMORY) + law_class.maxwell_count), last, last + 1)


@unrolled(
    lambda law_class: (
        f"lambda law, history: ({''.join(f'history[{k}], ' for k in _places(law_class))})"
    )
)
def past_numbers(law, history):
    """Return g, stress and loss of the step before, the moments, and size and time of the step."""
    return tuple(history[k] for k in _places(type(law)))


def _elements(law_class: type[ViscousLaw], term: str) -> list[str]:
    return [term.format(k=k + 1, place=3 + k) for k in range(law_class.maxwell_count)]


_AFTER = "maxwell_moment(past[{place}], law.modulus_{k}, law.relaxation_time_{k}, turn, size), "


@unrolled(
    lambda law_class: f"lambda law, past, turn, size: ({''.join(_elements(law_class, _AFTER))})",
    maxwell_moment=maxwell_moment,
)
def moments_after(law, past, turn, size):
    """Return the moments of the Maxwell elements after a step that turns the fibres by Δγ."""
    numbers = range(1, law.maxwell_count + 1)
    return tuple(
        maxwell_moment(
            past[2 + k],
            getattr(law, f"modulus_{k}"),
            getattr(law, f"relaxation_time_{k}"),
            turn,
            size,
        )
        for k in numbers
    )


def _moments(law_class: type[ViscousLaw]) -> list[str]:
    return [f"moments[{k}]" for k in range(law_class.maxwell_count)]


@unrolled(lambda law_class: "lambda law, moments: " + sum_text(_moments(law_class)))
def sum_of_moments(law, moments):
    """Return the moment of all Maxwell elements."""
    return sum(moments)


@unrolled(lambda law_class: "lambda law: " + sum_text(_elements(law_class, "law.modulus_{k}")))
def glassy_modulus(law):
    """Return the modulus of all Maxwell elements together."""
    return sum(getattr(law, f"modulus_{k + 1}") for k in range(law.maxwell_count))


@unrolled(
    lambda law_class: (
        "lambda law, past, moments: "
        + sum_text(
            [
                f"(moments[{k}] * moments[{k}] - past[{3 + k}] * past[{3 + k}])"
                f" / (2.0 * law.modulus_{k + 1})"
                for k in range(law_class.maxwell_count)
            ]
        )
    )
)
def stored_more(law, past, moments):
    """Return by how much more energy the Maxwell elements store after the step."""
    return sum(
        (moment**2 - past[3 + k] ** 2) / (2.0 * getattr(law, f"modulus_{k + 1}"))
        for k, moment in enumerate(moments)
    )


@unrolled(
    lambda law_class: (
        "lambda law, g, stress, lost, moments: (g, stress, lost, "
        + "".join(f"{moment}, " for moment in _moments(law_class))
        + ")"
    )
)
def packed_memory(law, g, stress, lost, moments):
    """Return what the law remembers of its rate, in its order."""
    return (g, stress, lost, *moments)


@equation
def stress_of_rate(law, past, g, size):
    """Return what comes to S12, the secant 1/cos γ of the step, and the moments after it."""
    secant = secant_of(0.5 * (g + past[0]))
    turn = secant * (g - past[0])
    moments = moments_after(law, past, turn, size)
    moment = dashpot_moment(law, turn, size) + sum_of_moments(law, moments)
    return secant * moment, secant, moments


@equation
def viscous_shear_stress(law, S12, C12, g, history):
    past = past_numbers(law, history)
    stress, secant, _ = stress_of_rate(law, past, g, elapsed(law, history, past[-2]))
    return S12 + stress, C12 + secant * secant * glassy_modulus(law)


@equation
def viscous_shear_memory(law, g, history):
    past = past_numbers(law, history)
    stress, _, moments = stress_of_rate(law, past, g, elapsed(law, history, past[-2]))
    work = 0.5 * (past[1] + stress) * (g - past[0])
    lost = past[2] + work - stored_more(law, past, moments)
    return packed_memory(law, g, stress, lost, moments)


@equation
def viscous_shear_bound(law, E, history):
    secant = secant_of(E[3])
    bound = law.viscosity * secant * secant * time_factor(law, history)
    return (None, None, None, bound, None, None)


# --- laws -----------------------------------------------------------------------------------------

# Kinds of viscosity, and the parameters of each.
_KINDS = {
    "Newton": ("viscosity",),
    "Cross": ("viscosity", "infinite_viscosity", "time_constant", "exponent"),
}


@made_on_demand(rf"(?P<kind>{'|'.join(_KINDS)})(?P<count>\d+)(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws whose shear depends on its rate."""
    kind, count = name["kind"], int(name["count"])
    numbers = range(1, count + 1)
    fields = [
        *_KINDS[kind],
        *(f"modulus_{k}" for k in numbers),
        *(f"relaxation_time_{k}" for k in numbers),
    ]
    answers = {
        with_viscous_shear: viscous_shear_stress,
        evolved_viscous_shear: viscous_shear_memory,
        viscosity: viscous_shear_bound,
    }
    if kind == "Cross":
        answers[viscosity_at] = cross_viscosity
    twin = twin_of(
        base,
        f"{kind}{count}",
        about=" and of :class:`ViscousShear`.",
        entries=[(field, float) for field in fields],
        answers=answers,
    )
    twin.remembers = remembered(base) + memory_of(count)
    twin.knows_step = True
    twin.maxwell_count = count
    return twin


def viscous_class(law_class: type, viscous: ViscousShear) -> Any:
    """Return the twin of a class of laws whose shear depends on its rate, see :func:`.twin_of`."""
    kind = "Cross" if viscous.thins else "Newton"
    return twin_named(f"{kind}{len(viscous.terms)}{law_class.__name__}")


def with_viscous(law: LawOrTwin, viscous: ViscousShear | None) -> LawOrTwin:
    """Return a law whose shear depends on its rate, or the law itself where nothing is stated."""
    if viscous is None:
        return law
    twin = viscous_class(type(law), viscous)
    numbers = [getattr(viscous, name) for name in _KINDS["Cross" if viscous.thins else "Newton"]]
    moduli, times = zip(*viscous.terms, strict=True) if viscous.terms else ((), ())
    return twin(*law, *(float(number) for number in (*numbers, *moduli, *times)))


def stress_of_step(
    viscous: ViscousShear, E: np.ndarray, past: np.ndarray, step: Step
) -> np.ndarray:
    """Return what comes to S^M (..., 6) at the end of a step to E; its own memory before."""
    S = np.zeros(np.shape(E))
    S[..., 3] = viscous.in_step(np.asarray(E)[..., 3], past, step.size)[1]
    return S
