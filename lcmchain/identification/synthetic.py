"""Coupon data made from a fabric law: exact curves with seeded multiplicative noise.

For tests of the identification, and for planning: how many points, over which range, determine
which parameter.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lcmchain.atomic import replacing
from lcmchain.coupons.analytic import (
    CANTILEVER_ANGLE,
    BiasExtension,
    PictureFrame,
    elastica,
    overhang_at_angle,
    power_law_pressure,
    strip_stiffness,
)
from lcmchain.materials.fabric import Fabric
from lcmchain.materials.features.rheology import Friction, Values
from lcmchain.materials.features.shear_compaction import free_shear_stress
from lcmchain.materials.features.shear_friction import ShearFriction
from lcmchain.materials.features.viscous_shear import ViscousShear
from lcmchain.scene import FabricMaterial
from lcmchain.scene.presets import PRESETS

# Steps in which a rate is followed from one row of a test to the next.
_PARTS_OF_A_ROW = 60


def preset_fabric(name: str = "MD600") -> Fabric:
    """Return a fabric that scenes can name."""
    return FabricMaterial.model_validate(PRESETS[name]).build()


def noisy(values: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """Return values times (1 + noise ε), ε standard normal from the seed."""
    return values * (1.0 + noise * np.random.default_rng(seed).standard_normal(np.shape(values)))


def bias_extension_curve(
    fabric: Fabric,
    specimen: BiasExtension,
    displacement: ArrayLike,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the machine force [N] at displacements [m]."""
    angle = specimen.shear_angle(displacement)
    return noisy(specimen.force(angle, lambda g: free_shear_stress(fabric, g)), noise, seed)


def picture_frame_curve(
    fabric: Fabric,
    viscous: ViscousShear,
    specimen: PictureFrame,
    time: ArrayLike,
    displacement: ArrayLike,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the force [N] of a frame at times [s] from 0 on, with travels [m] from 0 on."""
    times, travels = np.asarray(time, dtype=float), np.asarray(displacement, dtype=float)
    memory, of_rate = np.zeros(len(viscous.memory)), [0.0]
    for start in range(len(times) - 1):
        size = (times[start + 1] - times[start]) / _PARTS_OF_A_ROW
        way = np.linspace(travels[start], travels[start + 1], _PARTS_OF_A_ROW + 1)
        for strain in np.sin(specimen.shear_angle(way[1:])):
            memory = viscous.in_step(strain, memory, size)
        of_rate.append(float(memory[1]))
    angle = np.where(travels > 0.0, specimen.shear_angle(travels), 0.0)
    stress = free_shear_stress(fabric, angle) + np.array(of_rate)
    return noisy(specimen.force(angle, lambda _: stress), noise, seed)


def bending_loop_curve(
    stiffness: float,
    friction: Friction,
    curvature: ArrayLike,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the moment per width [N] of a fabric that rubs, at curvatures [1/m] from rest on.

    stiffness : per width [N m]. noise : over the largest moment.
    """
    moment: Values = 0.0
    found, last = [], 0.0
    for now in np.asarray(curvature, dtype=float):
        moment = friction.after(moment, now - last)
        found.append(stiffness * now + moment)
        last = now
    return _with_even_noise(np.array(found), noise, seed)


def shear_loop_curve(
    fabric: Fabric,
    friction: ShearFriction,
    specimen: PictureFrame,
    displacement: ArrayLike,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the force [N] of a frame that is sheared there and back, at travels [m] from 0 on.

    noise : over the largest force.
    """
    travels = np.asarray(displacement, dtype=float)
    memory, of_friction, last = np.zeros(len(friction.memory)), [], 0.0
    for travel in travels:
        way = np.linspace(last, travel, _PARTS_OF_A_ROW + 1)[1:]
        angles = specimen.shear_angle(way)
        strains, stress = (
            np.sin(angles),
            np.sign(angles) * free_shear_stress(fabric, np.abs(angles)),
        )
        before = memory[0]
        for strain, elastic in zip(strains, stress, strict=True):
            before, memory = memory[0], friction.in_step(strain, memory, elastic)
        of_friction.append(float(friction.stress_of(before, memory[0], memory[1])))
        last = travel
    angle = specimen.shear_angle(travels)
    total = np.sign(angle) * free_shear_stress(fabric, np.abs(angle)) + np.array(of_friction)
    return _with_even_noise(specimen.force(angle, lambda _: total), noise, seed)


def _with_even_noise(values: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """Return values with errors of one size, over the largest value."""
    errors = np.random.default_rng(seed).standard_normal(len(values))
    return values + noise * float(np.abs(values).max()) * errors


def compaction_curve(
    fabric: Fabric, thickness: ArrayLike, *, noise: float = 0.0, seed: int = 0
) -> np.ndarray:
    """Return the pressure [Pa] of plate-to-plate compaction at thicknesses [m]."""
    return noisy(fabric.compaction_pressure(np.asarray(thickness) / fabric.thickness), noise, seed)


def power_law_curve(
    thickness: ArrayLike,
    A: float,
    B: float,
    solid_height: float,
    *,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the pressure [Pa] of the experimental compaction law, Eq. (24)."""
    return noisy(power_law_pressure(thickness, A, B, solid_height), noise, seed)


def strip_bending_stiffness(fabric: Fabric, orientation: ArrayLike, assumption: str) -> np.ndarray:
    """Return the bending stiffness per width [N m] of a strip cut at an angle [rad]."""
    law = fabric.law
    stiffness = strip_stiffness(law.B11, law.B22, law.B12, orientation, assumption)
    return stiffness * fabric.thickness**3 / 12.0


def cantilever_overhangs(
    fabric: Fabric,
    orientation: ArrayLike,
    *,
    areal_weight: float,
    angle: float = CANTILEVER_ANGLE,
    assumption: str = "free-strip",
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return the overhang [m] at a chord angle [rad] of strips cut at orientations [rad]."""
    stiffness = strip_bending_stiffness(fabric, np.asarray(orientation), assumption)
    return noisy(overhang_at_angle(stiffness, areal_weight, angle), noise, seed)


def cantilever_shape(
    bending_stiffness: float, areal_weight: float, overhang: float, *,
    point_count: int = 41, noise: float = 0.0, seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return points x, drop y [m] of a deflection curve; noise relative to the overhang."""
    shape = elastica(areal_weight * overhang**3 / bending_stiffness, point_count)
    points = overhang * np.stack([shape.x, shape.y])
    errors = np.random.default_rng(seed).standard_normal(points.shape)
    errors[:, 0] = 0.0  # the clamp is where the axes start
    x, y = points + noise * overhang * errors
    return x, y


def write_coupon(path: Path | str, columns: dict[str, np.ndarray], comment: str = "") -> None:
    """Write columns, named with their units and already in them, as a coupon CSV file."""
    lines = [f"# {line}" for line in comment.splitlines()]
    lines.append(",".join(columns))
    lines += [",".join(f"{value:.7g}" for value in row) for row in zip(*columns.values())]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
