"""Measured permeability: its dependence on the fibre volume fraction, its range, its axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from lcmchain.coupling.measured_permeability import measured_law, read_permeabilities
from lcmchain.coupling.permeability import PermeabilityLaw, law_of, principal_permeabilities
from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.scene.infiltration.laws import Permeability

ENTRY = TypeAdapter(Permeability)
VALUES = {"k1": "6e-11 m^2", "k2": "40 um^2", "k3": "3e-12 m^2"}
AT_HALF = {**VALUES, "fibre_volume_fraction": 0.5, "fibre_volume_fraction_range": [0.4, 0.6]}
POWER = {"law": "power", **AT_HALF, "exponents": [3, 4, 5]}
X, Y, Z = np.eye(3)

CSV = """# measured between 1 and 5 bar
fibre volume fraction [%];k1 [m^2];k2 [um^2];k3 [m^2]
45;8e-11;60;5e-12
50;6e-11;40;3e-12
60;2e-11;12;1e-12
"""


def entry(table):
    return ENTRY.validate_python(table, context=FROM_FILE)


def sheared(angle):
    """Two fibre families (1, 3) that close by the shear angle [rad]."""
    return X[None], np.array([[np.sin(angle), np.cos(angle), 0.0]])


def tensor(found, row=0):
    values = [found.k1[row], found.k2[row], found.k3[row]]
    axes = [found.direction_1[row], found.direction_2[row], found.direction_3[row]]
    return sum(k * np.outer(e, e) for k, e in zip(values, axes, strict=True))


def test_power_and_exponential_by_hand():
    power = measured_law(entry(POWER))
    np.testing.assert_allclose(power.values(0.5), [6e-11, 4e-11, 3e-12], rtol=1e-12)
    ratio = (0.6 / 0.5) ** -np.array([3.0, 4.0, 5.0])
    np.testing.assert_allclose(power.values(0.6), ratio * [6e-11, 4e-11, 3e-12], rtol=1e-12)
    table = {"law": "exponential", **AT_HALF, "rates": [8, 9, 12]}
    ratio = np.exp(-0.05 * np.array([8.0, 9.0, 12.0]))
    np.testing.assert_allclose(
        measured_law(entry(table)).values(0.55), ratio * [6e-11, 4e-11, 3e-12], rtol=1e-12
    )


def test_constant_holds_at_any_fraction_unless_a_range_is_given():
    law = measured_law(entry({"law": "constant", **VALUES}))
    np.testing.assert_allclose(law.values(np.array([0.1, 0.9]))[1], [4e-11, 4e-11], rtol=1e-12)
    assert np.isnan(law.values(np.array([np.nan]))).all()
    table = {"law": "constant", **VALUES, "fibre_volume_fraction_range": [0.4, 0.6]}
    with pytest.raises(InputError, match=r"0\.400 and 0\.600.*1 cells.*0 with 0\.700"):
        measured_law(entry(table)).values(np.array([0.7]))


def test_a_table_is_met_at_its_rows_and_a_power_between_them(tmp_path):
    (tmp_path / "k.csv").write_text(CSV, encoding="utf-8")
    law = law_of(entry({"law": "table", "file": "k.csv"}), tmp_path)
    np.testing.assert_allclose(
        law.values(np.array([0.45, 0.5, 0.6])),
        [[8e-11, 6e-11, 2e-11], [6e-11, 4e-11, 1.2e-11], [5e-12, 3e-12, 1e-12]], rtol=1e-9,
    )  # fmt: skip
    middle = np.sqrt(0.5 * 0.6)  # geometric means belong together in a power
    np.testing.assert_allclose(law.values(middle)[0], np.sqrt(6e-11 * 2e-11), rtol=1e-9)
    assert law.limits == pytest.approx((0.45, 0.6))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("k3 [m^2]", "k3 [m]", 'column "k3"'),
        ("k3 [m^2]", "thickness [m]", 'no column "k3"'),
        ("50;", "40;", 'line 4, column "fibre volume fraction": does not rise'),
        ("60;2", "130;2", "line 5.*(too large|not between 0 and 1)"),
        ("6e-11", "-6e-11", 'line 4, column "k1": -6e-11 is not positive'),
        ("6e-11", "much", 'line 4, column "k1"'),
        ("50;6e-11;40;3e-12\n60;2e-11;12;1e-12\n", "", "1 rows"),
    ],
)
def test_a_wrong_table_names_line_and_column(tmp_path, old, new, message):
    assert old in CSV
    file = tmp_path / "k.csv"
    file.write_text(CSV.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_permeabilities(file)


def test_outside_the_range_nothing_is_clamped():
    law = measured_law(entry(POWER))
    fraction = np.array([0.39, 0.4, 0.6, 0.61, np.nan])
    with pytest.raises(InputError, match=r'"power".*0\.400 and 0\.600.*2 cells.*cell 0, 3'):
        law.values(fraction)
    found = law.values(fraction, out_of_range="nan")
    np.testing.assert_array_equal(np.isnan(found[0]), [True, False, False, True, True])


@pytest.mark.parametrize(
    "change",
    [
        {"fibre_volume_fraction_range": [0.6, 0.4]},
        {"fibre_volume_fraction_range": [0.4, 1.2]},
        {"k1": "0 m^2"},
        {"k1": "1e-10 m"},
        {"k1": 1e-10},
        {"exponents": [3, 4]},
    ],
)
def test_wrong_entries_of_a_scene_are_refused(change):
    with pytest.raises(ValueError, match="validation error"):
        entry({**POWER, **change})


def test_unsheared_axes_lie_at_the_measured_angle():
    for degrees in (0.0, 20.0, -35.0, 90.0):
        law = entry({**POWER, "angle": f"{degrees} deg"})
        found = principal_permeabilities(law, np.array([0.5]), *sheared(0.0))
        assert (found.k1[0], found.k2[0]) == pytest.approx((6e-11, 4e-11), rel=1e-12)
        axis = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
        assert abs(found.direction_1[0] @ axis) == pytest.approx(1.0, abs=1e-12)


@given(st.floats(-1.2, 1.2))
def test_equal_values_turn_and_stretch_as_two_plies_do(shear):
    law = entry({**POWER, "k2": VALUES["k1"], "exponents": [3, 3, 3]})
    found = principal_permeabilities(law, np.array([0.5]), *sheared(shear))
    a1, a2 = sheared(shear)
    plies = 6e-11 * (np.outer(a1, a1) + np.outer(a2, a2))
    np.testing.assert_allclose(tensor(found)[:2, :2], plies[:2, :2], rtol=0.0, atol=1e-22)
    assert found.k1[0] + found.k2[0] == pytest.approx(12e-11, rel=1e-12)
    larger, smaller = 1.0 + abs(np.sin(shear)), 1.0 - abs(np.sin(shear))
    assert found.k2[0] / found.k1[0] == pytest.approx(smaller / larger, rel=1e-9)


@given(
    st.floats(-1.2, 1.2),
    st.floats(-90.0, 90.0),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
    st.booleans(),
)
def test_the_tensor_is_carried_by_the_fibres_and_turns_with_the_sheet(shear, angle, turn, flip):
    law = entry({**POWER, "angle": f"{angle:.6f} deg"})
    a1, a2 = sheared(shear)
    cosine, sine = np.cos(np.radians(round(angle, 6))), np.sin(np.radians(round(angle, 6)))
    rotation_in_plane = np.array([[cosine, -sine], [sine, cosine]])
    measured = rotation_in_plane @ np.diag([6e-11, 4e-11]) @ rotation_in_plane.T
    carrier = np.stack([a1[0], a2[0]], axis=1)  # unsheared fibre axes to the present ones
    expected = carrier @ measured @ carrier.T + 3e-12 * np.outer(Z, Z)
    rotation, _ = np.linalg.qr(np.eye(3) + np.cross(np.eye(3), turn))
    sign = -1.0 if flip else 1.0  # both fibres turned round
    found = principal_permeabilities(
        law, np.array([0.5]), sign * a1 @ rotation.T, sign * a2 @ rotation.T
    )
    np.testing.assert_allclose(
        tensor(found), rotation @ expected @ rotation.T, rtol=0.0, atol=1e-20
    )
    frame = np.array([found.direction_1[0], found.direction_2[0], found.direction_3[0]])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-10)
    assert found.k1[0] >= found.k2[0] > 0.0


def test_signs_of_single_fibres_do_not_matter_along_the_fibres():
    law, (a1, a2) = entry(POWER), sheared(0.4)
    first = tensor(principal_permeabilities(law, np.array([0.5]), a1, a2))
    np.testing.assert_allclose(
        tensor(principal_permeabilities(law, np.array([0.5]), -a1, a2)), first, rtol=0.0, atol=1e-22
    )


def test_the_factor_of_a_law_is_its_ratio_of_means_in_the_plane():
    law = measured_law(entry(POWER))
    now, before = np.array([0.55]), np.array([0.45])
    ratio = law.values(now)[:2].sum(axis=0) / law.values(before)[:2].sum(axis=0)
    assert law.factor(now, before) == pytest.approx(ratio)
    aligned = PermeabilityLaw("kozeny_carman")
    kozeny = ((1 - 0.55) / (1 - 0.45)) ** 3 * (0.45 / 0.55) ** 2
    assert aligned.factor(now, before) == pytest.approx(kozeny)
