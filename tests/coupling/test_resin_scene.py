"""Scene tables of the resin: what they build, what they refuse, and the published values."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from lcmchain.coupling.infiltration.resin import advance_cure, resin_of
from lcmchain.coupling.infiltration.resin_temperature import temperature_of
from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.scene.infiltration.laws import Resin
from lcmchain.scene.presets import CURES, VISCOSITIES

TABLE = TypeAdapter(Resin)
WARM = {"law": "constant", "value": "180 degC"}
CONSTANT = {"law": "constant", "viscosity": "100 mPa*s"}
ARRHENIUS = {
    "law": "arrhenius", "reference_viscosity": "0.3 Pa*s", "reference_temperature": "25 degC",
    "activation_energy": "40 kJ/mol", "temperature": WARM,
}  # fmt: skip
CASTRO = {"law": "castro_macosko", "preset": "AroCy-L10", "temperature": WARM}
FIRST_ORDER = {"law": "nth_order", "rate": "1e5 1/s", "energy": "60 kJ/mol", "order": 1}


def read(table):
    return TABLE.validate_python(table, context=FROM_FILE)


def test_the_shortest_table_is_a_constant_viscosity():
    resin = resin_of(read(CONSTANT))
    assert resin.viscosity(300.0, 0.0) == pytest.approx(0.1, rel=1e-12)
    assert (resin.density, resin.reacts) == (1150.0, False)
    assert temperature_of(read(CONSTANT)) is None


def test_every_entry_arrives_in_si_units():
    resin = resin_of(read({**ARRHENIUS, "density": "1.2 g/cm^3", "gel_cure": 0.6, "cure": {
        "law": "kamal_sourour", "rate_1": "60 1/min", "energy_1": "50 kJ/mol", "rate_2": "2 1/s",
        "energy_2": "10 kcal/mol", "order": 1.7, "order_1": 0.5, "autocatalytic_order": 1.2,
    }, "initial_cure": 0.02}))  # fmt: skip
    assert resin.viscosity(np.array([298.15]), 0.0)[0] == pytest.approx(0.3, rel=1e-12)
    kinetics = resin.kinetics
    assert (kinetics.rate_1, kinetics.energy_1, kinetics.rate_2) == (1.0, 5e4, 2.0)
    assert kinetics.energy_2 == pytest.approx(41840.0)
    assert (kinetics.order, kinetics.order_1, kinetics.autocatalytic_order) == (1.7, 0.5, 1.2)
    assert (resin.density, resin.gel_cure, resin.initial_cure) == (1200.0, 0.6, 0.02)


def test_a_preset_fills_what_is_left_out_and_given_values_replace_it():
    table = read({**CASTRO, "exponent": 2.0})
    assert (table.exponent, table.exponent_slope, table.gel_cure) == (2.0, 1.4, 0.64)
    assert table.preset_values()["exponent"] == 2.32
    resin = resin_of(read(CASTRO))
    by_hand = 3.32e-8 * np.exp(42.9e3 / 8.314462618 / 423.15) * (0.64 / 0.34) ** (2.32 + 0.42)
    assert resin.viscosity(423.15, 0.3) == pytest.approx(by_hand, rel=1e-8)


@pytest.mark.parametrize("name", CURES)
def test_every_published_cure_is_a_law_with_a_basis(name):
    table = read(
        {**CONSTANT, "temperature": WARM, "cure": {"law": "kamal_sourour", "preset": name}}
    )
    for key, (value, basis) in CURES[name].items():
        assert basis.kind == "stated" and basis.note
        if not isinstance(value, str):
            assert getattr(table.cure, key) == value
    assert resin_of(table).reacts
    assert table.preset_values()["cure"]["preset"] == name


def test_the_three_fits_of_one_resin_agree_within_a_factor_of_two_in_time():
    """What was read of independent tests of RTM6 describes one resin: a wrong digit would show."""
    times = {}
    for name in CURES:
        cure = {"law": "kamal_sourour", "preset": name}
        resin = resin_of(read({**CONSTANT, "temperature": WARM, "cure": cure}))
        for hot in (433.15, 453.15):
            steps = np.arange(0.0, 7200.0, 10.0)
            cured, history = np.zeros(1), []
            for _ in steps:
                cured = advance_cure(resin.cure_rate, cured, hot, 10.0)
                history.append(cured[0])
            times[name, hot] = float(np.interp(0.5, history, steps))
    for hot in (433.15, 453.15):
        of_all = [times[name, hot] for name in CURES]
        assert max(of_all) < 2.0 * min(of_all)
        assert 300.0 < min(of_all) < 6000.0


@pytest.mark.parametrize("name", VISCOSITIES)
def test_every_published_viscosity_is_a_thin_resin_at_its_temperature(name):
    resin = resin_of(read({**CASTRO, "preset": name}))
    assert 0.001 < resin.viscosity(393.15, 0.0) < 0.1


def test_temperatures():
    prescribed = {"law": "prescribed", "times": "0 60 s", "values": "60 80 degC"}
    law = temperature_of(read({**CONSTANT, "temperature": prescribed}))
    assert law.inlet(30.0) == pytest.approx(343.15)
    mould = {"law": "mould", "inlet": "60 degC", "mould": "120 degC", "diffusivity": "0.2 mm^2/s"}
    law = temperature_of(read({**CONSTANT, "temperature": mould}))
    assert law.advance(np.array([333.15]), np.array([1e-3]), 0.0, 60.0)[0] == pytest.approx(393.15)
    law = temperature_of(
        read({**CONSTANT, "temperature": {**mould, "mould": "100 120 degC", "times": "0 1 min"}})
    )
    assert law.values == pytest.approx((373.15, 393.15)) and law.times == (0.0, 60.0)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"law": "constant"}, "viscosity\n.*[Ff]ield required"),
        ({**CONSTANT, "viscosity": 0.1}, "has no unit"),
        ({**CONSTANT, "viscosity": "0.1 Pa"}, "of dimension"),
        ({**CONSTANT, "viscosity": "0 Pa*s"}, "be positive"),
        ({**ARRHENIUS, "temperature": None}, "the viscosity depends on it"),
        ({**CONSTANT, "cure": FIRST_ORDER}, "the cure depends on it"),
        ({**ARRHENIUS, "gel_cure": 0.2, "initial_cure": 0.3}, "not below the gel point"),
        (
            {**CONSTANT, "temperature": WARM, "cure": {
                "law": "autocatalytic", "rate": "1 1/s", "energy": "50 kJ/mol", "order": 1,
                "autocatalytic_order": 1,
            }},
            "never starts",
        ),
        ({**CASTRO, "exponent_slope": -5}, "must be positive there"),
        ({**CASTRO, "preset": "AroCy"}, 'did you mean "AroCy-L10"'),
        ({**CASTRO, "preset": ["AroCy-L10"]}, "there is no preset"),
        ({**CONSTANT, "temperature": {**WARM, "value": "-300 degC"}}, "be positive"),
        (
            {**CONSTANT, "temperature": {
                "law": "prescribed", "times": "0 1 s", "values": "60 70 80 degC"
            }},
            "needs 2 values",
        ),
        (
            {**CONSTANT, "temperature": {
                "law": "prescribed", "times": "1 1 s", "values": "60 70 degC"
            }},
            "must increase",
        ),
        (
            {**CONSTANT, "temperature": {
                "law": "mould", "inlet": "60 degC", "mould": "100 120 degC",
                "diffusivity": "0.2 mm^2/s",
            }},
            "needs one value without times",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(table, message):
    with pytest.raises(ValidationError, match=message):
        read(table)
