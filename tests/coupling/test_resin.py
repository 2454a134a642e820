"""Laws of the resin: viscosity, rate of cure, its integration in time, temperature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from lcmchain.coupling.infiltration.resin import (
    GAS_CONSTANT,
    ArrheniusViscosity,
    CastroMacoskoViscosity,
    ConstantViscosity,
    KamalSourour,
    advance_cure,
)
from lcmchain.coupling.infiltration.resin_temperature import (
    ConstantTemperature,
    MouldTemperature,
    PrescribedTemperature,
)
from lcmchain.errors import InputError

# Rates do not depend on the temperature where the activation energy is zero.
ANY = np.array([400.0])
RATE = 0.01  # [1/s]


def cured(kinetics, start, time, **options):
    return advance_cure(kinetics.cure_rate, np.array([start]), ANY, time, **options)[0]


@pytest.mark.parametrize("time", [1.0, 30.0, 120.0, 500.0])
@pytest.mark.parametrize(
    ("kinetics", "start", "exact"),
    [
        (KamalSourour.nth_order(RATE, 0.0, 1.0), 0.0, lambda kt: 1.0 - np.exp(-kt)),
        (KamalSourour.nth_order(RATE, 0.0, 2.0), 0.0, lambda kt: kt / (1.0 + kt)),
        # below order one the reaction ends in a finite time
        (KamalSourour.nth_order(RATE, 0.0, 0.5), 0.0, lambda kt: 1.0 - max(1.0 - kt / 2, 0.0) ** 2),
        (
            KamalSourour.autocatalytic(RATE, 0.0, 1.0, 1.0),
            0.01,
            lambda kt: 1.0 / (1.0 + 99.0 * np.exp(-kt)),
        ),
        (
            KamalSourour(rate_1=RATE, rate_2=3.0 * RATE),  # (k1 + 3 k1 cure) (1 - cure)
            0.0,
            lambda kt: (1.0 - np.exp(-4.0 * kt)) / (1.0 + 3.0 * np.exp(-4.0 * kt)),
        ),
    ],
    ids=["first order", "second order", "order one half", "autocatalytic", "Kamal"],
)
def test_cure_follows_the_closed_solutions(kinetics, start, exact, time):
    assert cured(kinetics, start, time) == pytest.approx(exact(RATE * time), abs=2e-5)


def test_the_tolerance_rules_the_error_of_the_cure():
    kinetics = KamalSourour.nth_order(RATE, 0.0, 2.0)
    errors = [
        abs(cured(kinetics, 0.0, 300.0, tolerance=tolerance) - 3.0 / 4.0)
        for tolerance in (1e-4, 1e-6, 1e-8)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < 0.1 * errors[0] and errors[2] < 0.1 * errors[1]


kinetics_of_any_resin = st.builds(
    KamalSourour,
    rate_1=st.floats(1e-3, 1e6),
    energy_1=st.floats(0.0, 1e5),
    rate_2=st.floats(0.0, 1e6),
    energy_2=st.floats(0.0, 1e5),
    autocatalytic_order=st.floats(0.0, 3.0),
    order=st.floats(0.1, 4.0),
    order_1=st.none() | st.floats(0.1, 4.0),
)


@given(kinetics_of_any_resin, st.floats(0.0, 1.0), st.floats(250.0, 600.0), st.floats(0.0, 1e9))
def test_cure_stays_between_its_start_and_one_whatever_the_step(kinetics, start, hot, step):
    start, hot = np.array([start]), np.array([hot])
    end = advance_cure(kinetics.cure_rate, start, hot, step)
    assert start[0] <= end[0] + 1e-15
    assert end[0] <= 1.0


def test_one_place_does_not_depend_on_the_others():
    kinetics = KamalSourour(2.0, 3e4, 5e4, 5.5e4, 1.2, 1.8)
    cure, hot = np.linspace(0.0, 0.9, 7), np.linspace(380.0, 450.0, 7)
    together = advance_cure(kinetics.cure_rate, cure, hot, 40.0)
    alone = [
        advance_cure(kinetics.cure_rate, cure[i : i + 1], hot[i : i + 1], 40.0)[0] for i in range(7)
    ]
    np.testing.assert_array_equal(together, alone)


def test_places_without_a_value_stay_without_one():
    kinetics = KamalSourour.nth_order(RATE, 0.0, 1.0)
    cure = advance_cure(kinetics.cure_rate, np.array([np.nan, 0.0]), 400.0, 10.0)
    assert np.isnan(cure[0]) and cure[1] == pytest.approx(1.0 - np.exp(-0.1), abs=1e-6)


def test_a_temperature_that_changes_within_the_step_is_followed():
    kinetics = KamalSourour(2.6e4, 74.69e3, 5.78e4, 57.88e3, 1.217, 1.786, 0.449)
    found = advance_cure(
        kinetics.cure_rate, np.array([0.02]), 380.0, 1200.0, end_temperature=np.array([450.0])
    )
    exact = solve_ivp(
        lambda t, cure: kinetics.cure_rate(380.0 + 70.0 * t / 1200.0, cure),
        (0.0, 1200.0), [0.02], rtol=1e-10, atol=1e-12,
    ).y[0, -1]  # fmt: skip
    assert found[0] == pytest.approx(exact, abs=1e-5)
    assert abs(advance_cure(kinetics.cure_rate, np.array([0.02]), 415.0, 1200.0)[0] - exact) > 0.01


@pytest.mark.parametrize(("cure", "step"), [(-0.1, 1.0), (1.1, 1.0), (0.5, -1.0), (0.5, np.nan)])
def test_what_is_no_cure_or_step_is_refused(cure, step):
    kinetics = KamalSourour.nth_order(RATE, 0.0, 1.0)
    with pytest.raises(ValueError, match="cure outside|a step of"):
        advance_cure(kinetics.cure_rate, np.array([cure]), 400.0, step)


# --- viscosity ------------------------------------------------------------------------------------


def test_arrhenius_by_hand():
    resin = ArrheniusViscosity(0.2, 50e3, reference_temperature=300.0)
    expected = 0.2 * np.exp(50e3 / 8.314462618 * (1.0 / 350.0 - 1.0 / 300.0))
    found = resin.viscosity(np.array([300.0, 350.0]), np.array([0.0, 0.7]))
    np.testing.assert_allclose(found, [0.2, expected], rtol=1e-9)
    factor = ArrheniusViscosity(1e-8, 40e3).viscosity(np.array([330.0]), 0.0)
    assert factor[0] == pytest.approx(1e-8 * np.exp(40e3 / (GAS_CONSTANT * 330.0)), rel=1e-12)


def test_castro_macosko_by_hand_and_without_bound_at_the_gel_point():
    resin = CastroMacoskoViscosity(
        reference_viscosity=0.1, activation_energy=0.0, gel_cure=0.6, exponent=1.5,
        exponent_slope=2.0,
    )  # fmt: skip
    cure = np.array([0.0, 0.3, 0.6 - 1e-9, 0.6, 0.9])
    found = resin.viscosity(400.0, cure)
    assert found[0] == pytest.approx(0.1, rel=1e-14)
    assert found[1] == pytest.approx(0.1 * 2.0 ** (1.5 + 0.6), rel=1e-12)
    assert 1e20 < found[2] < np.inf
    assert np.all(np.isinf(found[3:]))
    assert np.all(np.diff(resin.viscosity(400.0, np.linspace(0.0, 0.599, 200))) > 0.0)


def test_any_law_stops_flowing_at_the_gel_point():
    for resin in (ConstantViscosity(0.3, gel_cure=0.5), ArrheniusViscosity(0.3, 0.0, gel_cure=0.5)):
        np.testing.assert_array_equal(resin.viscosity(400.0, np.array([0.49, 0.5])), [0.3, np.inf])


def test_a_resin_of_constant_viscosity_neither_cures_nor_asks_for_a_temperature():
    resin = ConstantViscosity(0.1)
    assert not resin.reacts and not resin.depends_on_temperature and np.isinf(resin.gel_cure)
    np.testing.assert_array_equal(resin.cure_rate(np.full(3, 400.0), np.zeros(3)), np.zeros(3))
    np.testing.assert_array_equal(resin.advance_cure(np.full(2, 0.1), 400.0, 1e9), [0.1, 0.1])
    cures = ConstantViscosity(0.1, kinetics=KamalSourour.nth_order(1.0, 5e4, 1.0))
    assert cures.reacts and cures.depends_on_temperature


@pytest.mark.parametrize(
    ("build", "key"),
    [
        (lambda: ConstantViscosity(0.0), "resin.viscosity"),
        (lambda: ConstantViscosity(np.nan), "resin.viscosity"),
        (lambda: ConstantViscosity(0.1, density=-1.0), "resin.density"),
        (lambda: ConstantViscosity(0.1, gel_cure=0.5, initial_cure=0.5), "resin.initial_cure"),
        (
            lambda: ConstantViscosity(0.1, kinetics=KamalSourour.autocatalytic(1.0, 0.0, 1.0, 1.0)),
            "resin.initial_cure",
        ),
        (lambda: ArrheniusViscosity(0.1, -1.0), "resin.activation_energy"),
        (lambda: ArrheniusViscosity(0.1, 1.0, -300.0), "resin.reference_temperature"),
        (
            lambda: CastroMacoskoViscosity(
                reference_viscosity=0.1, activation_energy=0.0, exponent=1.0
            ),
            "resin.gel_cure",
        ),
        (
            lambda: CastroMacoskoViscosity(
                reference_viscosity=0.1,
                activation_energy=0.0,
                gel_cure=0.5,
                exponent=1.0,
                exponent_slope=-2.0,
            ),
            "resin.exponent",
        ),  # fmt: skip
        (lambda: KamalSourour(), "resin.cure"),
        (lambda: KamalSourour(rate_1=-1.0), "resin.cure.rate_1"),
        (lambda: KamalSourour(rate_1=1.0, order=0.0), "resin.cure.order"),
    ],
)
def test_wrong_resins_are_refused_by_the_key(build, key):
    with pytest.raises(InputError) as caught:
        build()
    assert caught.value.key == key


# --- temperature ----------------------------------------------------------------------------------


def test_resin_warms_to_the_mould_as_the_ordinary_differential_equation_says():
    law = MouldTemperature(330.0, (0.0, 60.0, 90.0), (350.0, 400.0, 390.0), diffusivity=1.5e-7)
    thickness = np.array([1e-3, 3e-3])
    relaxation = thickness**2 / (np.pi**2 * 1.5e-7)
    found = law.advance(np.full(2, law.inlet(0.0)), thickness, 0.0, 100.0)
    for place in range(2):
        exact = solve_ivp(
            lambda t, T: (np.interp(t, law.times, law.values) - T) / relaxation[place],  # noqa: B023
            (0.0, 100.0), [330.0], rtol=1e-9, atol=1e-9, max_step=0.5,
        ).y[0, -1]  # fmt: skip
        assert found[place] == pytest.approx(exact, abs=1e-3)


@given(st.lists(st.floats(0.1, 50.0), min_size=1, max_size=8))
def test_the_temperature_does_not_depend_on_the_steps(steps):
    law = MouldTemperature(320.0, (0.0, 40.0), (350.0, 410.0), diffusivity=2e-7)
    whole = law.advance(np.array([320.0]), np.array([2e-3]), 0.0, sum(steps))
    time, parts = 0.0, np.array([320.0])
    for step in steps:
        parts = law.advance(parts, np.array([2e-3]), time, step)
        time += step
    assert parts[0] == pytest.approx(whole[0], rel=1e-11)


def test_the_relaxation_is_that_of_the_first_fourier_mode():
    # After a while only the first mode of the layer is left: compare the decay with conduction
    # through a layer between two faces at the mould's temperature, solved by finite differences.
    thickness, diffusivity, count = 2e-3, 2e-7, 80
    law = MouldTemperature(300.0, (0.0,), (400.0,), diffusivity)
    spacing = thickness / count
    second = (np.diag(np.full(count, -2.0)) + np.eye(count, k=1) + np.eye(count, k=-1)) / spacing**2
    second[0, 0] = second[-1, -1] = -3.0 / spacing**2  # the faces lie half a cell away
    values, vectors = np.linalg.eigh(diffusivity * second)

    def mean_difference(time):
        start = vectors.T @ np.full(count, -100.0)
        return np.mean(vectors @ (np.exp(values * time) * start))

    early, late = 2.0, 4.0
    decay = mean_difference(late) / mean_difference(early)
    cooled = law.advance(np.array([300.0]), np.array([thickness]), 0.0, late - early)
    assert (cooled[0] - 400.0) / -100.0 == pytest.approx(decay, rel=1e-3)


def test_prescribed_and_constant_temperatures():
    law = PrescribedTemperature((10.0, 20.0), (330.0, 350.0))
    assert (law.inlet(0.0), law.inlet(15.0), law.inlet(99.0)) == (330.0, 340.0, 350.0)
    np.testing.assert_array_equal(law.advance(np.zeros(2), np.ones(2), 5.0, 10.0), [340.0, 340.0])
    law = ConstantTemperature(360.0)
    assert law.inlet(3.0) == 360.0
    np.testing.assert_array_equal(law.advance(np.zeros(2), np.ones(2), 5.0, 10.0), [360.0, 360.0])


@pytest.mark.parametrize(
    "build",
    [
        lambda: ConstantTemperature(-5.0),
        lambda: PrescribedTemperature((1.0, 1.0), (300.0, 310.0)),
        lambda: PrescribedTemperature((1.0,), (300.0, 310.0)),
        lambda: PrescribedTemperature((), ()),
        lambda: MouldTemperature(300.0, (0.0,), (0.0,), 1e-7),
        lambda: MouldTemperature(300.0, (0.0,), (400.0,), 0.0),
        lambda: MouldTemperature(np.nan, (0.0,), (400.0,), 1e-7),
    ],
)
def test_wrong_temperatures_are_refused(build):
    with pytest.raises(InputError, match="resin.temperature"):
        build()
