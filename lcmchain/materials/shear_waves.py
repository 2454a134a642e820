"""Speed of shear waves in the plane of a sheet: the slowest that a forming process meets."""

from __future__ import annotations

import math

import numpy as np

from lcmchain.materials.law import Material

# Shear angle up to which the softest tangent of the law is looked for.
LARGEST_SHEAR_ANGLE = math.radians(45.0)


def shear_wave_speeds(material: Material) -> tuple[float, float]:
    """Return the speed of shear waves in the plane [m/s], at rest and where shear is softest.

    sqrt(G/ρ) with the tangent G of the shear law; where it softens a fast process makes bands.
    """
    modulus = _in_plane_shear(material, np.linspace(0.0, LARGEST_SHEAR_ANGLE, 91))[1]
    softest = modulus[modulus > 0.0].min()
    return math.sqrt(modulus[0] / material.density), math.sqrt(softest / material.density)


def shear_energy(material: Material, angle: float) -> float:
    """Return the work per volume [J/m³] of shearing the fabric by an angle [rad] in its plane."""
    angles = np.linspace(0.0, angle, 91)
    stress = _in_plane_shear(material, angles)[0]
    return float(np.trapezoid(stress, np.sin(angles)))


def _in_plane_shear(material: Material, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return S12 [Pa] and its tangent to 2 E12 [Pa] at shear angles (n,) [rad]."""
    strain = np.zeros((angles.size, 6))
    strain[:, 3] = np.sin(angles)
    stress, tangent = material.stress_and_tangent(strain)
    return stress[:, 3], tangent[:, 3, 3]
