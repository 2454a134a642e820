"""Closed-form relations of the coupon tests: what a fabric law means for force and shape.

All quantities in SI units. The shear relations assume pin-jointed, inextensible fibres (pure
shear), the compaction relations a constant area between the plates, the bending relations an
inextensible strip whose shear deformation is negligible (heavy elastica).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lcmchain.errors import InputError

#: Second Piola-Kirchhoff shear stress S12 [Pa] as a function of the shear angle [rad].
ShearStress = Callable[[np.ndarray], np.ndarray]

#: Inclination of the plane that the strip has to touch in the cantilever test (ISO 9073-7).
CANTILEVER_ANGLE = math.radians(41.5)


# --- pure shear -----------------------------------------------------------------------------------


def shear_strain(shear_angle):
    """Return the Green-Lagrange strain E12 = sin(γ)/2 of pure shear (tensor component)."""
    return 0.5 * np.sin(shear_angle)


@dataclass(frozen=True)
class BiasExtension:
    """Bias-extension test of a rectangle with fibres at ±45°, clamped along its short sides.

    Zones of a pin-jointed specimen with l0 >= 2 w0: A at the clamps stays undeformed, B is
    sheared by half the angle of the centre C. Source: paper section 3.2.1 after Boisse et al.;
    the force follows from f du/dt = ∫ S : dE/dt dV with S : dE/dt = S12 cos(γ) dγ/dt.

    Parameters
    ----------
    length, width : free length l0 between the clamps and width w0 [m].
    thickness : initial thickness t0 [m].

    Raises
    ------
    InputError : a size is not positive, or l0 < 2 w0 (the specimen has no zone C of that shape).
    """

    length: float
    width: float
    thickness: float

    def __post_init__(self):
        if min(self.length, self.width, self.thickness) <= 0.0:
            raise InputError("length, width and thickness of the specimen must be positive")
        if self.length < 2.0 * self.width * (1.0 - 1e-9):
            raise InputError(
                f"a bias-extension specimen must be at least twice as long as wide; "
                f"{self.length * 1e3:g} mm x {self.width * 1e3:g} mm is not"
            )

    @property
    def gauge(self) -> float:
        """Diagonal D = l0 - w0 of the deforming part [m]."""
        return self.length - self.width

    @property
    def locking_displacement(self) -> float:
        """Displacement at which the fibres would be parallel, γ = 90° [m]."""
        return (math.sqrt(2.0) - 1.0) * self.gauge

    @property
    def zone_areas(self) -> tuple[float, float, float]:
        """Initial areas of the zones A, B and C [m²]; they add up to l0 w0."""
        w = self.width
        return 0.5 * w**2, w**2, 0.5 * w * (2.0 * self.length - 3.0 * w)

    def shear_angle(self, displacement):
        """Return the shear angle of zone C [rad] at a displacement [m], 0 to 90°."""
        ratio = (self.gauge + np.asarray(displacement)) / (math.sqrt(2.0) * self.gauge)
        return 0.5 * np.pi - 2.0 * np.arccos(np.clip(ratio, -1.0, 1.0))

    def displacement(self, shear_angle):
        """Return the displacement [m] at which zone C has this shear angle [rad]."""
        half = 0.5 * np.asarray(shear_angle)
        return self.gauge * (np.cos(half) + np.sin(half) - 1.0)

    def displacement_slope(self, shear_angle):
        """Return du/dγ [m/rad]."""
        half = 0.5 * np.asarray(shear_angle)
        return 0.5 * self.gauge * (np.cos(half) - np.sin(half))

    def force(self, shear_angle, shear_stress: ShearStress):
        """Return the machine force [N] of a shear law at shear angles of zone C [rad]."""
        angle = np.asarray(shear_angle)
        _, half_sheared, sheared = self.zone_areas
        power = sheared * shear_stress(angle) * np.cos(angle)
        power += 0.5 * half_sheared * shear_stress(0.5 * angle) * np.cos(0.5 * angle)
        return self.thickness * power / self.displacement_slope(angle)

    def shear_stress_from_force(self, force: ShearStress, shear_angle, *, linear_below, share=1.0):
        """Return S12 [Pa] at shear angles [rad] from the force, by the recursion of Eq. (22).

        Each value needs the one at half the angle. Below ``linear_below`` the stress is taken as
        proportional to the angle, which ends the recursion.

        Parameters
        ----------
        force : machine force [N] as a function of the shear angle of zone C.
        shear_angle : angles [rad], any shape.
        linear_below : largest angle [rad] of the linear range.
        share : factor on the part of zone B. With 1 the result is the exact inverse of
            :meth:`force`. Eq. (22) as printed carries 1/2 (l0 = 2 w0), which leaves out half of
            the power of zone B and gives a stress up to 20 % higher.
        """
        angle = np.atleast_1d(np.asarray(shear_angle, dtype=float))
        _, half_sheared, sheared = self.zone_areas
        work = force(angle) * self.displacement_slope(angle) / self.thickness
        half_power = share * 0.5 * half_sheared * np.cos(0.5 * angle)
        own_power = sheared * np.cos(angle)
        linear = angle <= linear_below
        stress = work / (own_power + 0.5 * half_power)
        if not linear.all():
            rest = angle[~linear]
            half = self.shear_stress_from_force(
                force, 0.5 * rest, linear_below=linear_below, share=share
            )
            stress[~linear] = (work[~linear] - half_power[~linear] * half) / own_power[~linear]
        return stress.reshape(np.shape(shear_angle))


@dataclass(frozen=True)
class PictureFrame:
    """Picture-frame test: a square of fabric with fibres along the sides of a hinged frame.

    Parameters
    ----------
    side : side length of frame and fabric [m].
    thickness : initial thickness [m].
    """

    side: float
    thickness: float

    def shear_angle(self, displacement):
        """Return the shear angle [rad] at a displacement of the corner along the diagonal [m]."""
        cosine = 1.0 / math.sqrt(2.0) + np.asarray(displacement) / (2.0 * self.side)
        return 0.5 * np.pi - 2.0 * np.arccos(np.clip(cosine, -1.0, 1.0))

    def displacement(self, shear_angle):
        """Return the displacement of the corner along the diagonal [m]."""
        half_opening = 0.25 * np.pi - 0.5 * np.asarray(shear_angle)
        return 2.0 * self.side * (np.cos(half_opening) - 1.0 / math.sqrt(2.0))

    def force(self, shear_angle, shear_stress: ShearStress):
        """Return the force along the diagonal [N]."""
        angle = np.asarray(shear_angle)
        half_opening = 0.25 * np.pi - 0.5 * angle
        shear_flow = self.thickness * shear_stress(angle)
        return self.side * shear_flow * np.cos(angle) / np.sin(half_opening)

    def edge_shear_force(self, shear_angle, shear_stress: ShearStress):
        """Return the shear force along a side of the frame [N]: L t0 S12 exactly."""
        return self.side * self.thickness * shear_stress(np.asarray(shear_angle))


# --- plate-to-plate compaction --------------------------------------------------------------------


def compaction_strain(stretch):
    """Return the Green-Lagrange strain E33 of a thickness stretch t/t0."""
    return 0.5 * (np.asarray(stretch) ** 2 - 1.0)


def compaction_pressure(stretch, c0, c1, c2):
    """Return the pressure p = λ|S33| [Pa] on the plates for the compaction law, Eq. (23).

    Zero for λ >= 1: an unloaded fabric does not pull on the plates.
    """
    stretch = np.asarray(stretch, dtype=float)
    strain = np.maximum(-compaction_strain(stretch), 0.0)
    return stretch * c0 * strain * np.exp(c1 * strain**c2)


def stretch_at_pressure(pressure, c0, c1, c2):
    """Return the thickness stretch t/t0 at which the law, Eq. (23), carries these pressures [Pa].

    The pressure of the law rises with compaction up to a largest value far beyond use (400 MPa at
    a stretch of 0.13 for MD600) and falls towards λ = 0, where it vanishes; the first branch is
    returned.

    Raises
    ------
    ValueError : negative pressure, or more than the law can carry.
    """
    pressure = np.asarray(pressure, dtype=float)
    grid = np.linspace(1.0, 0.02, 491)
    carried = compaction_pressure(grid, c0, c1, c2)
    top = int(np.argmax(carried))
    if pressure.min() < 0.0 or pressure.max() > carried[top]:
        raise ValueError(f"pressure must lie between 0 and {carried[top]:.3g} Pa")

    def stretch(p):
        upper = max(int(np.searchsorted(carried[: top + 1], p)), 1)
        return brentq(
            lambda s: float(compaction_pressure(s, c0, c1, c2)) - p,
            grid[upper], grid[upper - 1], xtol=1e-14,
        )  # fmt: skip

    return np.array([stretch(p) for p in pressure.ravel()]).reshape(pressure.shape)


def power_law_fibre_volume_fraction(pressure, A, B):
    """Return Φ = A (p / 1 kPa)^B of the experimental compaction law, Eq. (24); pressure in Pa."""
    return A * (np.asarray(pressure) / 1e3) ** B


def power_law_pressure(thickness, A, B, solid_height):
    """Return the pressure [Pa] of the experimental law, Eq. (24), at a thickness [m].

    ``solid_height`` is the height of the fibres without voids, areal mass / fibre density [m].
    """
    return 1e3 * (solid_height / (np.asarray(thickness) * A)) ** (1.0 / B)


def power_law_thickness(pressure, A, B, solid_height):
    """Return the thickness [m] of the experimental law, Eq. (24), under a pressure [Pa]."""
    return solid_height / power_law_fibre_volume_fraction(pressure, A, B)


# --- bending under own weight ---------------------------------------------------------------------


@dataclass(frozen=True)
class Elastica:
    """Shape of a strip of unit length, clamped level at s = 0, bending down under its weight.

    Attributes
    ----------
    load_parameter : Λ = w L³ / D, weight per area w [N/m²], bending stiffness D [N m].
    x, y : horizontal reach and drop of points along the strip, shape [point_count].
    slope : angle below the horizontal [rad], shape [point_count].
    clamp_moment : M L / D at the clamp.
    """

    load_parameter: float
    x: np.ndarray
    y: np.ndarray
    slope: np.ndarray
    clamp_moment: float

    @property
    def chord_angle(self) -> float:
        """Angle of the line from clamp to tip below the horizontal [rad]."""
        return math.atan2(self.y[-1], self.x[-1])


def elastica_with_tip_slope(tip_slope: float, point_count: int = 201) -> Elastica:
    """Integrate the heavy elastica from its tip, where slope and (zero) moment are known.

    With τ = (w/D)^(1/3) times the distance from the tip, EI θ'' = -w (L - s) cos θ becomes
    θ'' = -τ cos θ with θ'(0) = 0, free of parameters. The clamp is where θ = 0, and Λ = τ³ there:
    one initial-value problem instead of a boundary-value problem.

    Raises
    ------
    ValueError : the tip slope [rad] is not between 0 and 90°.
    """
    if not 0.0 < tip_slope < 0.5 * np.pi:
        raise ValueError("the slope of the tip must lie between 0 and 90 deg")

    def slopes(tau, state):
        theta, turning, _, _ = state
        return turning, -tau * math.cos(theta), math.cos(theta), math.sin(theta)

    def level(_, state):
        return state[0]

    level.terminal = True
    solution = solve_ivp(
        slopes, (0.0, 1e3), (tip_slope, 0.0, 0.0, 0.0), method="DOP853", events=level,
        dense_output=True, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    length = solution.t[-1]
    theta, _, x, y = solution.sol(length * np.linspace(1.0, 0.0, point_count))
    return Elastica(
        load_parameter=length**3,
        x=(x[0] - x) / length,
        y=(y[0] - y) / length,
        slope=theta,
        clamp_moment=-solution.y[1, -1] * length,
    )


def elastica(load_parameter: float, point_count: int = 201) -> Elastica:
    """Return the heavy elastica of a load parameter Λ = w L³ / D.

    Raises
    ------
    ValueError : Λ is not between 1e-4 and 300.
    """
    if not 1e-4 <= load_parameter <= 300.0:
        raise ValueError("the load parameter must lie between 1e-4 and 300")
    return elastica_with_tip_slope(
        _tip_slope(lambda shape: math.log(shape.load_parameter / load_parameter)), point_count
    )


@lru_cache(maxsize=256)
def load_parameter_at_chord_angle(angle: float) -> float:
    """Return Λ of the strip whose tip is seen from the clamp at this angle [rad] (0.1° to 85°).

    At 41.5°, Λ = 8.0042: the bending length (D/w)^(1/3) is half the overhang to 0.02 %.

    Raises
    ------
    ValueError : the angle lies outside.
    """
    if not math.radians(0.1) <= angle <= math.radians(85.0):
        raise ValueError("the chord angle must lie between 0.1 deg and 85 deg")
    slope = _tip_slope(lambda shape: shape.chord_angle - angle)
    return elastica_with_tip_slope(slope, 2).load_parameter


def _tip_slope(mismatch) -> float:
    """Find the tip slope of the elastica for which a growing mismatch vanishes."""
    # 90 deg is reached exponentially with the length: search in its logarithm.
    def slope(q):
        return -0.5 * np.pi * math.expm1(-q)

    root = brentq(lambda q: mismatch(elastica_with_tip_slope(slope(q), 2)), 1e-6, 20.0, xtol=1e-13)
    return slope(root)


def bending_stiffness_from_overhang(overhang, areal_weight, angle=CANTILEVER_ANGLE):
    """Return the bending stiffness per width D = w L³ / Λ [N m] of a cantilever test.

    Parameters
    ----------
    overhang : free length along the strip [m].
    areal_weight : weight per area w [N/m²].
    angle : chord angle at that overhang [rad].
    """
    factor = np.vectorize(load_parameter_at_chord_angle, otypes=[float])(angle)
    return areal_weight * np.asarray(overhang) ** 3 / factor


def overhang_at_angle(bending_stiffness, areal_weight, angle=CANTILEVER_ANGLE):
    """Return the overhang [m] at which the tip is seen at this chord angle [rad]."""
    factor = np.vectorize(load_parameter_at_chord_angle, otypes=[float])(angle)
    return np.cbrt(factor * np.asarray(bending_stiffness) / areal_weight)


def bending_length(bending_stiffness, areal_weight):
    """Return Peirce's bending length (D/w)^(1/3) [m]."""
    return np.cbrt(np.asarray(bending_stiffness) / areal_weight)


def strip_stiffness(C11, C22, C12, orientation, assumption: str):
    """Return the stiffness [Pa] against bending along a strip cut at an angle to fibre 1.

    The bending stiffness per width is this times t³/12. C12 acts on the engineering twist, as
    C^B of Eq. (25) does.

    Parameters
    ----------
    C11, C22, C12 : entries of C^B [Pa].
    orientation : angle from fibre direction 1 to the strip [rad].
    assumption : ``"free-strip"``: a narrow strip, free to twist and to curve across (no moments
        but the bending moment); ``"cylindrical"``: a wide one, held to curve along only.
    """
    c2, s2 = np.cos(orientation) ** 2, np.sin(orientation) ** 2
    if assumption == "cylindrical":
        return c2**2 * C11 + s2**2 * C22 + 4.0 * s2 * c2 * C12
    if assumption == "free-strip":
        return 1.0 / (c2**2 / C11 + s2**2 / C22 + s2 * c2 / C12)
    raise ValueError(f'"{assumption}" must be free-strip or cylindrical')
