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
    at_rest = modulus[:, 0].min()
    return math.sqrt(at_rest / material.density), math.sqrt(softest / material.density)


def shear_energy(material: Material, angle: float) -> float:
    """Return the work per volume [J/m³] of shearing the fabric by an angle [rad] in its plane.

    To the side that takes less.
    """
    angles = np.linspace(0.0, angle, 91)
    stress = _in_plane_shear(material, angles)[0]
    return float(np.trapezoid(stress, np.sin(angles)).min())


def _in_plane_shear(material: Material, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the size of S12 [Pa] and its tangent to 2 E12 [Pa] at shear angles (n,) [rad].

    To the positive and to the negative side (2, n).
    """
    strain = np.zeros((2, angles.size, 6))
    strain[0, :, 3] = np.sin(angles)
    # next to zero, where the tangent may jump, still on the negative side
    strain[1, :, 3] = -np.maximum(strain[0, :, 3], np.finfo(float).tiny)
    stress, tangent = material.stress_and_tangent(strain)
    return np.abs(stress[..., 3]), tangent[..., 3, 3]
