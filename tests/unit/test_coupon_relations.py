"""Closed forms of the coupon tests against tabulated values, energy balances and limits."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from lcmchain.coupons import analytic
from lcmchain.coupons.analytic import BiasExtension, PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.synthetic import preset_fabric, strip_bending_stiffness
from lcmchain.materials.features.shear_compaction import free_shear_stress

MD600 = preset_fabric("MD600")
THICKNESS = 1.004e-3
SPECIMEN = BiasExtension(length=0.32, width=0.16, thickness=THICKNESS)
COMPACTION = (MD600.law.c0, MD600.law.c1, MD600.law.c2)
AREAL_WEIGHT = 0.6 * 9.81


def md600_stress(angle):
    return free_shear_stress(MD600, angle)


# Displacement [mm], shear angle [deg], force [N] for S12 = 2 C12 E12 and Table B.1.
BIAS_EXTENSION = [
    (1, 0.718, 0.55), (2, 1.441, 1.04), (5, 3.639, 2.20), (10, 7.406, 3.43), (15, 11.320, 4.20),
    (20, 15.404, 4.89), (25, 19.689, 5.73), (30, 24.215, 6.80), (35, 29.036, 8.11),
    (40, 34.229, 9.71), (45, 39.911, 11.92), (50, 46.274, 15.61), (55, 53.674, 22.82),
    (60, 62.952, 37.88), (65, 77.833, 78.45),
]  # fmt: skip


@pytest.mark.parametrize(("millimetres", "degrees", "newtons"), BIAS_EXTENSION)
def test_bias_extension_force_of_the_published_law(millimetres, degrees, newtons):
    angle = SPECIMEN.shear_angle(1e-3 * millimetres)
    assert math.degrees(angle) == pytest.approx(degrees, abs=6e-4)
    assert float(SPECIMEN.force(angle, md600_stress)) == pytest.approx(newtons, abs=6e-3)


SPECIMENS = [(0.32, 0.16), (0.3, 0.1), (0.25, 0.05)]


@pytest.mark.parametrize(("length", "width"), SPECIMENS)
def test_bias_extension_kinematics_and_areas(length, width):
    specimen = BiasExtension(length, width, THICKNESS)
    angle = np.radians(np.linspace(0.0, 89.0, 90))
    displacement = specimen.displacement(angle)
    assert specimen.shear_angle(displacement) == pytest.approx(angle, abs=1e-9)
    slope = np.gradient(displacement, angle, edge_order=2)
    assert specimen.displacement_slope(angle) == pytest.approx(slope, abs=1e-4 * slope.max())
    assert sum(specimen.zone_areas) == pytest.approx(length * width, rel=1e-14)
    assert specimen.displacement(np.pi / 2) == pytest.approx(specimen.locking_displacement)


@pytest.mark.parametrize(("length", "width"), SPECIMENS)
def test_work_of_the_machine_is_the_stored_energy(length, width):
    """The law is elastic, so the force must integrate to the energy of zones B and C."""
    specimen = BiasExtension(length, width, THICKNESS)
    angle = np.radians(np.linspace(0.0, 60.0, 4001))
    force = specimen.force(angle, md600_stress)
    work = np.trapezoid(force, specimen.displacement(angle))

    def energy_density(shear_angle):
        strain = np.zeros(6)
        strain[3] = math.sin(shear_angle)
        return float(MD600.membrane_energy(strain))

    _, half_sheared, sheared = specimen.zone_areas
    stored = THICKNESS * (
        sheared * energy_density(angle[-1]) + half_sheared * energy_density(angle[-1] / 2)
    )
    assert work == pytest.approx(stored, rel=1e-6)


@pytest.mark.parametrize(("length", "width"), SPECIMENS)
def test_recursion_inverts_the_force(length, width):
    specimen = BiasExtension(length, width, THICKNESS)
    angle = np.radians(np.linspace(1.0, 70.0, 60))
    stress = specimen.shear_stress_from_force(
        lambda g: specimen.force(g, md600_stress), angle, linear_below=np.radians(1e-3)
    )
    assert stress == pytest.approx(md600_stress(angle), rel=2e-4)


def test_printed_recursion_leaves_out_half_of_zone_b():
    """For a linear stress, Eq. (22) as printed gives 1.5 / 1.25 = 1.2 times the stress."""
    angle = np.radians(np.array([0.2, 0.5]))

    def force(g):
        return SPECIMEN.force(g, lambda shear_angle: 1e5 * shear_angle)

    printed = SPECIMEN.shear_stress_from_force(
        force, angle, linear_below=np.radians(0.01), share=0.5
    )
    assert printed == pytest.approx(1.2e5 * angle, rel=1e-4)


def test_specimens_without_the_assumed_zones_are_refused():
    with pytest.raises(InputError, match="twice as long as wide"):
        BiasExtension(0.3, 0.16, THICKNESS)
    with pytest.raises(InputError, match="positive"):
        BiasExtension(0.3, 0.1, 0.0)


def test_picture_frame():
    frame = PictureFrame(side=0.2, thickness=THICKNESS)
    degrees = [10, 20, 30, 40, 50, 60]
    angle = np.radians(degrees)
    assert frame.shear_angle(frame.displacement(angle)) == pytest.approx(angle, abs=1e-12)
    # F / (L t0) in MPa, doubled from the tabulated reading S12 = C12 E12.
    per_area = 1e-6 * frame.force(angle, md600_stress) / (0.2 * THICKNESS)
    table = 2.0 * np.array([0.00980, 0.01453, 0.02273, 0.03291, 0.05368, 0.09834])
    assert per_area == pytest.approx(table, abs=2e-5)
    along_edge = frame.force(angle, md600_stress) / (2.0 * np.cos(np.pi / 4 - angle / 2))
    assert frame.edge_shear_force(angle, md600_stress) == pytest.approx(along_edge, rel=1e-13)


def test_compaction_pressure_and_its_inverse():
    thickness = 1e-3 * np.array([1.004, 0.95, 0.9, 0.8, 0.7, 0.65, 0.6, 0.55, 0.5])
    table = [0, 0.00809, 0.01688, 0.05778, 0.24222, 0.54152, 1.25982, 2.99026, 7.08453]
    pressure = analytic.compaction_pressure(thickness / THICKNESS, *COMPACTION)
    assert 1e-6 * pressure == pytest.approx(table, abs=6e-6)
    assert pressure == pytest.approx(MD600.compaction_pressure(thickness / THICKNESS), rel=1e-12)
    inverse = {0.001: 0.9975, 0.01: 0.9377, 0.05: 0.8112, 0.2: 0.7124, 0.5: 0.6548, 2.0: 0.5732}
    for wanted, expected in inverse.items():
        stretch = brentq(
            lambda s, p=wanted: 1e-6 * analytic.compaction_pressure(s, *COMPACTION) - p, 0.4, 1.0
        )
        assert 1e3 * THICKNESS * stretch == pytest.approx(expected, abs=6e-5)
    assert analytic.compaction_pressure(1.1, *COMPACTION) == 0.0


def test_experimental_compaction_law():
    A, B, solid_height = 0.2820, 0.0926, 0.6 / 1810
    thickness = 1e-3 * np.array([0.9, 0.8, 0.7, 0.65, 0.6])
    pressure = analytic.power_law_pressure(thickness, A, B, solid_height)
    assert 1e-6 * pressure == pytest.approx([0.01789, 0.06381, 0.26987, 0.6008, 1.42603], rel=1e-3)
    fraction = analytic.power_law_fibre_volume_fraction(pressure, A, B)
    assert fraction == pytest.approx([0.3683, 0.4144, 0.4736, 0.5100, 0.5525], abs=6e-5)
    assert solid_height / fraction == pytest.approx(thickness, rel=1e-12)


# Load parameter; x/L, y/L, tip slope [deg], chord angle [deg], clamp moment M L / D.
ELASTICA = [
    (0.1, 0.99991, 0.01250, 0.955, 0.716, 0.0500), (1, 0.99125, 0.12347, 9.460, 7.100, 0.4969),
    (3, 0.93151, 0.33965, 26.559, 20.033, 1.4276), (5, 0.84666, 0.49591, 39.935, 30.358, 2.2269),
    (8, 0.72442, 0.64063, 53.865, 41.487, 3.2016), (15, 0.52957, 0.78604, 70.750, 56.031, 4.8561),
    (30, 0.34276, 0.87309, 82.972, 68.566, 7.2378), (100, 0.15922, 0.93752, 89.617, 80.361, 13.693),
]  # fmt: skip


@pytest.mark.parametrize(("load", "x", "y", "tip", "chord", "moment"), ELASTICA)
def test_heavy_elastica(load, x, y, tip, chord, moment):
    shape = analytic.elastica(load)
    assert shape.load_parameter == pytest.approx(load, rel=1e-9)
    assert (shape.x[-1], shape.y[-1]) == pytest.approx((x, y), abs=6e-6)
    assert math.degrees(shape.slope[-1]) == pytest.approx(tip, abs=6e-4)
    assert math.degrees(shape.chord_angle) == pytest.approx(chord, abs=6e-4)
    assert shape.clamp_moment == pytest.approx(moment, rel=2e-4)
    # The clamp carries the moment of the weight: integral of x over the strip, times Λ.
    s = np.linspace(0.0, 1.0, len(shape.x))
    assert shape.clamp_moment == pytest.approx(load * np.trapezoid(shape.x, s), rel=2e-4)
    assert (shape.x[0], shape.y[0], shape.slope[0]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_small_deflection_is_that_of_beam_theory():
    shape = analytic.elastica(1e-3)
    assert shape.y[-1] == pytest.approx(1e-3 / 8.0, rel=1e-5)
    assert shape.slope[-1] == pytest.approx(1e-3 / 6.0, rel=1e-5)


def test_overhang_and_bending_length_of_the_published_stiffness():
    assert analytic.load_parameter_at_chord_angle(analytic.CANTILEVER_ANGLE) == pytest.approx(
        8.0042, abs=6e-5
    )
    table = [(0, 3.2100, 81.70, 163.4), (90, 3.6321, 85.14, 170.3), (45, 1.176, 58.46, 116.9)]
    for degrees, stiffness, length, overhang in table:
        D = strip_bending_stiffness(MD600, math.radians(degrees), "free-strip")
        assert 1e3 * D == pytest.approx(stiffness, rel=2e-4)
        assert 1e3 * np.cbrt(D / AREAL_WEIGHT) == pytest.approx(length, abs=6e-3)
        found = analytic.overhang_at_angle(D, AREAL_WEIGHT)
        assert 1e3 * found == pytest.approx(overhang, abs=0.06)
        assert analytic.bending_stiffness_from_overhang(found, AREAL_WEIGHT) == pytest.approx(D)
    wide = strip_bending_stiffness(MD600, math.radians(45), "cylindrical")
    assert 1e3 * wide == pytest.approx(2.066, abs=6e-4)
    assert 1e3 * analytic.overhang_at_angle(wide, AREAL_WEIGHT) == pytest.approx(141.1, abs=0.06)


def test_elastica_refuses_what_it_cannot_bend():
    with pytest.raises(ValueError, match="slope of the tip"):
        analytic.elastica_with_tip_slope(math.pi / 2)
    with pytest.raises(ValueError, match="load parameter"):
        analytic.elastica(1e4)
    with pytest.raises(ValueError, match="chord angle"):
        analytic.load_parameter_at_chord_angle(math.radians(89.0))
    with pytest.raises(ValueError, match="free-strip"):
        analytic.strip_stiffness(1.0, 1.0, 1.0, 0.5, "anything")
