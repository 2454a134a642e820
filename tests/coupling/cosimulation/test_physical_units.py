"""Units of measurement: names of model descriptions, conversion, refusal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.coupling.cosimulation.physical_units import (
    Conversion,
    UnitError,
    conversion,
    display_unit,
    unit_from_base,
    unit_from_name,
    value_of,
)

PAIRS = [
    ("kN", "N", 1000.0, 0.0), ("degC", "K", 1.0, 273.15), ("K", "degC", 1.0, -273.15),
    ("m/s2", "mm/s^2", 1000.0, 0.0), ("N.m", "J", 1.0, 0.0), ("N m", "J", 1.0, 0.0),
    ("rad", "deg", 180.0 / np.pi, 0.0), ("rev/min", "rad/s", np.pi / 30.0, 0.0),
    ("kg.m-3", "g/cm3", 1e-3, 0.0), ("MPa", "N/mm2", 1.0, 0.0), ("bar", "Pa", 1e5, 0.0),
    ("%", "1", 0.01, 0.0), ("degF", "degC", 5.0 / 9.0, -160.0 / 9.0), ("s-1", "Hz", 1.0, 0.0),
    ("Nm", "N.m", 1.0, 0.0), ("kNm/rad", "J", 1000.0, 0.0), ("Nmm", "Nm", 1e-3, 0.0),
    ("kOhm", "V/A", 1000.0, 0.0),
]  # fmt: skip


@pytest.mark.parametrize("source, target, factor, offset", PAIRS)
def test_units_are_converted(source, target, factor, offset):
    found = conversion(unit_from_name(source), unit_from_name(target))
    assert found.factor == pytest.approx(factor, rel=1e-14)
    assert found.offset == pytest.approx(offset, rel=1e-14, abs=1e-30)


@given(pair=st.sampled_from(PAIRS), value=st.floats(-1e6, 1e6))
def test_there_and_back_is_the_same(pair, value):
    one, other = unit_from_name(pair[0]), unit_from_name(pair[1])
    back = conversion(one, other).then(conversion(other, one))
    assert back(np.array([value]))[0] == pytest.approx(value, rel=1e-12, abs=1e-9)


def test_the_same_unit_changes_no_bit():
    values = np.array([0.1, 1e-300, 3.0])
    same = conversion(unit_from_name("N"), unit_from_name("kg.m/s2"))
    assert same == Conversion()
    assert np.array_equal(same(values), values) and same(values) is not values


def test_differences_of_temperatures_have_no_offset():
    celsius, kelvin = unit_from_name("degC"), unit_from_name("K")
    assert conversion(celsius, kelvin, relative=True) == Conversion()


def test_other_dimensions_and_unknown_units_are_refused():
    with pytest.raises(UnitError, match=r"m \(m\) cannot be converted into N \(kg m s\^-2\)"):
        conversion(unit_from_name("m"), unit_from_name("N"))
    for name in ("nonsense", "m[", "m" * 200, "m**"):
        with pytest.raises(UnitError, match="unknown unit"):
            unit_from_name(name)
    with pytest.raises(UnitError, match="factor"):
        unit_from_base("odd", (0.0,) * 7, 0.0, 0.0)


def test_a_unit_of_base_units_is_that_of_its_name():
    own = unit_from_base("daN", (1.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.0), 10.0, 0.0)
    assert conversion(own, unit_from_name("N")) == Conversion(10.0)


def test_values_are_read_with_their_units():
    assert value_of("5 kN", unit_from_name("N")) == 5000.0
    assert value_of("20 degC", unit_from_name("K")) == 293.15
    assert value_of("1e-3", unit_from_name("1")) == 1e-3
    for text, reason in (("5", "has no unit"), ("five N", "not a number"), ("5 m", "converted")):
        with pytest.raises(UnitError, match=reason):
            value_of(text, unit_from_name("N"))


def test_units_that_an_archive_defines_go_before_their_usual_meaning():
    meter = unit_from_name("m")
    own = {"in": unit_from_base("in", meter.exponents, 2.0, 0.0)}
    assert value_of("3 in", meter, known=own) == 6.0
    assert value_of("3 in", meter) == pytest.approx(0.0762)
    assert value_of("3 ft", meter, known=own) == pytest.approx(0.9144)


def test_a_shown_unit_counts_from_the_one_that_it_shows():
    """degF = 9/5 K - 459.67, and of degC 9/5 degC + 32."""
    kelvin, celsius = unit_from_name("K"), unit_from_name("degC")
    for of, offset in ((kelvin, -459.67), (celsius, 32.0)):
        shown = display_unit("degF", of, 1.8, offset)
        assert conversion(shown, kelvin)(np.array([212.0]))[0] == pytest.approx(373.15, rel=1e-14)
    with pytest.raises(UnitError, match="factor"):
        display_unit("odd", kelvin, 0.0, 0.0)
