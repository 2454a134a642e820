"""Compaction of sheared fabric by a table: pressure over thickness at several shear angles.

The energy of compaction W33 of :mod:`.compaction` is taken at a strain ε that is a map of thickness
and shear,

    W = W33(ε),  ε = f(x, s),  1 + 2 x = (1 + 2 E33) e^-L(s),  s = -ln cos² γ,  sin γ = 2 E12,

where the strain x is counted from the thickness e^(L/2) without pressure. One potential gives
pressure, shear stress and all tangents. A table made from the exponent β has f = x and L = β s. The
map is smooth where pressures run through decades, so that few numbers hold it,

    f = A(s) x + Σ_k d_k(s) max(y - k, 0)³,  y = -x / Δ.

The second derivative of f is linear between its values b_j at y = j, and d_k are the second
differences of these. So f has two continuous derivatives. It is linear where the fabric is thicker
than free, and from one interval beyond the deepest point of the table on. At every angle of the
table A and b are those with the smallest b that meets its pressures. Between the angles L, A and b
are polynomials of s through these values. Beyond the last angle the free thickness goes on as a
power of cos γ, while A and b soon become constant. Beyond 84 degrees nothing follows the shear any
further, as with β.

Source: own form, with the potential of :mod:`.shear_compaction`.

A law of a fabric with a table is a class of its own with one more parameter
(:func:`tabled_class`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.jit import equation
from lcmchain.materials.features.compaction import compaction_of
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.features.pressure_curves import MOST_ANGLES, MOST_PRESSURES, PressureCurve
from lcmchain.materials.features.shear_compaction import LARGEST_SQUARE, StrainMap, thickening
from lcmchain.materials.twins import LawOrTwin, prefixed, twin_of

#: s of the shear beyond which nothing follows.
LARGEST = -math.log(1.0 - LARGEST_SQUARE)
#: Values of the second derivative of f, and knots that they have together.
VALUES = MOST_PRESSURES
KNOTS = VALUES + 2
#: Where the numbers of a table stand: 1/Δ, the last s, the slope of L beyond, and then polynomials
#: L, A and d_k of s.
FUNCTIONS = 3
SIZE = FUNCTIONS + MOST_ANGLES * (2 + KNOTS)
# Beyond the last angle A and b stay after so much of s.
RUN_OUT = 0.1
# What counts as met [1], and how often the smoothest map is improved.
TOLERANCE = 1e-10
MOST_ITERATIONS = 60
SECOND_DIFFERENCES = (1.0, -2.0, 1.0)


class PressureTable:
    """A table of pressures, and the map of thickness and shear that meets it.

    Parameters
    ----------
    curves : at rising shear angles from zero.
    c0, c1, c2 : of the law of compaction, Eq. (23), whose strain the map gives [Pa, 1, 1].
    """

    def __init__(self, curves: Sequence[PressureCurve], c0: float, c1: float, c2: float) -> None:
        self.curves = tuple(curves)
        self._law = (c0, c1, c2)

    # --- points and their map --------------------------------------------------------------------

    def fault(self) -> str:
        """Say why no law can be made of the table; empty where one can."""
        angles = [curve.shear_angle for curve in self.curves]
        if not 2 <= len(angles) <= MOST_ANGLES:
            return f"has {len(angles)} shear angles; give 2 to {MOST_ANGLES}"
        if angles[0] != 0.0 or np.any(np.diff(angles) <= 0.0):
            return f"has the shear angles {_degrees(*angles)}; begin at 0 deg, and let them rise"
        if abs(self.curves[0].stretch[0] - 1.0) > 1e-9:
            return (
                f"is free at the stretch {self.curves[0].stretch[0]:g} without shear; it must be "
                "1, or the thickness of the material another"
            )
        for curve in self.curves:
            if fault := curve.fault():
                return f"at {_degrees(curve.shear_angle)} {fault}"
        for curve, (_, missed) in zip(self.curves, self._maps, strict=True):
            if not missed < 1e-6:
                return (
                    f"at {_degrees(curve.shear_angle)} has points that no smooth curve meets "
                    f"(missed by {missed:.2g}): smooth them, or give fewer"
                )
        return self._falls()

    def _falls(self) -> str:
        """Say where the pressure would not rise with the compaction; empty where nowhere."""
        s = np.linspace(0.0, LARGEST, 93)[:, None]
        for deepest, where in ((self.deepest, "between points"), (0.48, "beyond the points")):
            x = -np.linspace(0.0, deepest, 97)[1:]
            with np.errstate(over="ignore", invalid="ignore"):
                f = self._map_of(x, s)
                S, C = compaction_of(*self._law, f.f)
                rises = (f.x > 0.0) & (C * f.x**2 + S * f.xx > 0.0)
            if not rises.all():
                row, column = map(int, np.argwhere(~rises)[0])
                stretch = math.sqrt(1.0 + 2.0 * x[column])
                angle = math.acos(math.exp(-0.5 * float(s[row, 0])))
                return (
                    f"makes the pressure fall at {_degrees(angle)}, where the fabric is pressed to "
                    f"{stretch:.3g} of its free thickness, {where} and angles: add a point or an "
                    "angle there, or smooth those beside it"
                )
        return ""

    @cached_property
    def deepest(self) -> float:
        """Size of the largest strain x of the table, counted from the free thickness."""
        return max(-float(curve.strains().min()) for curve in self.curves)

    @property
    def thinnest(self) -> float:
        """The smallest thickness of the table over the free one."""
        return math.sqrt(1.0 - 2.0 * self.deepest)

    @property
    def last_angle(self) -> float:
        """The largest shear angle of the table [rad]."""
        return self.curves[-1].shear_angle

    @cached_property
    def _maps(self) -> list[tuple[np.ndarray, float]]:
        return [self._smoothest(curve) for curve in self.curves]

    def _smoothest(self, curve: PressureCurve) -> tuple[np.ndarray, float]:
        """Return A and b (1 + VALUES,) of the least b that meets a curve, and what is missed [1].

        Newton's method for ln p, each step to the map of the least b that meets the straight
        equations (Lagrange's multipliers).
        """
        x = curve.strains()
        stretch = np.array(curve.stretch[1:])
        scale = -stretch / curve.stretch[0] ** 2 / math.cos(curve.shear_angle)
        wanted = np.log(np.array(curve.pressure[1:]))
        basis, slopes = self._shares(x, 0), self._shares(x, 1)
        n, count = len(x), 1 + VALUES
        system = np.zeros((count + n, count + n))
        system[np.arange(1, count), np.arange(1, count)] = 1.0
        system[0, 0] = 1e-12  # A is free
        z, missed = np.zeros(count), math.inf
        z[0] = 1.0
        for _ in range(MOST_ITERATIONS):
            strain, rate = basis @ z, slopes @ z
            if not np.all(strain < 0.0):
                return z, math.inf
            S, C = compaction_of(*self._law, strain)
            off = np.log(scale * S * rate) - wanted
            missed = float(np.abs(off).max())
            J = (C / S)[:, None] * basis + slopes / rate[:, None]
            system[count:, :count], system[:count, count:] = J, J.T
            solution = np.linalg.solve(system, np.concatenate([np.zeros(count), J @ z - off]))[
                :count
            ]
            step = solution - z
            part = 1.0
            while np.any(slopes @ (z + part * step) <= 0.0):
                part *= 0.5
            z = z + part * step
            if missed < TOLERANCE and np.abs(step).max() < 1e-9:
                break
        return z, missed

    def _shares(self, x: np.ndarray, order: int) -> np.ndarray:
        """Return what A and b (..., 1 + VALUES) have as factors in f, or its derivative with x."""
        powers = _truncated(x, self._inverse, order)
        straight = x if order == 0 else np.ones_like(x)
        return np.column_stack([straight, powers @ self._differences.T])

    @cached_property
    def _differences(self) -> np.ndarray:
        """Factors of b in d (VALUES, KNOTS)."""
        factors = np.zeros((VALUES, KNOTS))
        for j in range(VALUES):
            factors[j, j : j + 3] = SECOND_DIFFERENCES
        return factors / (6.0 * self._inverse**2)

    @property
    def _inverse(self) -> float:
        """1/Δ: the deepest point of the table is as many intervals from the free thickness."""
        return VALUES / self.deepest

    @cached_property
    def numbers(self) -> np.ndarray:
        """The numbers (SIZE,) that a law with the table takes."""
        angles = np.array([curve.shear_angle for curve in self.curves])
        free = [2.0 * math.log(curve.stretch[0]) for curve in self.curves]
        maps = np.array([z for z, _ in self._maps])
        values = np.column_stack([free, maps[:, 0], maps[:, 1:] @ self._differences])
        s = -2.0 * np.log(np.cos(angles))
        powers = np.vander(s, increasing=True)
        polynomials = np.zeros((MOST_ANGLES, values.shape[1]))
        polynomials[: len(s)] = np.linalg.solve(powers, values)
        slope = np.polynomial.polynomial.polyval(s[-1], _derivative(polynomials[:, 0]))
        return np.concatenate([[self._inverse, s[-1], slope], polynomials.T.ravel()])

    # --- the map in NumPy ------------------------------------------------------------------------

    def _held(self, s: np.ndarray) -> list[np.ndarray]:
        """Return the s that A and b follow, which stays soon beyond the last angle, and dr/ds."""
        last = self.numbers[1]
        u = np.clip((s - last) / RUN_OUT, 0.0, 1.0)
        r = np.minimum(s, last) + RUN_OUT * (u - u**3 + 0.5 * u**4)
        return [r, 1.0 - u**2 * (3.0 - 2.0 * u), -6.0 * u * (1.0 - u) / RUN_OUT]

    def _functions(self, r: np.ndarray, order: int) -> np.ndarray:
        """Return derivatives of the polynomials L, A and d_k (..., 2 + KNOTS) with r."""
        polynomials = self.numbers[FUNCTIONS:].reshape(-1, MOST_ANGLES).T
        for _ in range(order):
            polynomials = _derivative(polynomials)
        values: np.ndarray = np.moveaxis(np.polynomial.polynomial.polyval(r, polynomials), 0, -1)
        return values

    def _map_of(self, x: np.ndarray, s: np.ndarray) -> _Map:
        """Return f and its derivatives at strains x and s, which broadcast."""
        r, r_s, r_ss = self._held(s)
        functions = [self._functions(r, order) for order in range(3)]
        powers = [_truncated(x, self._inverse, order) for order in range(3)]

        def part(order: int, order_r: int) -> np.ndarray:
            A, d = functions[order_r][..., 1], functions[order_r][..., 2:]
            straight = A * x if order == 0 else A if order == 1 else 0.0 * A
            return straight + (d * powers[order]).sum(axis=-1)

        return _Map(
            f=part(0, 0), x=part(1, 0), xx=part(2, 0), s=part(0, 1) * r_s, xs=part(1, 1) * r_s,
            ss=part(0, 2) * r_s**2 + part(0, 1) * r_ss,
        )  # fmt: skip

    def _free(self, s: np.ndarray) -> list[np.ndarray]:
        """Return L and its first and second derivative with s."""
        r, r_s, r_ss = self._held(s)
        L, L_r, L_rr = (self._functions(r, order)[..., 0] for order in range(3))
        beyond = self.numbers[2]
        return [
            L + beyond * (s - r),
            L_r * r_s + beyond * (1.0 - r_s),
            L_rr * r_s**2 + (L_r - beyond) * r_ss,
        ]

    def at(self, E33: ArrayLike, g: ArrayLike) -> StrainMap:
        """Return the strain ε and its derivatives at strains E33 and g = 2 E12."""
        E33, g = np.broadcast_arrays(np.asarray(E33, dtype=float), np.asarray(g, dtype=float))
        rest = 1.0 - np.minimum(g * g, LARGEST_SQUARE)
        s = -np.log(rest)
        follows = np.where(g * g < LARGEST_SQUARE, 1.0 / rest, 0.0)
        s_g, s_gg = 2.0 * follows * g, 2.0 * follows**2 * (1.0 + g * g)
        L, L_s, L_ss = self._free(s)
        a, half = np.exp(-L), 0.5 + E33
        a_g = -L_s * s_g * a
        a_gg = (L_s**2 - L_ss) * s_g**2 * a - L_s * s_gg * a
        f = self._map_of(half * a - 0.5, s)
        f_g, f_xg, f_gg = f.s * s_g, f.xs * s_g, f.ss * s_g**2 + f.s * s_gg
        x_g = half * a_g
        return StrainMap(
            strain=f.f,
            E=f.x * a,
            g=f.x * x_g + f_g,
            EE=f.xx * a**2,
            Eg=(f.xx * x_g + f_xg) * a + f.x * a_g,
            gg=f.xx * x_g**2 + 2.0 * f_xg * x_g + f.x * half * a_gg + f_gg,
            m=a,
            m_g=a_g,
            m_gg=a_gg,
        )

    def free_stretch(self, g: ArrayLike) -> np.ndarray:
        """Return the thickness stretch without pressure at shear strains g = sin γ."""
        s = -np.log(1.0 - np.minimum(np.square(g), LARGEST_SQUARE))
        free: np.ndarray = np.exp(0.5 * self._free(s)[0])
        return free

    def pressure(
        self, unsheared: Callable[[np.ndarray], np.ndarray], stretch: np.ndarray, g: ArrayLike
    ) -> np.ndarray:
        """Return the pressure of plates [Pa] on the area at the start."""
        strain_map = self.at(0.5 * (stretch**2 - 1.0), g)
        seen = np.sqrt(1.0 + 2.0 * strain_map.strain)
        return stretch * strain_map.E * unsheared(seen) / seen

    def law_of(self, law: LawOrTwin) -> LawOrTwin:
        """Return the twin of a law with the table."""
        return prefixed(law, "Tabled")(*law, self.numbers)

    def beyond(self, stretch: ArrayLike, g: ArrayLike) -> np.ndarray:
        """Tell where thickness stretches are below the deepest point of the table."""
        squared = (np.asarray(stretch) / self.free_stretch(g)) ** 2
        deeper: np.ndarray = 0.5 * (1.0 - squared) > self.deepest * (1.0 + 1e-9)
        return deeper

    def in_words(self) -> str:
        """Say what the table holds."""
        angles = [curve.shear_angle for curve in self.curves]
        most = max(curve.pressure[-1] for curve in self.curves)
        return f"pressures up to {1e-6 * most:.3g} MPa by a table at {_degrees(*angles)} of shear"


def _degrees(*angles: float) -> str:
    return ", ".join(f"{math.degrees(angle):.4g}" for angle in angles) + " deg"


class _Map(NamedTuple):
    """The strain f(x, s) and its derivatives."""

    f: np.ndarray
    x: np.ndarray
    xx: np.ndarray
    s: np.ndarray
    xs: np.ndarray
    ss: np.ndarray


def _truncated(x: np.ndarray, inverse: float, order: int) -> np.ndarray:
    """Return derivatives with x of max(y - k, 0)³ (..., KNOTS), y = -x/Δ."""
    t = np.maximum(-x[..., None] * inverse - np.arange(KNOTS), 0.0)
    return math.perm(3, order) * (-inverse) ** order * t ** (3 - order)


def _derivative(polynomials: np.ndarray) -> np.ndarray:
    """Return the coefficients of the derivatives of polynomials, one a column."""
    return np.polynomial.polynomial.polyder(polynomials)


# --- compiled -------------------------------------------------------------------------------------


class Sums(NamedTuple):
    """Sums over the knots of d t³, d t² and d t, and with derivatives of d in place of d."""

    third: Any
    second: Any
    first: Any
    third_r: Any
    second_r: Any
    third_rr: Any


@equation
def polynomial(table, number, r):
    """Return a polynomial of r and its two derivatives."""
    at = FUNCTIONS + MOST_ANGLES * number
    c1, c2, c3 = table[at + 1], table[at + 2], table[at + 3]
    return (
        table[at] + r * (c1 + r * (c2 + r * c3)),
        c1 + r * (2.0 * c2 + r * 3.0 * c3),
        2.0 * c2 + r * 6.0 * c3,
    )


@equation
def with_knot(sums, table, knot, r, y):
    """Return sums with those of a knot."""
    d, d_r, d_rr = polynomial(table, 2 + knot, r)
    t = max(y - knot, 0.0)
    t2 = t * t
    t3 = t2 * t
    return Sums(
        sums.third + d * t3,
        sums.second + d * t2,
        sums.first + d * t,
        sums.third_r + d_r * t3,
        sums.second_r + d_r * t2,
        sums.third_rr + d_rr * t3,
    )


@equation
def held_shear(table, s):
    """Return the s that A and b follow, which stays soon beyond the last angle, and dr/ds."""
    last = table[1]
    u = min(max(s - last, 0.0) / RUN_OUT, 1.0)
    square = u * u
    r = min(s, last) + RUN_OUT * u * (1.0 - square * (1.0 - 0.5 * u))
    return r, 1.0 - square * (3.0 - 2.0 * u), -6.0 * u * (1.0 - u) / RUN_OUT


@equation
def table_thickening(law, E33, g):
    table, square = law.pressure_table, g * g
    rest = 1.0 - min(square, LARGEST_SQUARE)
    s = -logarithm(rest)
    r, r_s, r_ss = held_shear(table, s)
    follows = 1.0 / rest if square < LARGEST_SQUARE else 0.0
    s_g, s_gg = 2.0 * follows * g, 2.0 * follows * follows * (1.0 + square)
    r_g, r_gg = r_s * s_g, r_ss * s_g * s_g + r_s * s_gg
    # the free thickness
    L, L_r, L_rr = polynomial(table, 0, r)
    beyond = table[2]
    a = exponential(-(L + beyond * (s - r)))
    rate = L_r * r_g + beyond * (s_g - r_g)  # dL/dg
    bent = L_rr * r_g * r_g + L_r * r_gg + beyond * (s_gg - r_gg)
    a_g, a_gg = -rate * a, (rate * rate - bent) * a
    # the map f(x, r)
    half, inverse = 0.5 + E33, table[0]
    x = half * a - 0.5
    y = -x * inverse
    sums = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    sums = with_knot(sums, table, 0, r, y)
    sums = with_knot(sums, table, 1, r, y)
    sums = with_knot(sums, table, 2, r, y)
    sums = with_knot(sums, table, 3, r, y)
    sums = with_knot(sums, table, 4, r, y)
    sums = with_knot(sums, table, 5, r, y)
    sums = with_knot(sums, table, 6, r, y)
    A, A_r, A_rr = polynomial(table, 1, r)
    f_x = A - 3.0 * inverse * sums.second
    f_xx = 6.0 * inverse * inverse * sums.first
    f_r, f_rr = A_r * x + sums.third_r, A_rr * x + sums.third_rr
    f_xg = (A_r - 3.0 * inverse * sums.second_r) * r_g
    x_g = half * a_g
    return StrainMap(
        A * x + sums.third,
        f_x * a,
        f_x * x_g + f_r * r_g,
        f_xx * a * a,
        (f_xx * x_g + f_xg) * a + f_x * a_g,
        (f_xx * x_g + 2.0 * f_xg) * x_g + f_x * half * a_gg + f_rr * r_g * r_g + f_r * r_gg,
        a,
        a_g,
        a_gg,
    )


# --- laws -----------------------------------------------------------------------------------------


def tabled_class(law_class: type) -> Any:
    """Return the twin of a class of laws that holds a table, see :func:`.twins.twin_of`."""
    return twin_of(
        law_class,
        "Tabled",
        about=", and (SIZE,) of a table of pressures.",
        entries=[("pressure_table", np.ndarray)],
        answers={thickening: table_thickening},
    )
