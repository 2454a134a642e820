"""Compaction that relaxes: the pressure on a held gap falls, a gap under a held pressure closes on.

Maxwell elements stand beside the compaction law, each a share r of the law in series with a dashpot
of the relaxation time l. To the stress S of the law at the strain ε that it sees come their
stresses,

    h_k' + h_k/l_k = r_k S',

so that a gap that is closed at once and held bears S (1 + Σ r_k exp(-t/l_k)): of every pressure,
small or large, the same part relaxes. A step is exact at a constant rate of S.

The spring of an element follows the compaction law itself: h = r (S(ε) - S(ε_v)) with the strain
ε_v of its dashpot, and stores

    r (W(ε) - W(ε_v) - S(ε_v) (ε - ε_v)) ≥ 0,

for W is convex. What is lost, r (ε - ε_v) dS(ε_v) ≥ 0, is the work of the elements less what they
store: a law remembers the work, and the loss follows where it is asked for.

Source: linear in the stress of a nonlinear spring, Fung, "Biomechanics", chapter 7 (quasi-linear
viscoelasticity); the exponential update, Simo and Hughes, "Computational Inelasticity", chapter 10.
That the pressure on held textiles falls by a part of itself: Robitaille and Gauvin, Polymer
Composites 19 (1998). The energy is our own.

A law with it is a class of its own, with as many elements as stated, made when it is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.features.compaction import (
    CompactionLaw,
    compaction_of,
    compaction_stress_and_tangent,
)
from lcmchain.materials.features.rheology import Relaxation, maxwell_moment, moment_after
from lcmchain.materials.features.shear_compaction import strain_of, thickening
from lcmchain.materials.features.temperature_field import elapsed
from lcmchain.materials.law import (
    Material,
    Remembered,
    history_count,
    remembered,
    sum_text,
    unrolled,
)
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of

#: What every relaxing law remembers before the stresses of its elements.
OWN_MEMORY = (
    Remembered("compaction_strain_before", "1", "strain of the compaction law a step before"),
    Remembered("compaction_stress_before", "Pa", "stress of the compaction law a step before"),
    Remembered("relaxing_work", "J/m3", "work on what relaxes of the compaction, per volume"),
)
# Strain that no compaction reaches, and halvings of what is left: to round-off.
DEEPEST_STRAIN = -0.5
HALVINGS = 60


@dataclass(frozen=True)
class CompactionRelaxation:
    """What relaxes of a fabric's compaction, in plain NumPy.

    Parameters
    ----------
    terms : Maxwell elements; the modulus of each is its share r of the law [1].
    """

    terms: tuple[Relaxation, ...]

    @property
    def memory(self) -> tuple[Remembered, ...]:
        """What a law with it remembers, before all else."""
        return memory_of(len(self.terms))

    @property
    def share_at_once(self) -> float:
        """Σ r: pressure of a gap that is closed at once over that which stays, less one."""
        return sum(term.modulus for term in self.terms)

    def in_words(self) -> str:
        """Say what it is made of."""
        told = [f"{term.modulus:.4g} of the pressure in {term.time:.4g} s" for term in self.terms]
        return f"relaxing {', '.join(told)}"

    def shifted(self, factor: float) -> CompactionRelaxation:
        """Return it with all times longer by a factor, as at another temperature."""
        terms = tuple(term._replace(time=factor * term.time) for term in self.terms)
        return CompactionRelaxation(terms)

    def in_step(
        self, strain: np.ndarray, stress: np.ndarray, memory: np.ndarray, size: ArrayLike
    ) -> np.ndarray:
        """Return the memory (3 + n, ...) at the end of a step.

        Parameters
        ----------
        strain, stress : of the compaction law at its end (...). memory : at its start.
        size : of the step [s], one or (...); 0: no time passes.
        """
        strain_before, stress_before, work, *before = memory
        after = []
        for term, h in zip(self.terms, before, strict=True):
            after.append(moment_after(h, term.modulus, term.time, stress - stress_before, size))
        work = work + 0.5 * (sum(before) + sum(after)) * (strain - strain_before)
        return np.array(np.broadcast_arrays(strain, stress, work, *after))

    def stored(
        self,
        memory: np.ndarray,
        law: CompactionLaw,
        energy: Callable[[np.ndarray], np.ndarray],
    ) -> np.ndarray:
        """Return what the elements store [J/m³] as their memory (3 + n, ...) says.

        energy : returns W of the law at strains.
        """
        strain, stress, _, *stresses = memory
        total = np.zeros(np.shape(strain))
        for term, h in zip(self.terms, stresses, strict=True):
            dashpot = stress - h / term.modulus
            reached = strain_at(dashpot, law)
            stored = energy(strain) - energy(reached) - dashpot * (strain - reached)
            total += term.modulus * stored
        return total


def relaxation_of(material: Material) -> CompactionRelaxation | None:
    """Return what relaxes of a material's compaction, None for one where nothing does."""
    return getattr(material, "relaxation", None)


def strain_at(stress: np.ndarray, law: CompactionLaw) -> np.ndarray:
    """Return the strain at which a compaction law has a stress [Pa], by halving."""
    low = np.full(np.shape(stress), DEEPEST_STRAIN)
    high = np.maximum(stress, 0.0) / law.c0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = compaction_of(law.c0, law.c1, law.c2, middle)[0] > stress
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def memory_of(count: int) -> tuple[Remembered, ...]:
    """Return what a law with so many elements remembers."""
    return OWN_MEMORY + tuple(
        Remembered(f"relaxing_compaction_{k + 1}", "Pa", f"compaction stress of element {k + 1}")
        for k in range(count)
    )


# --- compiled -------------------------------------------------------------------------------------


@optional
def with_relaxation(law, S33, C33, strain, history):
    """Return the stress of the compaction and its tangent, as they are for a law without."""
    return S33, C33


@optional
def evolved_relaxation(law, E, history):
    """Return what the law remembers of its relaxation; nothing for a law without."""
    return ()


class RelaxingLaw(Protocol):
    """A class of laws with so many elements."""

    relaxing_count: int


def _numbers(law_class: type[RelaxingLaw]) -> str:
    """Return the text of what a law remembers of its relaxation, and the size of the step."""
    places = range(len(OWN_MEMORY) + law_class.relaxing_count)
    return "".join(f"history[{k}], " for k in (*places, history_count(law_class)))


@unrolled(lambda law_class: f"lambda law, history: ({_numbers(law_class)})")
def past_numbers(law, history):
    """Return strain, stress and work of the step before, the stresses, and the size of the step."""
    count = len(OWN_MEMORY) + type(law).relaxing_count
    return (*history[:count], history[history_count(law)])


def _elements(law_class: type[RelaxingLaw], term: str) -> list[str]:
    numbers = range(law_class.relaxing_count)
    return [term.format(k=k + 1, place=len(OWN_MEMORY) + k) for k in numbers]


_AFTER = "maxwell_moment(past[{place}], law.share_{k}, law.compaction_time_{k}, change, size), "


@unrolled(
    lambda law_class: f"lambda law, past, change, size: ({''.join(_elements(law_class, _AFTER))})",
    maxwell_moment=maxwell_moment,
)
def stresses_after(law, past, change, size):
    """Return the stresses of the elements after a step that changes that of the law."""
    numbers = range(1, type(law).relaxing_count + 1)
    return tuple(
        maxwell_moment(
            past[len(OWN_MEMORY) + k - 1],
            getattr(law, f"share_{k}"),
            getattr(law, f"compaction_time_{k}"),
            change,
            size,
        )
        for k in numbers
    )


@unrolled(lambda law_class: f"lambda law, past: {sum_text(_elements(law_class, 'past[{place}]'))}")
def sum_before(law, past):
    """Return the stress of all elements before the step."""
    return sum(past[len(OWN_MEMORY) : -1])


@unrolled(lambda law_class: f"lambda law: {sum_text(_elements(law_class, 'law.share_{k}'))}")
def share_at_once(law):
    """Return the share of the law that all elements have together."""
    return sum(getattr(law, f"share_{k + 1}") for k in range(type(law).relaxing_count))


@unrolled(
    lambda law_class: (
        "lambda law, stresses: "
        + sum_text([f"stresses[{k}]" for k in range(law_class.relaxing_count)])
    )
)
def sum_after(law, stresses):
    """Return the stress of all elements after the step."""
    return sum(stresses)


@equation
def relaxing_stress(law, S33, C33, strain, history):
    past = past_numbers(law, history)
    size = elapsed(law, history, past[-1])
    stresses = stresses_after(law, past, S33 - past[1], size)
    return S33 + sum_after(law, stresses), C33 * (1.0 + share_at_once(law))


@equation
def relaxing_memory(law, E, history):
    past = past_numbers(law, history)
    strain = strain_of(thickening(law, E[2], E[3]), E[2])
    S33 = compaction_stress_and_tangent(law, strain)[0]
    stresses = stresses_after(law, past, S33 - past[1], elapsed(law, history, past[-1]))
    mean = 0.5 * (sum_before(law, past) + sum_after(law, stresses))
    work = past[2] + mean * (strain - past[0])
    return (strain, S33, work, *stresses)


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"Relaxing(?P<count>\d+)Compaction(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws whose compaction relaxes."""
    count = int(name["count"])
    numbers = range(1, count + 1)
    fields = [*(f"share_{k}" for k in numbers), *(f"compaction_time_{k}" for k in numbers)]
    twin = twin_of(
        base,
        f"Relaxing{count}Compaction",
        about=" and of :class:`CompactionRelaxation`.",
        entries=[(field, float) for field in fields],
        answers={with_relaxation: relaxing_stress, evolved_relaxation: relaxing_memory},
    )
    if remembered(base):
        raise TypeError(f"{base.__name__} remembers what would have to stand behind the relaxation")
    twin.remembers = memory_of(count)
    twin.knows_step = True
    twin.relaxing_count = count
    return twin


def with_relaxing(law: LawOrTwin, relaxation: CompactionRelaxation | None) -> LawOrTwin:
    """Return a law whose compaction relaxes, or the law itself where nothing is stated."""
    if relaxation is None:
        return law
    shares, times = zip(*relaxation.terms, strict=True)
    twin = twin_named(f"Relaxing{len(shares)}Compaction{type(law).__name__}")
    return twin(*law, *map(float, (*shares, *times)))
