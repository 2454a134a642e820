"""Pure shear of a fabric in bias-extension and picture-frame tests: angles, forces, stress.

All quantities in SI units; fibres are pin-jointed and inextensible.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.errors import InputError

#: Second Piola-Kirchhoff shear stress S12 [Pa] as a function of the shear angle [rad].
ShearStress = Callable[[np.ndarray], np.ndarray]


def shear_strain(shear_angle: ArrayLike) -> np.ndarray:
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

    def __post_init__(self) -> None:
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

    def shear_angle(self, displacement: ArrayLike) -> np.ndarray:
        """Return the shear angle of zone C [rad] at a displacement [m], 0 to 90°."""
        ratio = (self.gauge + np.asarray(displacement)) / (math.sqrt(2.0) * self.gauge)
        return 0.5 * np.pi - 2.0 * np.arccos(np.clip(ratio, -1.0, 1.0))

    def displacement(self, shear_angle: ArrayLike) -> np.ndarray:
        """Return the displacement [m] at which zone C has this shear angle [rad]."""
        half = 0.5 * np.asarray(shear_angle)
        return self.gauge * (np.cos(half) + np.sin(half) - 1.0)

    def displacement_slope(self, shear_angle: ArrayLike) -> np.ndarray:
        """Return du/dγ [m/rad]."""
        half = 0.5 * np.asarray(shear_angle)
        return 0.5 * self.gauge * (np.cos(half) - np.sin(half))

    def force(self, shear_angle: ArrayLike, shear_stress: ShearStress) -> np.ndarray:
        """Return the machine force [N] of a shear law at shear angles of zone C [rad]."""
        angle = np.asarray(shear_angle)
        _, half_sheared, sheared = self.zone_areas
        power = sheared * shear_stress(angle) * np.cos(angle)
        power += 0.5 * half_sheared * shear_stress(0.5 * angle) * np.cos(0.5 * angle)
        return self.thickness * power / self.displacement_slope(angle)

    def shear_stress_from_force(
        self, force: ShearStress, shear_angle: ArrayLike, *, linear_below: float, share: float = 1.0
    ) -> np.ndarray:
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

    @property
    def locking_displacement(self) -> float:
        """Displacement at which the sides would be parallel, γ = 90° [m]."""
        return (2.0 - math.sqrt(2.0)) * self.side

    def shear_angle(self, displacement: ArrayLike) -> np.ndarray:
        """Return the shear angle [rad] at a displacement of the corner along the diagonal [m]."""
        cosine = 1.0 / math.sqrt(2.0) + np.asarray(displacement) / (2.0 * self.side)
        return 0.5 * np.pi - 2.0 * np.arccos(np.clip(cosine, -1.0, 1.0))

    def displacement(self, shear_angle: ArrayLike) -> np.ndarray:
        """Return the displacement of the corner along the diagonal [m]."""
        half_opening = 0.25 * np.pi - 0.5 * np.asarray(shear_angle)
        return 2.0 * self.side * (np.cos(half_opening) - 1.0 / math.sqrt(2.0))

    def force(self, shear_angle: ArrayLike, shear_stress: ShearStress) -> np.ndarray:
        """Return the force along the diagonal [N]."""
        angle = np.asarray(shear_angle)
        half_opening = 0.25 * np.pi - 0.5 * angle
        shear_flow = self.thickness * shear_stress(angle)
        return self.side * shear_flow * np.cos(angle) / np.sin(half_opening)

    def edge_shear_force(self, shear_angle: ArrayLike, shear_stress: ShearStress) -> np.ndarray:
        """Return the shear force along a side of the frame [N]: L t0 S12 exactly."""
        return self.side * self.thickness * shear_stress(np.asarray(shear_angle))
