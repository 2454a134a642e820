"""Films in a stack: they have no fibres, and the preform that comes out of the run none of them."""

import numpy as np
import pytest

from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import stack_tables
from lcmchain.errors import InputError
from lcmchain.fields.dataset import SHEET
from lcmchain.fields.stack import PLY, film_names, plies_of
from lcmchain.fields.summary import field_summary, stack_summary
from lcmchain.judgements.fields import field_warnings
from lcmchain.mapping.sheet import read_sheet
from lcmchain.report.numbers import key_numbers, ply_numbers

SCENE = """
material = { preset = "MD600" }
[materials.rubber]
law = "neo-hooke"
shear_modulus = "0.4 MPa"
thickness = "1 mm"
density = "1100 kg/m^3"
[[plies]]
name = "lower"
size = ["120 mm", "120 mm"]
edge_length = "10 mm"
material = "rubber"
film = true
[[plies]]
name = "first"
size = ["80 mm", "80 mm"]
edge_length = "10 mm"
[[plies]]
name = "second"
size = ["80 mm", "80 mm"]
edge_length = "10 mm"
fibre_angle = "45 deg"
[[plies]]
name = "upper"
size = ["120 mm", "120 mm"]
edge_length = "10 mm"
material = "rubber"
film = true
"""
T = 1.004e-3  # of MD600 [m]
FIBRES = ("shear_angle", "fibre_strain_1", "fibre_direction_1_x", "areal_fibre_mass")


@pytest.fixture(scope="module")
def groups(scene_of, laid):
    return laid(scene_of(SCENE))


def test_a_film_has_a_thickness_and_no_field_of_fibres(groups):
    for name, own in plies_of(groups):
        film = name in ("lower", "upper")
        assert "thickness" in own[SHEET]
        assert all((field in own[SHEET]) != film for field in (*FIBRES, "fibre_volume_fraction"))
        assert ("areal_mass_kg_m2" in own[SHEET].attrs) != film
    assert film_names(groups[SHEET]) == ("lower", "upper")
    of_films = np.isin(groups[SHEET][PLY].values, (0, 3))
    for field in FIBRES:
        np.testing.assert_array_equal(np.isnan(groups[SHEET][field].values[-1]), of_films)


def test_no_sum_of_the_stack_has_a_film_in_it(groups):
    """On fabrics and on films over them, flat and on the dome; beside them films are nothing."""
    sheet = groups[SHEET]
    count = sheet["stack_ply_count"].values
    for frame, part in ((0, 1.0), (1, 0.9)):
        assert set(np.unique(count[frame])) <= {0, 1, 2}
        whole = count[frame] == 2
        thickness = sheet["stack_thickness"].values[frame]
        np.testing.assert_allclose(thickness[whole], 2.0 * part * T, rtol=1e-12)
        assert not thickness[count[frame] == 0].any()
        fraction = sheet["stack_fibre_volume_fraction"].values[frame]
        assert np.isnan(fraction[count[frame] == 0]).all()
        expected = 0.6 / (1810.0 * T * part)
        np.testing.assert_allclose(np.nanmax(fraction), expected, rtol=0.02)
    films = np.isin(sheet[PLY].values, (0, 3))
    assert (count[0][~films] == 2).all() and (count[0][films] == 0).any()


def test_the_summary_counts_plies_and_names_films(groups):
    told = stack_summary(groups)
    stack, plies = told["stack"], told["plies"]
    assert stack["ply_count"] == 2 and stack["films"] == ["lower", "upper"]
    assert stack["thickness_min_m"] >= 0.9 * T * (1.0 - 1e-9)  # not 0, of films beside the fabrics
    # MD600 weighs 600 g/m²
    assert stack["fibre_mass_kg"] == pytest.approx(2 * 0.6 * 0.08**2, rel=0.03)
    assert "fibre_mass_kg" not in plies["lower"] and "shear_angle_max_rad" not in plies["lower"]
    summary = field_summary(groups) | told
    assert np.isfinite(summary["shear_angle_max_rad"]) and np.isfinite(summary["fibre_mass_kg"])
    rows = {row.name: row.value for row in ply_numbers(summary)}
    assert rows["Ply lower"] == "film" and rows["Ply first"].startswith("sheared by")
    (stack_row,) = [row for row in key_numbers(summary) if row.name == "Thickness of the stack"]
    assert "without the films lower and upper" in stack_row.meaning


def test_nothing_of_a_film_is_mapped(groups):
    sheet = read_sheet(groups[SHEET])
    assert sheet.ply_names == ("first", "second")
    assert sheet.surface.face_count == sum(own[SHEET].sizes["sheet_face"] for name, own in plies_of(
        groups) if name in sheet.ply_names)  # fmt: skip
    assert not any("stack" in name for name in sheet.scalars)
    assert all(np.isfinite(values).all() for values in sheet.scalars.values())


def test_one_ply_between_films_is_mapped_as_one_sheet(scene_of, laid):
    head, second = SCENE.split('[[plies]]\nname = "second"')
    upper = second[second.index("[[plies]]") :]
    sheet = read_sheet(laid(scene_of(head + upper))[SHEET])
    assert sheet.ply_names == () and sheet.ply is None
    assert np.allclose(sheet.scalars["thickness"], 0.9 * T)
    assert not any("stack" in name for name in sheet.scalars)


def test_warnings_of_fields_pass_over_films(groups, scene_of):
    stack = scene_of(SCENE).stack
    for ply, (_, own) in zip(stack, plies_of(groups), strict=True):
        for text in field_warnings(own[SHEET], ply.built_material()):
            assert "shear" not in text and "fibre" not in text


def test_check_says_which_plies_are_films(scene_of):
    scene = scene_of(SCENE)
    table = stack_tables(scene, [1] * 4)[0]
    assert table.title.startswith("Stack of 2 plies and 2 of films")
    assert list(table.columns[2].cells) == ["film", "45 deg", "0 deg", "film"]
    assert not any("is of rubber" in text for text in scene_warnings(scene))
    kept = scene_of(SCENE.replace("film = true", "", 1))
    (warning,) = [text for text in scene_warnings(kept) if "is of rubber" in text]
    assert warning.startswith('plies[0] "lower" is of rubber and stays in the part')


def test_a_lowered_modulus_of_fibres_is_for_the_plies_that_have_some(scene_of):
    scene = scene_of(SCENE, overrides=["process.fibre_modulus_factor=0.5"])
    film, fabric, *_ = (ply.built_material() for ply in scene.stack)
    assert fabric.fibre_modulus_factor == 0.5 and not hasattr(film, "fibre_modulus_factor")


WITH_RESIN = """
[permeability]
law = "gebart"
fibre_radius = "3.5 um"
[infiltration]
resin = { law = "constant", viscosity = "0.1 Pa*s" }
time = "100 s"
gates = [{ name = "inlet", point = "0 0 0 mm", pressure = "GATE" }]
vents = [{ name = "rim", rim = true }]
closure = { type = "bag", pressure = "1 bar" }
"""


def test_permeability_asks_fibres_of_the_plies_that_stay(scene_of):
    scene = scene_of(SCENE + WITH_RESIN.replace("GATE", "0.8 bar"))
    assert scene.permeability is not None
    assert not any("inflates" in text for text in scene_warnings(scene))


def test_a_gate_above_the_bag_is_told(scene_of):
    scene = scene_of(SCENE + WITH_RESIN.replace("GATE", "1.3 bar"))
    (warning,) = [text for text in scene_warnings(scene) if "inflates" in text]
    assert 'the gate "inlet" is 0.3 bar above the bag at 0 s' in warning


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('material = "rubber"\n', ""), r'plies\[0\] "lower".film: is true, but law = "fabric"'),
        (("film = true", "film = 1"), r'plies\[0\] "lower".film'),
    ],
)
def test_what_is_no_film_is_refused(scene_of, change, message):
    with pytest.raises(InputError, match=message):
        scene_of(SCENE.replace(*change, 1))


def test_films_alone_are_refused(scene_of):
    first = SCENE.index('[[plies]]\nname = "first"')
    upper = SCENE.rindex("[[plies]]")
    with pytest.raises(InputError, match="are films alone, which are taken off"):
        scene_of(SCENE[:first] + SCENE[upper:])
