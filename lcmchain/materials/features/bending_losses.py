"""Bending of fibres that loses energy: friction between them, and what resists the rate.

To the elastic moment per width of each fibre direction, linear or by a curve, come three others,

    M = M_el(κ) + M_f + η κ' + Σ_k M_k,   M_k' + M_k/l_k = G_k κ':

the moment M_f of Dahl's friction, which comes to ±M_y within a curvature κ_f of the way back, that
of a dashpot, and those of Maxwell elements (:mod:`.rheology`). They are driven by the curvature
κ = E^ζ/h of an element's centre at both ends of a step: a rigid motion makes no moment. The stress
is S^ζ = 12 h M/t0³, as that of a curve.

Energies: elements store M_f² κ_f/(2 M_y) and M_k²/(2 G_k). What the friction takes does not depend
on time: it counts as ``inelastic``, as what a permanent set takes, not as friction against tools or
plies. What the rates take is ``viscous``; their work is taken by the mean of two steps, as that of
the shear.

Stability: at the limit the friction is as stiff as 2 M_y/κ_f where the curvature turns round; with
that it adds to the stiffness that bounds the step. Maxwell elements add as springs, the dashpot by
its damping rate.

Source: friction of bent fabric is measured by Kawabata's test (half the width of the loop 2HB is
M_y); its form, see :mod:`.rheology`. Viscoelastic bending of molten thermoplastic plies: Dörr,
Henning, Kärger (2018).

A law of a fabric that loses so is a class of its own (:func:`losing_class`), with friction or
without, and with as many Maxwell elements as stated.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.jit import equation
from lcmchain.materials.features.rheology import (
    LEAST_MODULUS,
    Friction,
    Relaxation,
    Values,
    dahl_loss,
    dahl_moment,
    maxwell_moment,
    moment_after,
)
from lcmchain.materials.law import (
    Remembered,
    bending_bound,
    bending_stiffness,
    bending_viscosity,
    evolved_bending,
    history_count,
    knows_step,
    place_in_memory,
    remembered,
    stored_bending,
    sum_text,
    unrolled,
    with_bending_losses,
)
from lcmchain.materials.twins import LawOrTwin, made_on_demand, twin_named, twin_of

DIRECTIONS = (1, 2)


@dataclass(frozen=True)
class DirectionLosses:
    """What the bending along one fibre direction loses, per width of the sheet.

    Parameters
    ----------
    friction : limit M_y [N] and curvature κ_f [1/m]; None without.
    viscosity : η of the dashpot [N s m]; 0 without.
    terms : Maxwell elements, moduli in [N m].
    """

    friction: Friction | None = None
    viscosity: float = 0.0
    terms: tuple[Relaxation, ...] = ()

    @property
    def resists_rates(self) -> bool:
        return self.viscosity > 0.0 or bool(self.terms)

    @property
    def glassy_stiffness(self) -> float:
        """Stiffness [N m] of all elements at most, that bounds the step."""
        turned = 0.0 if self.friction is None else 2.0 * self.friction.modulus
        return turned + sum(term.modulus for term in self.terms)


@dataclass(frozen=True)
class BendingLosses:
    """What the bending of a fabric loses, in plain NumPy.

    Parameters
    ----------
    directions : along the fibres 1 and 2. thickness : t0 [m].
    """

    directions: tuple[DirectionLosses, DirectionLosses]
    thickness: float

    @property
    def rubs(self) -> bool:
        """Whether there is friction along either direction."""
        return any(direction.friction is not None for direction in self.directions)

    @property
    def resists_rates(self) -> bool:
        return any(direction.resists_rates for direction in self.directions)

    @property
    def term_count(self) -> int:
        """How many Maxwell elements each direction keeps; some of them may have no modulus."""
        return max(len(direction.terms) for direction in self.directions)

    @property
    def memory(self) -> tuple[Remembered, ...]:
        """What a law with it remembers, behind what it remembered before."""
        return memory_of(self.rubs, self.term_count if self.resists_rates else None)

    @property
    def per_stiffness(self) -> float:
        """Modulus [Pa] of C^B of a stiffness per width [N m]: 12/t0³."""
        return 12.0 / self.thickness**3

    def glassy_moduli(self) -> np.ndarray:
        """Return by how much the moduli C11 and C22 of C^B grow for the bound of the step (2,)."""
        return self.per_stiffness * np.array(
            [direction.glassy_stiffness for direction in self.directions]
        )

    def viscosities(self) -> np.ndarray:
        """Return the viscosities (2,) [Pa s] of the strains E11 and E22 linear in ζ."""
        return self.per_stiffness * np.array([direction.viscosity for direction in self.directions])

    def in_step(
        self, curvature: Sequence[Values] | np.ndarray, memory: ArrayLike, size: float = 0.0
    ) -> np.ndarray:
        """Return the memory at the end of a step to curvatures (2, ...) [1/m] of both directions.

        Parameters
        ----------
        memory : at its start (numbers, ...). size : of the step [s]; 0: no time passes.
        """
        names = [entry.name for entry in self.memory]
        before = dict(zip(names, np.asarray(memory, dtype=float), strict=True))
        after = dict(before)
        for number, (direction, now) in enumerate(zip(self.directions, curvature, strict=True), 1):
            way = np.asarray(now) - before[f"curvature_before_{number}"]
            after[f"curvature_before_{number}"] = np.asarray(now)
            if direction.friction is not None:
                rubbed = before[f"bending_friction_moment_{number}"]
                moment = direction.friction.after(rubbed, way)
                after[f"bending_friction_moment_{number}"] = moment
                lost = direction.friction.lost(rubbed, moment, way) / self.thickness
                after["bending_friction_loss"] = after["bending_friction_loss"] + lost
            if self.resists_rates:
                resisted = direction.viscosity * way / size if size > 0.0 else np.zeros_like(way)
                more = 0.0
                for k, term in enumerate(direction.terms, 1):
                    name = f"relaxing_bending_moment_{number}_{k}"
                    after[name] = moment_after(before[name], term.modulus, term.time, way, size)
                    resisted = resisted + after[name]
                    more = more + (after[name] ** 2 - before[name] ** 2) / (2.0 * term.modulus)
                name = f"viscous_bending_moment_{number}"
                after[name] = resisted
                lost = (0.5 * (before[name] + resisted) * way - more) / self.thickness
                after["viscous_bending_loss"] = after["viscous_bending_loss"] + lost
        return np.array(np.broadcast_arrays(*after.values()))

    def moments(self, memory: np.ndarray) -> np.ndarray:
        """Return the moments (2, ...) [N] that the memory at the end of a step tells."""
        values = dict(zip((entry.name for entry in self.memory), memory, strict=True))
        names = ("bending_friction_moment", "viscous_bending_moment")
        return np.array(
            [sum(values.get(f"{name}_{number}", 0.0) for name in names) for number in DIRECTIONS]
        )

    def lost(self, name: str, memory: np.ndarray) -> np.ndarray:
        """Return ``bending_friction_loss`` or ``viscous_bending_loss`` [J/m³], 0 without."""
        names = [entry.name for entry in self.memory]
        return memory[names.index(name)] if name in names else np.zeros(np.shape(memory)[1:])


class BendingElement(NamedTuple):
    """A moment that a law remembers: names of its modulus and length, and what drives it.

    place : in what the law remembers of the bending. of_rate : whether time relaxes it.
    """

    place: int
    direction: int
    modulus: str
    length: str
    of_rate: bool


def memory_of(rubs: bool, term_count: int | None) -> tuple[Remembered, ...]:
    """Return what a law with friction, and with so many Maxwell elements, remembers.

    term_count : of each direction, None for a law that does not know the rate.
    """
    entries = [
        Remembered(f"curvature_before_{d}", "1/m", f"curvature along fibres {d} a step before")
        for d in DIRECTIONS
    ]
    if rubs:
        meaning = "moment per width of the friction in bending along fibres"
        entries += [
            Remembered(f"bending_friction_moment_{d}", "N", f"{meaning} {d}") for d in DIRECTIONS
        ]
        meaning = "energy lost to friction in bending, per volume"
        entries.append(Remembered("bending_friction_loss", "J/m3", meaning))
    if term_count is not None:
        meaning = "moment per width that depends on the rate of bending along fibres"
        entries += [
            Remembered(f"viscous_bending_moment_{d}", "N", f"{meaning} {d}") for d in DIRECTIONS
        ]
        meaning = "energy lost to the rate of bending, per volume"
        entries.append(Remembered("viscous_bending_loss", "J/m3", meaning))
        meaning = "moment per width of Maxwell element"
        entries += [
            Remembered(f"relaxing_bending_moment_{d}_{k}", "N", f"{meaning} {k} along fibres {d}")
            for d in DIRECTIONS
            for k in range(1, term_count + 1)
        ]
    return tuple(entries)


def elements_of(rubs: bool, term_count: int | None) -> tuple[BendingElement, ...]:
    """Return the elements of such a law, those of friction first."""
    places = {entry.name: i for i, entry in enumerate(memory_of(rubs, term_count))}
    elements = []
    if rubs:
        elements += [
            BendingElement(
                places[f"bending_friction_moment_{d}"], d,
                f"friction_stiffness_{d}", f"friction_curvature_{d}", False,
            )
            for d in DIRECTIONS
        ]  # fmt: skip
    elements += [
        BendingElement(
            places[f"relaxing_bending_moment_{d}_{k}"], d,
            f"relaxing_stiffness_{d}_{k}", f"bending_time_{d}_{k}", True,
        )
        for d in DIRECTIONS
        for k in range(1, (term_count or 0) + 1)
    ]  # fmt: skip
    return tuple(elements)


# --- compiled -------------------------------------------------------------------------------------


@equation
def dashpot_moment(viscosity, way, size):
    """Return η κ'; nothing where no time passes."""
    return viscosity * way / size if size > 0.0 else 0.0


@equation
def stored_by(moment, modulus):
    """Return what an element stores."""
    return 0.5 * moment * moment / max(modulus, LEAST_MODULUS)


class LosingLaw(Protocol):
    """A class of laws whose bending loses energy: what it remembers of it, and its elements."""

    bending_memory: tuple[Remembered, ...]
    bending_elements: tuple[BendingElement, ...]
    bending_resists_rates: bool


def _places(law_class: type[LosingLaw]) -> dict[str, int]:
    return {entry.name: i for i, entry in enumerate(law_class.bending_memory)}


def _tuple(terms: list[str]) -> str:
    return f"({''.join(f'{term}, ' for term in terms)})"


def _of(
    law_class: type[LosingLaw], direction: int | None, *, of_rate: bool
) -> list[tuple[int, BendingElement]]:
    """Return the elements of a direction with their numbers."""
    return [
        (number, element)
        for number, element in enumerate(law_class.bending_elements)
        if element.of_rate == of_rate and direction in (element.direction, None)
    ]


def _past_text(law_class: type[LosingLaw]) -> str:
    first = place_in_memory(law_class, law_class.bending_memory[0])
    places = [*range(first, first + len(law_class.bending_memory))]
    if law_class.bending_resists_rates:
        places.append(history_count(law_class))
    return "lambda law, history: " + _tuple([f"history[{k}]" for k in places])


@unrolled(_past_text)
def past_numbers(law, history):
    """Return what the law remembers of its bending, and the size of the step if it counts."""


def _moments_text(law_class: type[LosingLaw]) -> str:
    terms = []
    for element in law_class.bending_elements:
        call, passed = ("maxwell_moment", ", past[-1]") if element.of_rate else ("dahl_moment", "")
        parameters = f"law.{element.modulus}, law.{element.length}"
        terms.append(
            f"{call}(past[{element.place}], {parameters}, way_{element.direction}{passed})"
        )
    return "lambda law, past, way_1, way_2: " + _tuple(terms)


@unrolled(_moments_text, maxwell_moment=maxwell_moment, dahl_moment=dahl_moment)
def moments_after(law, past, way_1, way_2):
    """Return the moments of all elements after a step that bends by two curvatures."""


def _friction_text(law_class: type[LosingLaw]) -> str:
    sums = [
        sum_text([f"moments[{k}]" for k, _ in _of(law_class, d, of_rate=False)]) for d in DIRECTIONS
    ]
    return "lambda law, moments: " + _tuple(sums)


@unrolled(_friction_text)
def friction_moments(law, moments):
    """Return the moments of the friction of both directions."""


def _rate_text(law_class: type[LosingLaw]) -> str:
    sums = ["0.0", "0.0"]
    if law_class.bending_resists_rates:
        sums = [
            sum_text(
                [f"dashpot_moment(law.bending_viscosity_{d}, way_{d}, past[-1])"]
                + [f"moments[{k}]" for k, _ in _of(law_class, d, of_rate=True)]
            )
            for d in DIRECTIONS
        ]
    return "lambda law, past, moments, way_1, way_2: " + _tuple(sums)


@unrolled(_rate_text, dashpot_moment=dashpot_moment)
def rate_moments(law, past, moments, way_1, way_2):
    """Return the moments that depend on the rate of both directions."""


def _friction_loss_text(law_class: type[LosingLaw]) -> str:
    terms = [
        f"dahl_loss(past[{e.place}], moments[{k}], law.{e.modulus}, law.{e.length}, "
        f"way_{e.direction})"
        for k, e in _of(law_class, None, of_rate=False)
    ]
    return "lambda law, past, moments, way_1, way_2: " + sum_text(terms)


@unrolled(_friction_loss_text, dahl_loss=dahl_loss)
def friction_loss(law, past, moments, way_1, way_2):
    """Return what the friction takes in a step, per area."""


def _rate_loss_text(law_class: type[LosingLaw]) -> str:
    places, terms = _places(law_class), []
    if law_class.bending_resists_rates:
        terms = [
            f"0.5 * (past[{places[f'viscous_bending_moment_{d}']}] + rates[{d - 1}]) * way_{d}"
            for d in DIRECTIONS
        ]
        terms += [
            f"(stored_by(past[{e.place}], law.{e.modulus})"
            f" - stored_by(moments[{k}], law.{e.modulus}))"
            for k, e in _of(law_class, None, of_rate=True)
        ]
    return "lambda law, past, moments, rates, way_1, way_2: " + sum_text(terms)


@unrolled(_rate_loss_text, stored_by=stored_by)
def rate_loss(law, past, moments, rates, way_1, way_2):
    """Return what the rates take in a step, per area: the work less what is stored more."""


def _packed_text(law_class: type[LosingLaw]) -> str:
    given = {f"curvature_before_{d}": f"curvature_{d}" for d in DIRECTIONS}
    given |= {f"viscous_bending_moment_{d}": f"rates[{d - 1}]" for d in DIRECTIONS}
    for name, lost in (("bending_friction_loss", "rubbed"), ("viscous_bending_loss", "resisted")):
        if name in (places := _places(law_class)):
            given[name] = f"past[{places[name]}] + {lost} * law.per_bending_thickness"
    moments = {
        element.place: f"moments[{k}]" for k, element in enumerate(law_class.bending_elements)
    }
    terms = [given.get(e.name, moments.get(i, "")) for i, e in enumerate(law_class.bending_memory)]
    arguments = "law, past, curvature_1, curvature_2, moments, rates, rubbed, resisted"
    return f"lambda {arguments}: " + _tuple(terms)


@unrolled(_packed_text)
def packed_memory(law, past, curvature_1, curvature_2, moments, rates, rubbed, resisted):
    """Return what the law remembers of its bending, in its order."""


def _stored_text(law_class: type[LosingLaw]) -> str:
    first = place_in_memory(law_class, law_class.bending_memory[0])
    terms = [
        f"stored_by(history[{first + e.place}], law.{e.modulus})"
        for e in law_class.bending_elements
    ]
    return "lambda law, history: " + sum_text(terms)


@unrolled(_stored_text, stored_by=stored_by)
def stored_per_area(law, history):
    """Return what the elements of a history store, per area."""


def _glassy_text(law_class: type[LosingLaw]) -> str:
    sums = []
    for d in DIRECTIONS:
        stiff = [f"2.0 * law.{e.modulus}" for _, e in _of(law_class, d, of_rate=False)]
        sums.append(
            sum_text(stiff + [f"law.{e.modulus}" for _, e in _of(law_class, d, of_rate=True)])
        )
    return "lambda law: " + _tuple(sums)


@unrolled(_glassy_text)
def glassy_stiffnesses(law):
    """Return the stiffnesses of the elements of both directions at most."""


def _viscosity_text(law_class: type[LosingLaw]) -> str:
    if not law_class.bending_resists_rates:
        return "lambda law: None"
    terms = [f"law.bending_viscosity_{d} * law.bending_scale" for d in DIRECTIONS]
    return "lambda law: " + _tuple(terms)


@unrolled(_viscosity_text)
def dashpots(law):
    """Return the viscosities of E11 and E22 linear in ζ; ``None`` without."""


@equation
def lossy_stress(law, S, E, inverse_height, history):
    past = past_numbers(law, history)
    way_1, way_2 = E[0] * inverse_height - past[0], E[1] * inverse_height - past[1]
    moments = moments_after(law, past, way_1, way_2)
    rubbed, rates = friction_moments(law, moments), rate_moments(law, past, moments, way_1, way_2)
    scale = law.bending_scale / inverse_height
    S11, S22 = S[0] + scale * (rubbed[0] + rates[0]), S[1] + scale * (rubbed[1] + rates[1])
    return (S11, S22, S[2], S[3], S[4], S[5])


@equation
def lossy_memory(law, E, inverse_height, history):
    past = past_numbers(law, history)
    curvature_1, curvature_2 = E[0] * inverse_height, E[1] * inverse_height
    way_1, way_2 = curvature_1 - past[0], curvature_2 - past[1]
    moments = moments_after(law, past, way_1, way_2)
    rates = rate_moments(law, past, moments, way_1, way_2)
    rubbed = friction_loss(law, past, moments, way_1, way_2)
    resisted = rate_loss(law, past, moments, rates, way_1, way_2)
    return packed_memory(law, past, curvature_1, curvature_2, moments, rates, rubbed, resisted)


@equation
def lossy_store(law, history):
    return 2.0 * law.bending_scale * stored_per_area(law, history)


@equation
def lossy_bound(law):
    C_B, more = bending_stiffness(law), glassy_stiffnesses(law)
    C11, C22 = C_B[0] + law.bending_scale * more[0], C_B[1] + law.bending_scale * more[1]
    return (C11, C22, C_B[2], C_B[3], C_B[4], C_B[5])


@equation
def lossy_viscosity(law):
    return dashpots(law)


# --- laws -----------------------------------------------------------------------------------------


@made_on_demand(r"(?P<rubs>Friction)?(Relaxing(?P<count>\d+))?Bending(?P<base>\w+)")
def _twin(name: re.Match[str], base: type) -> Any:
    """Return the twin of a class of laws whose bending loses energy."""
    rubs = name["rubs"] is not None
    count = None if name["count"] is None else int(name["count"])
    elements = elements_of(rubs, count)
    fields = ["bending_scale", "per_bending_thickness"]
    fields += [field for element in elements for field in (element.modulus, element.length)]
    if count is not None:
        fields += [f"bending_viscosity_{d}" for d in DIRECTIONS]
    twin = twin_of(
        base,
        name[0].removesuffix(name["base"]),
        about=" and of :class:`BendingLosses`.",
        entries=[(field, float) for field in fields],
        answers={
            with_bending_losses: lossy_stress,
            evolved_bending: lossy_memory,
            stored_bending: lossy_store,
            bending_bound: lossy_bound,
            bending_viscosity: lossy_viscosity,
        },
    )
    twin.bending_memory = memory_of(rubs, count)
    twin.bending_elements = elements
    twin.bending_resists_rates = count is not None
    twin.remembers = remembered(base) + twin.bending_memory
    twin.knows_step = knows_step(base) or count is not None
    return twin


def losing_class(law_class: type, losses: BendingLosses) -> Any:
    """Return the twin of a class of laws that loses energy as stated, see :func:`.twin_of`."""
    prefix = "Friction" if losses.rubs else ""
    if losses.resists_rates:
        prefix += f"Relaxing{losses.term_count}"
    return twin_named(f"{prefix}Bending{law_class.__name__}")


def with_losses(law: LawOrTwin, losses: BendingLosses | None) -> LawOrTwin:
    """Return a law whose bending loses energy, or the law itself where nothing is stated."""
    if losses is None:
        return law
    numbers = {
        "bending_scale": losses.per_stiffness,
        "per_bending_thickness": 1.0 / losses.thickness,
    }
    for d, direction in zip(DIRECTIONS, losses.directions, strict=True):
        friction = direction.friction
        numbers[f"friction_stiffness_{d}"] = 0.0 if friction is None else friction.modulus
        numbers[f"friction_curvature_{d}"] = 1.0 if friction is None else friction.length
        numbers[f"bending_viscosity_{d}"] = direction.viscosity
        missing = losses.term_count - len(direction.terms)
        for k, term in enumerate((*direction.terms, *[Relaxation(0.0, 1.0)] * missing), 1):
            numbers[f"relaxing_stiffness_{d}_{k}"] = term.modulus
            numbers[f"bending_time_{d}_{k}"] = term.time
    twin = losing_class(type(law), losses)
    own_fields = twin._fields[len(law) :]
    return twin(*law, *(float(numbers[field]) for field in own_fields))
