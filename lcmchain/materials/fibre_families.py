"""Fabric of one, two or three families of fibres, at any angles: unidirectional, biaxial, triaxial.

Every family has a direction a in the plane, fixed in the reference. Every pair of families a, b has
an angle φ between them, φ0 at the start. The law reads invariants that are linear in the
Green-Lagrange strain E,

    I_a = a·E a,   g_ab = (2 a·E b - cos φ0 (I_a + I_b)) / sin φ0,

the strain of a family and the shear of a pair. For fibres that keep their length
g_ab = (cos φ - cos φ0) / sin φ0: sin γ for a right angle, and to first order the change γ = φ0 - φ
for any. The energy is a sum of potentials of one invariant each. So stress and tangent are sums
too,

    S = Σ w'(I) ∂I/∂E,   C = Σ w''(I) ∂I/∂E ⊗ ∂I/∂E,

over families, pairs, the compaction E33 of :mod:`.features.compaction` and both transverse shears.
A family has one modulus in tension and one in compression, w' = C I, or points of a measured curve,
linear between them. A pair has the shear polynomial and the locking of :mod:`.features.shear`,
taken at g_ab. The bending C^B is a sum of the same kind. Two families at 0 and 90 degrees whose
fibres are as stiff in compression as in tension are the fabric of :mod:`lcmchain.materials.fabric`.

A unidirectional fabric has one family. What holds it together, stitching and friction, is stated
across its fibres: a modulus in tension, one in compression, and the shear of the line across.

Compression across the fibres may be measured by their spacing d instead of the line across,

    (d² - 1)/2 = I_b - g² / (2 (1 + 2 I_a)),

which does not change where fibres slide along each other (:func:`pressed_together`). It alone is
not linear in the strain. What it adds to stress and tangent lies along the same directions, and
moduli of these directions bound its tangent. Such a fabric has a law of its own
(:class:`SpacedFibreFamiliesLaw`).

The modulus of fibres jumps where they go from tension to compression. The tangent that stabilises
the element always takes the larger one: with it the hourglass energy keeps its potential.

Sources: Schäfer, Mitsch, Kärger, Eqs. (19)-(25) for the forms; invariants of material directions
for unidirectional fabrics, with shear, transverse tension and transverse compression superposed:
Karlsruhe, doi 10.5445/IR/1000174521; up to three families with angle, modulus, and a shear and a
locking angle per pair: LS-DYNA, MAT_249. The invariants and their form here: own.
"""

from __future__ import annotations

import copy
import math
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from lcmchain.dispatch import optional
from lcmchain.jit import equation
from lcmchain.materials.fabric import Fabric
from lcmchain.materials.features.compaction import (
    compaction_stress_and_tangent,
    compaction_tangent_curvature,
    compaction_tangent_slope,
    linear_class,
    linear_where_constant,
)
from lcmchain.materials.features.shear import (
    locking_response,
    locking_tangent_curvature,
    locking_tangent_slope,
    rounded_shear_of,
    shear_stress_and_tangent,
    stabilising_shear_curvature,
    stabilising_shear_slope,
    stabilising_shear_tangent,
)
from lcmchain.materials.law import (
    bending_stiffness,
    hourglass_tangent,
    implements,
    membrane_response,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.materials.stiffness import AlongFibres, in_axes, read_by
from lcmchain.materials.table import ExponentialCompaction, FabricTable
from lcmchain.materials.twins import twin_of
from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    AbsentMeans,
    AcuteAngle,
    Angle,
    ArealMass,
    Density,
    Number,
    PositiveLength,
    PositiveStiffness,
    Range,
    Row,
    SceneModel,
    Stiffness,
    Text,
    wrong,
)

#: Most families of a fabric; as many pairs.
MOST_FAMILIES = 3
#: Families whose directions differ by less are one [rad].
LEAST_ANGLE = math.radians(5.0)
#: Angles this close to those of the axes of the ply lie along lines of the mesh [rad].
ALONG_THE_MESH = 1e-6

#: Points of a curve at most, the first at zero left out.
MOST_POINTS = 5
# Kinks of a curve: its points but the last, beyond which it goes on straight.
KINKS = MOST_POINTS - 1
# Numbers of a family in the law: what reads its strain from (E11, E22, 2 E12), modulus in tension
# and compression at the start, whether it is of fibres, bending modulus, the largest modulus that
# it comes to; kinks in tension and how much the modulus grows there, the same in compression.
# Those of a pair: what reads its shear, the polynomial, where it locks when the angle closes and
# how, the same when it opens, torsion.
FAMILY = 8 + 4 * KINKS
PAIR = 13
SIZE = MOST_FAMILIES * (FAMILY + PAIR)
# No strain comes so far: a pair that does not lock, a curve without that kink.
NEVER = 1e3


class FibreFamiliesLaw(NamedTuple):
    """Parameters [Pa]: ``plane`` (SIZE,) of the families and pairs, the others as of a fabric."""

    plane: np.ndarray
    C23: float
    C13: float
    c0: float
    c1: float
    c2: float
    B33: float
    B23: float
    B13: float


class PairShear(NamedTuple):
    """Shear law of a pair: the polynomial of Eq. (21), and locking on both sides.

    closed, opened : sizes of g_ab from which on it locks when the angle has become smaller, and
    larger; their growths are those of :class:`.shear.ShearLocking`.
    """

    s0: Any
    s1: Any
    s2: Any
    s3: Any
    s4: Any
    closed: Any
    closed_growth: Any
    opened: Any
    opened_growth: Any


# --- compiled -------------------------------------------------------------------------------------


@implements(locking_response, PairShear)
@equation
def pair_locking(pair, g):
    closed, opened = max(g - pair.closed, 0.0), max(-g - pair.opened, 0.0)
    on_closed = pair.closed_growth * closed * closed
    on_opened = pair.opened_growth * opened * opened
    return on_closed * closed / 3.0 - on_opened * opened / 3.0, on_closed + on_opened


@implements(locking_tangent_slope, PairShear)
@equation
def pair_locking_slope(pair, g):
    closed, opened = max(g - pair.closed, 0.0), max(-g - pair.opened, 0.0)
    return 2.0 * pair.closed_growth * closed - 2.0 * pair.opened_growth * opened


@implements(locking_tangent_curvature, PairShear)
@equation
def pair_locking_curvature(pair, g):
    closed = 2.0 * pair.closed_growth if g > pair.closed else 0.0
    return closed + (2.0 * pair.opened_growth if -g > pair.opened else 0.0)


@equation
def pair_shear(law, k):
    """Return the shear law of pair k."""
    i, v = MOST_FAMILIES * FAMILY + k * PAIR + 3, law.plane
    return PairShear(
        v[i], v[i + 1], v[i + 2], v[i + 3], v[i + 4], v[i + 5], v[i + 6], v[i + 7], v[i + 8]
    )


@equation
def three_at(law, first, stride):
    """Return three numbers of the law, ``stride`` apart."""
    v = law.plane
    return (v[first], v[first + stride], v[first + 2 * stride])


@equation
def reader(law, i):
    """Return what reads an invariant from (E11, E22, 2 E12)."""
    return (law.plane[i], law.plane[i + 1], law.plane[i + 2])


@equation
def family_readers(law):
    return (reader(law, 0), reader(law, FAMILY), reader(law, 2 * FAMILY))


@equation
def pair_readers(law):
    first = MOST_FAMILIES * FAMILY
    return (reader(law, first), reader(law, first + PAIR), reader(law, first + 2 * PAIR))


@equation
def chosen_modulus(tension, compression, strain):
    return tension if strain >= 0.0 else compression


@equation
def kinks_at(v, i, x):
    """Return Σ d max(x - x_j, 0) over the kinks at ``i``, and the Σ d of those below x."""
    a, b = max(x - v[i], 0.0), max(x - v[i + 1], 0.0)
    c, d = max(x - v[i + 2], 0.0), max(x - v[i + 3], 0.0)
    stress = v[i + 4] * a + v[i + 5] * b + v[i + 6] * c + v[i + 7] * d
    slope = v[i + 4] if a > 0.0 else 0.0
    slope += v[i + 5] if b > 0.0 else 0.0
    slope += v[i + 6] if c > 0.0 else 0.0
    slope += v[i + 7] if d > 0.0 else 0.0
    return stress, slope


@equation
def fibre_response(law, k, strain):
    """Return w' and w'' of a family."""
    v, i = law.plane, k * FAMILY
    pulled, stiffer = kinks_at(v, i + 8, strain)
    pushed, harder = kinks_at(v, i + 8 + 2 * KINKS, -strain)
    modulus = chosen_modulus(v[i + 3], v[i + 4], strain)
    return modulus * strain + (pulled - pushed), modulus + (stiffer + harder)


@equation
def stiffness_of(law, normal, largest, shear, C33, C23, C13):
    """Return a stiffness or its derivative along the directions of a law."""
    return AlongFibres(
        normal, largest, shear, C33, C23, C13,
        three_at(law, 5, FAMILY), family_readers(law), pair_readers(law),
    )  # fmt: skip


@equation
def larger_moduli(law):
    """Return the largest moduli that the families come to."""
    return three_at(law, 7, FAMILY)


@optional
def with_spacing(law, E, a, b, n, m, s, k):
    """Return w' and w'' of families and pairs, with what fibres bear that are pressed together.

    Of a law whose line across bears all compression itself they are as they are.
    """
    return n, m, s, k


@equation
def pressed_together(law, E, a, b, n, m, s, k):
    """Return them where the spacing of the fibres bears the compression across them."""
    grown = 1.0 + 2.0 * read_by(a[0], E)
    g = read_by(b[0], E)
    turn = g / grown
    line = read_by(a[1], E)
    pulled, _ = fibre_response(law, 1, max(line, 0.0))
    spaced = min(line - 0.5 * g * turn, 0.0)
    pressed, harder = fibre_response(law, 1, spaced)
    harder = harder if spaced < 0.0 else 0.0
    stress = (n[0] + pressed * turn * turn, pulled + pressed, n[2])
    # a term k (x - turn y)² is at most 2 k (x² + (turn y)²)
    tangent = (m[0], max(m[1], 2.0 * harder), m[2])
    shear = (s[0] - pressed * turn, s[1], s[2])
    modulus = (k[0] - pressed / grown + 2.0 * harder * turn * turn, k[1], k[2])
    return stress, tangent, shear, modulus


@optional
def larger_across(law, moduli):
    """Return the largest moduli of directions that bound the step."""
    return moduli


@equation
def larger_spacing(law, moduli):
    return (moduli[0], 2.0 * moduli[1], moduli[2])


@implements(membrane_response, FibreFamiliesLaw)
@equation
def families_response(law, E, history):
    """Return the stress S^M and the tangent C^M of the centre strain."""
    a, b = family_readers(law), pair_readers(law)
    n0, m0 = fibre_response(law, 0, read_by(a[0], E))
    n1, m1 = fibre_response(law, 1, read_by(a[1], E))
    n2, m2 = fibre_response(law, 2, read_by(a[2], E))
    s0, k0 = shear_stress_and_tangent(pair_shear(law, 0), read_by(b[0], E))
    s1, k1 = shear_stress_and_tangent(pair_shear(law, 1), read_by(b[1], E))
    s2, k2 = shear_stress_and_tangent(pair_shear(law, 2), read_by(b[2], E))
    n, m, s, k = with_spacing(law, E, a, b, (n0, n1, n2), (m0, m1, m2), (s0, s1, s2), (k0, k1, k2))
    S33, C33 = compaction_stress_and_tangent(law, E[2])
    S = (
        in_axes(a, n, b, s, 0),
        in_axes(a, n, b, s, 1),
        S33,
        in_axes(a, n, b, s, 2),
        law.C23 * E[4],
        law.C13 * E[5],
    )
    largest = larger_across(law, larger_moduli(law))
    C = stiffness_of(law, m, largest, k, C33, law.C23, law.C13)
    return S, C


@implements(hourglass_tangent, FibreFamiliesLaw)
@equation
def families_hourglass_tangent(law, E, C_M, history):
    b = C_M.between
    shear = (
        stabilising_shear_tangent(pair_shear(law, 0), read_by(b[0], E)),
        stabilising_shear_tangent(pair_shear(law, 1), read_by(b[1], E)),
        stabilising_shear_tangent(pair_shear(law, 2), read_by(b[2], E)),
    )
    largest = larger_moduli(law)
    return stiffness_of(law, largest, largest, shear, C_M.C33, C_M.C23, C_M.C13)


@implements(tangent_slope, FibreFamiliesLaw)
@equation
def families_slope(law, E, history):
    """Return dm/dI of the moduli m of pairs and of the compaction; those of fibres are constant."""
    b = pair_readers(law)
    shear = (
        stabilising_shear_slope(pair_shear(law, 0), read_by(b[0], E)),
        stabilising_shear_slope(pair_shear(law, 1), read_by(b[1], E)),
        stabilising_shear_slope(pair_shear(law, 2), read_by(b[2], E)),
    )
    slope33 = compaction_tangent_slope(law, E[2])
    return stiffness_of(law, None, None, shear, slope33, None, None)


@implements(tangent_curvature, FibreFamiliesLaw)
@equation
def families_curvature(law, E, history):
    """Return d²m/dI² as :func:`families_slope`."""
    b = pair_readers(law)
    shear = (
        stabilising_shear_curvature(pair_shear(law, 0), read_by(b[0], E)),
        stabilising_shear_curvature(pair_shear(law, 1), read_by(b[1], E)),
        stabilising_shear_curvature(pair_shear(law, 2), read_by(b[2], E)),
    )
    curvature33 = compaction_tangent_curvature(law, E[2])
    return stiffness_of(law, None, None, shear, curvature33, None, None)


@implements(bending_stiffness, FibreFamiliesLaw)
@equation
def families_bending_stiffness(law):
    normal = three_at(law, 6, FAMILY)
    torsion = three_at(law, MOST_FAMILIES * FAMILY + PAIR - 1, PAIR)
    return stiffness_of(law, normal, normal, torsion, law.B33, law.B23, law.B13)


SpacedFibreFamiliesLaw = twin_of(
    FibreFamiliesLaw,
    "Spaced",
    about=", of a single family whose spacing bears the compression across it.",
    answers={with_spacing: pressed_together, larger_across: larger_spacing},
)
LinearFibreFamiliesLaw = linear_class(FibreFamiliesLaw)
LinearSpacedFibreFamiliesLaw = linear_class(SpacedFibreFamiliesLaw)


# --- plain Python ---------------------------------------------------------------------------------


class Side(NamedTuple):
    """What a family resists in tension, or in compression: its modulus, and where that grows.

    modulus : at the start [Pa]. kinks : sizes of a·E a (n,). growth : of the modulus there [Pa].
    """

    modulus: float
    kinks: tuple[float, ...] = ()
    growth: tuple[float, ...] = ()

    @property
    def largest(self) -> float:
        """Largest modulus that it comes to [Pa]."""
        return max(self.modulus + total for total in np.cumsum([0.0, *self.growth]).tolist())

    @property
    def smallest(self) -> float:
        """Smallest modulus that it comes to [Pa]."""
        return min(self.modulus + total for total in np.cumsum([0.0, *self.growth]).tolist())

    def times(self, factor: float) -> Side:
        """Return it with all moduli times a factor."""
        return Side(
            factor * self.modulus, self.kinks, tuple(factor * value for value in self.growth)
        )

    def numbers(self) -> list[float]:
        """Return the kinks and growths (2 KINKS,) of the law."""
        rest = KINKS - len(self.kinks)
        return [*self.kinks, *[NEVER] * rest, *self.growth, *[0.0] * rest]

    def response(self, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stress, modulus and energy density at sizes of the strain, in NumPy."""
        x = np.maximum(size, 0.0)
        stress, modulus = self.modulus * x, np.full_like(x, self.modulus)
        energy = 0.5 * self.modulus * x**2
        for kink, growth in zip(self.kinks, self.growth, strict=True):
            beyond = np.maximum(x - kink, 0.0)
            stress = stress + growth * beyond
            modulus = modulus + np.where(beyond > 0.0, growth, 0.0)
            energy = energy + 0.5 * growth * beyond**2
        return stress, modulus, energy

    @classmethod
    def of_curve(cls, strain: tuple[float, ...], stress: tuple[float, ...], sign: float) -> Side:
        """Return it from points of a test: sizes of engineering strain and nominal stress [Pa].

        sign : 1 in tension, -1 in compression. With the stretch λ the strain is (λ² - 1)/2 and the
        second Piola-Kirchhoff stress the nominal one over λ.
        """
        stretch = 1.0 + sign * np.array([0.0, *strain])
        E, S = 0.5 * np.abs(stretch**2 - 1.0), np.array([0.0, *stress]) / stretch
        slope = np.diff(S) / np.diff(E)
        return cls(float(slope[0]), tuple(E[1:-1].tolist()), tuple(np.diff(slope).tolist()))


class Family(NamedTuple):
    """A family of fibres, or what holds a unidirectional fabric across them.

    angle : from axis 1 of the ply [rad]. tension, compression : what it resists.
    bending : modulus [Pa]. is_fibre : whether these are fibres.
    """

    angle: float
    tension: Side
    compression: Side
    bending: float
    is_fibre: bool = True

    @property
    def largest(self) -> float:
        """Largest modulus that it comes to [Pa]."""
        return max(self.tension.largest, self.compression.largest)

    @property
    def buckles(self) -> bool:
        """Whether it is softer in compression than in tension."""
        return self.compression.largest < self.tension.largest

    def response(self, strain: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return w', w'' and w at strains a·E a, in NumPy."""
        pulled, pushed = self.tension.response(strain), self.compression.response(-strain)
        there = strain >= 0.0
        return (
            pulled[0] - pushed[0], np.where(there, pulled[1], pushed[1]), pulled[2] + pushed[2]
        )  # fmt: skip

    def numbers(self) -> list[float]:
        """Return the numbers (FAMILY,) of the law."""
        t, c = self.tension, self.compression
        return [
            *self.reader, t.modulus, c.modulus, float(self.is_fibre), self.bending, self.largest,
            *t.numbers(), *c.numbers(),
        ]  # fmt: skip

    @property
    def reader(self) -> np.ndarray:
        """What reads a·E a from (E11, E22, 2 E12), (3,)."""
        c, s = direction_of(self.angle)
        return np.array([c * c, s * s, c * s])


class Pair(NamedTuple):
    """Shear between two families.

    polynomial : s0 ... s4 [Pa]. torsion : bending modulus of the shear [Pa].
    locking_angle : change of the angle [rad], None for none; locking_stiffness : as of a fabric.
    """

    first: Family
    second: Family
    polynomial: tuple[float, ...]
    torsion: float
    locking_angle: float | None = None
    locking_stiffness: float = 0.0

    @property
    def initial_angle(self) -> float:
        """From the first family to the second about the normal, in (0, π) [rad]."""
        return (self.second.angle - self.first.angle) % math.pi

    @property
    def reader(self) -> np.ndarray:
        """What reads g_ab from (E11, E22, 2 E12), (3,)."""
        c, s = direction_of(self.first.angle)
        d, t = direction_of(self.first.angle + self.initial_angle)
        cos, sin = direction_of(self.initial_angle)
        both = np.array([2.0 * c * d, 2.0 * s * t, c * t + s * d])
        lengths = np.array([c * c + d * d, s * s + t * t, c * s + d * t])
        return (both - cos * lengths) / sin

    def strain_of(self, change: ArrayLike) -> np.ndarray:
        """Return g_ab where the angle has become smaller by ``change`` [rad] at constant length."""
        cos, sin = direction_of(self.initial_angle)
        return np.sin(change) + cos / sin * (np.cos(change) - 1.0)

    @property
    def most_closed(self) -> float:
        """g_ab where the families lie on each other."""
        return math.tan(0.5 * self.initial_angle)

    @property
    def most_opened(self) -> float:
        """Size of g_ab where they lie on each other the other way round."""
        return 1.0 / math.tan(0.5 * self.initial_angle)

    def locking(self) -> tuple[float, float, float, float]:
        """Return where it locks when closing, the growth, and the same when opening."""
        if self.locking_angle is None:
            return NEVER, 0.0, NEVER, 0.0
        closed = float(self.strain_of(self.locking_angle))
        opened = -float(self.strain_of(-self.locking_angle))
        stiffness = self.locking_stiffness
        # a right angle has the full shear 1 on both sides, to the last digit
        right = self.initial_angle == 0.5 * math.pi
        ends = (1.0, 1.0) if right else (self.most_closed, self.most_opened)
        return (
            closed, stiffness / (ends[0] - closed) ** 2,
            opened, stiffness / (ends[1] - opened) ** 2,
        )  # fmt: skip

    def numbers(self) -> list[float]:
        """Return the numbers (PAIR,) of the law."""
        return [*self.reader, *self.polynomial, *self.locking(), self.torsion]


def direction_of(angle: float) -> tuple[float, float]:
    """Return cosine and sine of an angle, exact zeros along the axes."""
    c, s = math.cos(angle), math.sin(angle)
    if abs(c) < 1e-15:
        return 0.0, math.copysign(1.0, s)
    if abs(s) < 1e-15:
        return math.copysign(1.0, c), 0.0
    return c, s


class Terms(NamedTuple):
    """Moduli that stabilise an element, each of one invariant that is linear in the strain.

    readers : (T, 6), what reads the invariants from a strain. modulus, slope, curvature : (..., T),
    of each modulus with its own invariant. fibre : (T,), 1 where a share of the fibres is meant.
    """

    readers: np.ndarray
    modulus: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    fibre: np.ndarray


class FibreFamilies(Fabric):
    """A fabric of families; plain NumPy, written apart from the compiled law.

    Parameters
    ----------
    families : one to three. across : what holds one family together, None for more of them.
    pairs : shear of pairs of families, of a single one with what is across.
    out_of_plane : C23, C13, c0, c1, c2, B33, B23, B13 by name [Pa].
    in_plane_bending : as of :class:`lcmchain.materials.fabric.Fabric`, of the families along the
        axes of the ply.
    spaced : whether the spacing of the fibres of a single family bears the compression across it.
    """

    law: Any  # of class FibreFamiliesLaw
    is_diagonal = False

    def __init__(
        self,
        families: tuple[Family, ...],
        across: Family | None,
        pairs: tuple[Pair, ...],
        out_of_plane: dict[str, float],
        *,
        thickness: float,
        areal_mass: float,
        fibre_density: float | None,
        name: str = "fibre families",
        shear_range: float | None = None,
        in_plane_bending: float = 0.0,
        spaced: bool = False,
    ) -> None:
        self.families = families
        self.spaced = spaced
        self.normal = families if across is None else (*families, across)
        self.pairs = pairs
        values = np.zeros(SIZE)
        for k, family in enumerate(self.normal):
            values[k * FAMILY : (k + 1) * FAMILY] = family.numbers()
        for k, pair in enumerate(pairs):
            first = MOST_FAMILIES * FAMILY + k * PAIR
            values[first : first + PAIR] = pair.numbers()
        law_class = SpacedFibreFamiliesLaw if spaced else FibreFamiliesLaw
        law = law_class(plane=values, **out_of_plane)
        self.law = linear_where_constant(law)
        self.shear_range = shear_range
        inertia = in_plane_bending * thickness**3 / 12.0
        self.fibre_bending = (
            inertia * self._bending_along(0.0), inertia * self._bending_along(0.5 * math.pi)
        )  # fmt: skip
        self.thickness = thickness
        self.areal_mass = areal_mass
        self.density = areal_mass / thickness
        self.fibre_density = fibre_density
        self.name = name

    @property
    def fibre_angles(self) -> tuple[float, ...]:
        """Angle of every family from axis 1 of the ply [rad]."""
        return tuple(family.angle for family in self.families)

    @property
    def buckles(self) -> bool:
        """Whether fibres are softer in compression than in tension."""
        return any(family.buckles for family in self.families)

    @property
    def locks(self) -> bool:
        return any(pair.locking_angle is not None for pair in self.pairs)

    @property
    def locking_angles(self) -> tuple[float | None, ...]:
        """Change of its angle from which on every pair locks [rad], None where it never does."""
        pair_of = {
            frozenset((self.normal.index(pair.first), self.normal.index(pair.second))): pair
            for pair in self.pairs
        }
        order = [frozenset(numbers) for numbers in ((0, 1), (1, 2), (2, 0))]
        return tuple(pair_of[n].locking_angle if n in pair_of else None for n in order)

    def with_fibre_modulus(self, factor: float) -> Self:
        """Return the fabric with the moduli of its fibres in the membrane times a factor."""

        def softer(family: Family) -> Family:
            if not family.is_fibre:
                return family
            return family._replace(
                tension=family.tension.times(factor), compression=family.compression.times(factor)
            )

        changed = copy.copy(self)
        changed.families = tuple(softer(family) for family in self.families)
        changed.normal = tuple(softer(family) for family in self.normal)
        changed.pairs = tuple(
            pair._replace(
                first=changed.normal[self.normal.index(pair.first)],
                second=changed.normal[self.normal.index(pair.second)],
            )
            for pair in self.pairs
        )
        plane = self.law.plane.copy()
        for k, family in enumerate(changed.normal):
            plane[k * FAMILY : (k + 1) * FAMILY] = family.numbers()
        changed.law = self.law._replace(plane=plane)
        changed.fibre_modulus_factor = factor * self.fibre_modulus_factor
        return changed

    def stress_and_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M (..., 6) and the tangent C^M (..., 6, 6) for strains E (..., 6)."""
        E = np.asarray(E)
        S, C = np.zeros_like(E), np.zeros((*E.shape, 6))
        for family in self._by_their_length:
            read = in_voigt(family.reader)
            _add(S, C, read, *family.response(E @ read)[:2])
        for pair in self.pairs:
            read = in_voigt(pair.reader)
            _add(S, C, read, *_shear_of(pair, E @ read)[:2])
        if self.spaced:
            strain, slope, curvature = self._spacing(E)
            stress, modulus, _ = self.normal[1].response(np.minimum(strain, 0.0))
            modulus = np.where(strain < 0.0, modulus, 0.0)
            S += stress[..., None] * slope
            C += modulus[..., None, None] * slope[..., :, None] * slope[..., None, :]
            C += stress[..., None, None] * curvature
        for row, stiffness in ((4, self.law.C23), (5, self.law.C13)):
            S[..., row] = stiffness * E[..., row]
            C[..., row, row] = stiffness
        S[..., 2], C[..., 2, 2] = self._compaction(E[..., 2])
        return S, C

    @property
    def _by_their_length(self) -> tuple[Family, ...]:
        """Directions whose own strain says what they bear, in compression too unless spaced."""
        if not self.spaced:
            return self.normal
        fibres, across = self.normal
        return fibres, across._replace(compression=Side(0.0))

    def _spacing(self, E: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the strain of the spacing of the fibres, its slope (..., 6) and curvature.

        With the square 1 + 2 I_a of the stretch along the fibres it is I_b - g²/(2 (1 + 2 I_a)).
        """
        along, across = (in_voigt(family.reader) for family in self.normal)
        shear = in_voigt(self.pairs[0].reader)
        grown = (1.0 + 2.0 * (E @ along))[..., None]
        turn = (E @ shear)[..., None] / grown
        strain = E @ across - 0.5 * (turn**2 * grown)[..., 0]
        way = shear - 2.0 * turn * along
        slope = across - turn * shear + turn**2 * along
        curvature = -way[..., :, None] * way[..., None, :] / grown[..., None]
        return strain, slope, curvature

    def stabilising_terms(self, E: ArrayLike) -> Terms:
        """Return the moduli that stabilise the element at strains E (..., 6)."""
        E = np.asarray(E, dtype=float)
        zero = np.zeros(E.shape[:-1])
        readers, fibre, modulus, slope, curvature = [], [], [], [], []
        for family in self.normal:
            readers.append(in_voigt(family.reader))
            fibre.append(float(family.is_fibre))
            modulus.append(zero + family.largest)
            slope.append(zero)
            curvature.append(zero)
        for pair in self.pairs:
            read = in_voigt(pair.reader)
            size, first, second = rounded_shear_of(E @ read)
            _, tangent, rise, bend = _shear_of(pair, size)
            readers.append(read)
            fibre.append(0.0)
            modulus.append(tangent)
            slope.append(first * rise)
            curvature.append(first**2 * bend + second * rise)
        e33 = E[..., 2]
        unit = np.eye(6)
        for row, values in (
            (2, (self._compaction(e33)[1], self._compaction_slope(e33),
                 self._compaction_curvature(e33))),
            (4, (zero + self.law.C23, zero, zero)),
            (5, (zero + self.law.C13, zero, zero)),
        ):  # fmt: skip
            readers.append(unit[row])
            fibre.append(0.0)
            for one, value in zip((modulus, slope, curvature), values, strict=True):
                one.append(value)
        return Terms(
            np.array(readers),
            np.stack(modulus, axis=-1),
            np.stack(slope, axis=-1),
            np.stack(curvature, axis=-1),
            np.array(fibre),
        )

    def stabilising_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the stabilising tangent (..., 6, 6), and dC_ii/dE_i, d²C_ii/dE_i² (..., 6)."""
        terms = self.stabilising_terms(E)
        r = terms.readers
        C = np.einsum("...t,ti,tj->...ij", terms.modulus, r, r)
        return C, terms.slope @ r**3, terms.curvature @ r**4

    def tangent_slope(self, E: ArrayLike) -> np.ndarray:
        """Return dC_ii/dE_i (..., 6) of the stabilising tangent."""
        return self.stabilising_tangent(E)[1]

    def tangent_curvature(self, E: ArrayLike) -> np.ndarray:
        """Return d²C_ii/dE_i² (..., 6) of the stabilising tangent."""
        return self.stabilising_tangent(E)[2]

    def bending_matrix(self) -> np.ndarray:
        """Return C^B (6, 6)."""
        law = self.law
        C = np.diag([0.0, 0.0, law.B33, 0.0, law.B23, law.B13])
        for reader, modulus in [(family.reader, family.bending) for family in self.normal] + [
            (pair.reader, pair.torsion) for pair in self.pairs
        ]:
            read = in_voigt(reader)
            C += modulus * np.outer(read, read)
        return C

    def _energy_in_plane(self, E: ArrayLike) -> np.ndarray:
        """Return W^M without that of the compaction."""
        E = np.asarray(E)
        law = self.law
        energy = 0.5 * (law.C23 * E[..., 4] ** 2 + law.C13 * E[..., 5] ** 2)
        for family in self._by_their_length:
            energy = energy + family.response(E @ in_voigt(family.reader))[2]
        if self.spaced:
            strain = np.minimum(self._spacing(E)[0], 0.0)
            energy = energy + self.normal[1].response(strain)[2]
        for pair in self.pairs:
            g = E @ in_voigt(pair.reader)
            e12 = 0.5 * np.abs(g)
            for i, s in enumerate(pair.polynomial):
                energy = energy + 4.0 * s * e12 ** (i + 2) / (i + 2)
            closed, closed_growth, opened, opened_growth = pair.locking()
            energy = energy + closed_growth * np.maximum(g - closed, 0.0) ** 4 / 12.0
            energy = energy + opened_growth * np.maximum(-g - opened, 0.0) ** 4 / 12.0
        return energy

    def wave_stiffness(self) -> tuple[float, float]:
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa].

        In the plane that of a strain that all waves across an element may have at once; with fibres
        along the axes it is their modulus.
        """
        law = self.law
        largest = 0.0
        for bends in (False, True):
            C = np.zeros((3, 3))
            for family in self.normal:
                modulus = family.bending if bends else family.largest
                C += modulus * np.outer(family.reader, family.reader)
            # the shear strain has parts of two directions
            C[2] *= math.sqrt(2.0)
            C[:, 2] *= math.sqrt(2.0)
            largest = max(largest, float(np.linalg.eigvalsh(C)[-1]))
        return largest, max(law.c0, law.B33)

    def _bending_along(self, angle: float) -> float:
        """Return the bending modulus of the fibres along lines of the mesh, 0 without such."""
        apart = (
            (family.bending, abs(math.remainder(family.angle - angle, math.pi)))
            for family in self.families
        )
        return sum(bending for bending, off in apart if off < ALONG_THE_MESH)


def in_voigt(reader: np.ndarray) -> np.ndarray:
    """Return what reads an invariant from a strain (6,) from that of the plane (3,)."""
    return np.array([reader[0], reader[1], 0.0, reader[2], 0.0, 0.0])


def _add(S, C, read, stress, tangent):
    S += stress[..., None] * read
    C += tangent[..., None, None] * np.outer(read, read)


def _shear_of(pair: Pair, g: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return stress, tangent, its slope and curvature of a pair at g_ab."""
    s = np.array(pair.polynomial)
    of_tangent = s * np.arange(1, 6)
    e12, sign = 0.5 * np.abs(g), np.where(g >= 0.0, 1.0, -1.0)
    value = np.polynomial.polynomial.polyval
    stress = value(e12, s) * g
    tangent = value(e12, of_tangent)
    slope = 0.5 * sign * value(e12, of_tangent[1:] * np.arange(1, 5))
    curvature = 0.25 * value(e12, of_tangent[2:] * np.array([2.0, 6.0, 12.0]))
    closed, closed_growth, opened, opened_growth = pair.locking()
    for side, start, growth in ((1.0, closed, closed_growth), (-1.0, opened, opened_growth)):
        x = np.maximum(side * g - start, 0.0)
        stress = stress + side * growth * x**3 / 3.0
        tangent = tangent + growth * x**2
        slope = slope + side * 2.0 * growth * x
        curvature = curvature + np.where(x > 0.0, 2.0 * growth, 0.0)
    return stress, tangent, slope, curvature


# --- scene ----------------------------------------------------------------------------------------


class FibreCurve(SceneModel):
    """Stress over strain of a test by points from zero; beyond the last it goes on straight."""

    strain: Annotated[
        tuple[Annotated[float, Number(0.01, Range(0.0, 1.0, (0.0, 1.0)))], ...],
        Row("[0.002, 0.01]", minimum_count=1, entries="strains", units=False),
    ] = Field(
        description=f"Sizes of the engineering strain at the points, rising, {MOST_POINTS} at most."
    )
    stress: Annotated[
        tuple[PositiveStiffness, ...], Row('"0.4 6 MPa"', minimum_count=1, entries="stresses")
    ] = Field(description="Force over the initial section at these strains, rising.")

    @model_validator(mode="after")
    def _check_points(self) -> Self:
        if len(self.strain) != len(self.stress):
            raise wrong(
                f"has {len(self.stress)} stresses for {len(self.strain)} strains; give one for "
                "each",
                field="stress",
            )
        if len(self.strain) > MOST_POINTS:
            raise wrong(f"has {len(self.strain)} points; at most {MOST_POINTS}", field="strain")
        rise = np.diff([0.0, *self.strain]), np.diff([0.0, *self.stress])
        for name, values in zip(("strain", "stress"), rise, strict=True):
            if values.min() <= 0.0:
                number = int(np.argmax(values <= 0.0)) + 1
                raise wrong(f"does not rise at point {number}", field=name)
        return self


class AlongDirection(SceneModel):
    """What a direction resists in tension and in compression."""

    tension: Annotated[PositiveStiffness | None, AbsentMeans("tension_curve")] = Field(
        default=None, description="Modulus in tension."
    )
    tension_curve: Annotated[FibreCurve | None, AbsentMeans("tension is constant")] = Field(
        default=None, description="Measured tension, in place of a modulus."
    )
    compression: Annotated[PositiveStiffness | None, AbsentMeans("compression_curve")] = Field(
        default=None,
        description="Modulus in compression; of fibres that buckle a small part of that in "
        "tension, else the same.",
    )
    compression_curve: Annotated[FibreCurve | None, AbsentMeans("compression is constant")] = Field(
        default=None, description="Measured compression, in place of a modulus."
    )

    @model_validator(mode="after")
    def _check_sides(self) -> Self:
        for name in ("tension", "compression"):
            modulus, curve = getattr(self, name), getattr(self, f"{name}_curve")
            if modulus is None and curve is None:
                raise wrong(
                    f"is missing; give a modulus, or a {name}_curve"
                    + (
                        ": fibres that buckle have a small part of that in tension"
                        if name == "compression"
                        else ""
                    ),
                    field=name,
                )
            if modulus is not None and curve is not None:
                raise wrong(f"stands beside {name}; leave one of them out", field=f"{name}_curve")
            if curve is not None and self.side(name).smallest <= 0.0:
                raise wrong(
                    "rises more slowly than the section changes: the stress on the present fibres "
                    "falls; check the points",
                    field=f"{name}_curve",
                )
        return self

    def side(self, name: str) -> Side:
        """Return what it resists in ``tension`` or ``compression``."""
        curve = getattr(self, f"{name}_curve")
        if curve is None:
            return Side(getattr(self, name))
        return Side.of_curve(curve.strain, curve.stress, 1.0 if name == "tension" else -1.0)


class FibreFamilyTable(AlongDirection):
    """A family of fibres: its direction in the ply, and what its fibres resist."""

    angle: Angle = Field(description="Angle from the first axis of the ply to the fibres.")
    bending: PositiveStiffness = Field(description="Bending stiffness of the fibres.")


class ShearOfPair(SceneModel):
    """Shear over the change of the angle between two directions."""

    shear_polynomial: Annotated[
        tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness],
        Row('"0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa"', count=5, entries="coefficients"),
    ] = Field(description="s0 ... s4 of the shear stiffness over half the shear strain, Eq. (21).")
    torsion: Annotated[PositiveStiffness | None, AbsentMeans("no torsional stiffness")] = Field(
        default=None, description="Torsional stiffness."
    )
    locking_angle: Annotated[AcuteAngle | None, AbsentMeans("the pair does not lock")] = Field(
        default=None, description="Change of the angle from which on the fabric locks."
    )
    locking_stiffness: Annotated[
        PositiveStiffness | None, AbsentMeans("the pair does not lock")
    ] = Field(
        default=None,
        description="Shear stiffness gained by locking until both directions lie on each other.",
    )

    @model_validator(mode="after")
    def _check_locking(self) -> Self:
        given = {"locking_angle": self.locking_angle, "locking_stiffness": self.locking_stiffness}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == 1:
            other = next(name for name in given if name not in missing)
            raise wrong(f"is needed together with {other}", field=missing[0])
        return self

    def pair(self, first: Family, second: Family) -> Pair:
        """Return the pair of two directions."""
        return Pair(
            first, second, self.shear_polynomial, self.torsion or 0.0,
            self.locking_angle, self.locking_stiffness or 0.0,
        )  # fmt: skip

    def fault(self, pair: Pair) -> tuple[str, str] | None:
        """Return the entry that a pair makes wrong and what is wrong, None where nothing is."""
        room = min(pair.initial_angle, math.pi - pair.initial_angle)
        if self.locking_angle is not None and self.locking_angle >= room:
            return (
                "locking_angle",
                f"is {math.degrees(self.locking_angle):.4g} deg, but the families lie on each "
                f"other after {math.degrees(room):.4g} deg; it must be smaller",
            )
        strain = np.linspace(0.0, max(pair.most_closed, pair.most_opened), 2001)
        tangent = _shear_of(pair._replace(locking_angle=None), strain)[1]
        if tangent.min() <= 0.0:
            falls = float(strain[np.argmax(tangent <= 0.0)])
            return (
                "shear_polynomial",
                f"gives a falling shear stress from a shear strain of {falls:.3g} "
                f"(tangent {float(tangent.min()) * 1e-6:.3g} MPa); it must rise until both "
                f"directions lie on each other, {strain[-1]:.3g}: check signs, order (s0 first) "
                "and units",
            )
        return None


class ShearOfFamilies(ShearOfPair):
    """Shear over the change of the angle between two families of fibres."""

    between: Annotated[
        tuple[
            Annotated[int, Number(1, Range(1, MOST_FAMILIES), whole=True)],
            Annotated[int, Number(2, Range(1, MOST_FAMILIES), whole=True)],
        ],
        Row("[1, 2]", count=2, entries="numbers of families", units=False),
    ] = Field(description="Numbers of the two families, in the order of `fibres`, from 1.")


class AcrossFibres(AlongDirection, ShearOfPair):
    """What holds a unidirectional fabric together across its fibres: stitching and friction."""

    bending: PositiveStiffness = Field(description="Bending stiffness across the fibres.")
    compressed: Literal["line", "spacing"] = Field(
        default="line",
        description="What compression is measured by: the length of the line across, or the "
        "spacing of the fibres, which sliding along each other leaves as it is.",
    )


class FamiliesMembrane(SceneModel):
    """Transverse shear stiffness in the axes of the ply."""

    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")
    shear_range: Annotated[AcuteAngle | None, AbsentMeans("no warning beyond a range")] = Field(
        default=None,
        description="Change of the angle between families 1 and 2 (of a single family: to the line "
        "across) up to which the shear was measured; beyond it a run warns.",
    )


class FamiliesBending(SceneModel):
    """Bending stiffness out of the families' own, in the axes of the ply."""

    C33: PositiveStiffness = Field(description="Stiffness against a gradient of compaction.")
    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")
    in_plane: Annotated[float, Number(0.1, NOT_NEGATIVE)] = Field(
        default=0.1,
        description="Stiffness of fibres at 0 or 90 deg against bending within the plane, over "
        "that against bending out of it: a regularisation, no measured property; 0: none.",
    )


class FibreFamiliesMaterial(FabricTable):
    """Fabric of one, two or three families of fibres at any angles."""

    law: Literal["fibre-families"] = "fibre-families"
    name: Annotated[str, Text("UD 300")] = Field(
        default="fibre families", description="Name of the fabric in reports."
    )
    thickness: PositiveLength = Field(description="Thickness t0 of the unloaded fabric.")
    areal_mass: ArealMass = Field(description="Fibre mass per area.")
    fibre_density: Density = Field(description="Density of the fibres themselves.")
    fibres: Annotated[
        tuple[FibreFamilyTable, ...],
        Row('[{ angle = "0 deg", ... }]', minimum_count=1, entries="families", units=False),
    ] = Field(description="The families, one to three.")
    across: Annotated[AcrossFibres | None, AbsentMeans("the fabric has two or three families")] = (
        Field(default=None, description="What holds a single family together.")
    )
    shear: Annotated[
        tuple[ShearOfFamilies, ...],
        Row("[{ between = [1, 2], ... }]", entries="pairs", units=False),
    ] = Field(default=(), description="Shear between pairs of families.")
    membrane: FamiliesMembrane
    compaction: ExponentialCompaction
    bending: FamiliesBending

    @model_validator(mode="after")
    def _check_families(self) -> Self:
        angles = [table.angle for table in self.fibres]
        if len(angles) > MOST_FAMILIES:
            raise wrong(
                f"has {len(angles)} families; a fabric has 1 to {MOST_FAMILIES}", field="fibres"
            )
        for k, angle in enumerate(angles):
            for other in range(k):
                apart = abs(math.remainder(angle - angles[other], math.pi))
                if apart < LEAST_ANGLE:
                    raise wrong(
                        f"has the families {other + 1} and {k + 1} at "
                        f"{math.degrees(angles[other]):.4g} and {math.degrees(angle):.4g} deg, "
                        f"less than {math.degrees(LEAST_ANGLE):g} deg apart: they are one; leave "
                        "one out and add up the moduli",
                        field="fibres",
                    )
        return self

    @model_validator(mode="after")
    def _check_pairs(self) -> Self:
        count = len(self.fibres)
        if count == 1 and self.across is None:
            raise wrong(
                "is needed for a single family: what its stitching resists across the fibres",
                field="across",
            )
        if count > 1 and self.across is not None:
            raise wrong(
                f"is for a single family, and there are {count}; leave it out", field="across"
            )
        if count == 1 and self.shear:
            raise wrong(
                "is between two families, and there is one; give the shear in [material.across]",
                field="shear",
            )
        seen: set[frozenset[int]] = set()
        for table in self.shear:
            a, b = table.between
            if a == b or max(a, b) > count:
                raise wrong(
                    f"has between = [{a}, {b}]; write two numbers of the {count} families, from 1",
                    field="shear",
                )
            if frozenset((a, b)) in seen:
                raise wrong(f"has the pair [{a}, {b}] twice", field="shear")
            seen.add(frozenset((a, b)))
        if count == 2 and not seen:
            raise wrong(
                "is needed: without it nothing resists shear between both families", field="shear"
            )
        return self

    @model_validator(mode="after")
    def _check_shear_laws(self) -> Self:
        for table, pair in zip(self._pair_tables, self.pairs, strict=True):
            fault = table.fault(pair)
            place = "across" if self.across is not None else "shear"
            if fault is not None:
                raise wrong(f"has a {fault[0]} that {fault[1]}", field=place)
            if len(self.fibres) < MOST_FAMILIES and table.torsion is None:
                raise wrong(
                    "needs torsion: nothing else resists the twist of one or two families",
                    field=place,
                )
        return self

    @property
    def _pair_tables(self) -> tuple[ShearOfPair, ...]:
        return self.shear if self.across is None else (self.across,)

    @property
    def fibre_families(self) -> tuple[Family, ...]:
        """The families of fibres."""
        return tuple(
            Family(table.angle, table.side("tension"), table.side("compression"), table.bending)
            for table in self.fibres
        )

    @property
    def fibre_angles(self) -> tuple[float, ...]:
        return tuple(table.angle for table in self.fibres)

    @property
    def across_family(self) -> Family | None:
        """What is across the fibres of a single family."""
        if self.across is None:
            return None
        return Family(
            self.fibres[0].angle + 0.5 * math.pi,
            self.across.side("tension"),
            self.across.side("compression"),
            self.across.bending,
            is_fibre=False,
        )

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Shear of pairs, of a single family with what is across."""
        families, across = self.fibre_families, self.across_family
        if across is not None:
            assert self.across is not None
            return (self.across.pair(families[0], across),)
        return tuple(
            table.pair(*(families[number - 1] for number in table.between)) for table in self.shear
        )

    @property
    def locks(self) -> bool:
        return any(table.locking_angle is not None for table in self._pair_tables)

    def without_locking(self) -> Self:
        """Return the fabric whose shear laws go on beyond their locking angles."""
        none = {"locking_angle": None, "locking_stiffness": None}
        across = None if self.across is None else self.across.model_copy(update=none)
        shear = tuple(table.model_copy(update=none) for table in self.shear)
        return self.model_copy(update={"across": across, "shear": shear})

    def build(self) -> FibreFamilies:
        """Return the fabric."""
        m, c, b = self.membrane, self.compaction, self.bending
        return FibreFamilies(
            self.fibre_families,
            self.across_family,
            self.pairs,
            {
                "C23": m.C23, "C13": m.C13, "c0": c.c0, "c1": c.c1, "c2": c.c2,
                "B33": b.C33, "B23": b.C23, "B13": b.C13,
            },
            thickness=self.thickness,
            areal_mass=self.areal_mass,
            fibre_density=self.fibre_density,
            name=self.name,
            shear_range=m.shear_range,
            in_plane_bending=b.in_plane,
            spaced=self.across is not None and self.across.compressed == "spacing",
        )  # fmt: skip
