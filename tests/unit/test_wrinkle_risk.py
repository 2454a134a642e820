"""Wrinkle risk: a strip that buckles, means over a wave, tools, locking, waves, and the files."""

import numpy as np
import pytest

from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.fields import FrameSeries, build_datasets, field_summary
from lcmchain.fields.wrinkles import (
    COMPRESSION,
    LOCKING,
    RISK,
    WAVES,
    critical_strains,
    wrinkle_risk,
)
from lcmchain.judgements.verdicts import field_verdicts
from lcmchain.materials.law import locking_angles
from lcmchain.mesh.blank import build_blank
from lcmchain.model import assemble_sheet
from lcmchain.scene import scene_from_text
from lcmchain.statics.linear import PairSystem
from lcmchain.tools.table import build_tool_table

WAVE = 0.04
SCENE = """
title = "risk"
process = { time = "20 ms" }
output = { wrinkle_risk = true, wrinkle_length = "40 mm" }
blank = { size = ["200 mm", "160 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
[[tools]]
name = "below"
shape = { type = "plate", side = "below" }
"""
FAMILIES = """
[material]
law = "fibre-families"
thickness = "1 mm"
areal_mass = "600 g/m^2"
fibre_density = "1800 kg/m^3"
fibres = [
    { angle = "30 deg", tension = "2 GPa", compression = "1 GPa", bending = "40 MPa" },
    { angle = "90 deg", tension = "1 GPa", compression = "1 GPa", bending = "10 MPa" },
    { angle = "150 deg", tension = "1 GPa", compression = "1 GPa", bending = "10 MPa" },
]
membrane = { C23 = "0.1 MPa", C13 = "0.1 MPa" }
bending = { C33 = "0.1 MPa", C23 = "0.1 MPa", C13 = "0.1 MPa" }
compaction = { c0 = "0.1563 MPa", c1 = 60.4653, c2 = 2.4528 }
[[material.shear]]
between = [1, 3]
shear_polynomial = "0.1 0 0 0 0 MPa"
locking_angle = "50 deg"
locking_stiffness = "1 MPa"
[[material.shear]]
between = [2, 1]
shear_polynomial = "0.1 0 0 0 0 MPa"
locking_angle = "40 deg"
locking_stiffness = "1 MPa"
[[material.shear]]
between = [2, 3]
shear_polynomial = "0.1 0 0 0 0 MPa"
"""


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture(scope="module")
def blank(scene):
    return build_blank(scene.blank, scene.material.thickness)


@pytest.fixture(scope="module")
def material(scene):
    return scene.material.build()


@pytest.fixture(scope="module")
def families():
    text = SCENE.replace('material = { preset = "MD600" }\n', "") + FAMILIES
    return scene_from_text(text).material.build()


def moved(blank, x=None, y=None, z=None):
    """Nodes (1, n, 3) with displacements of x and y added."""
    position = blank.node_positions.copy()
    for axis, shift in enumerate((x, y, z)):
        if shift is not None:
            position[:, axis] += shift
    return position[None]


def strained(blank, along_x=0.0, along_y=0.0):
    return moved(blank, along_x * blank.node_positions[:, 0], along_y * blank.node_positions[:, 1])


# --- compression ----------------------------------------------------------------------------------


def lowest_eigenvalue(model, blank, strain):
    """Lowest eigenvalue of the tangent of a hinged strip that is shortened along x."""
    x = blank.node_positions[:, 0]
    held = np.zeros((3, len(x)), dtype=bool)
    held[1] = True
    middle = np.zeros((3, blank.pair_count), dtype=bool)
    ends = np.abs(blank.mid_surface_positions[:, 0]) > np.abs(x).max() - 1e-9
    middle[0] = middle[2] = ends
    displacement = np.zeros((3, len(x)))
    displacement[0] = -strain * x
    system = PairSystem(model, held, middle)
    K = system.reduced(system.assemble(linearise(model, displacement).stiffness)).toarray()
    return np.linalg.eigvalsh(0.5 * (K + K.T))[0]


@pytest.mark.parametrize("family", [0, 1])
@pytest.mark.parametrize("length", [20, 60])
def test_a_hinged_strip_buckles_at_the_critical_strain(family, length, material):
    """Its tangent loses its definiteness within 2 %; the shear takes 44 % of the short one's."""
    text = SCENE.replace('"200 mm", "160 mm"', f'"{length} mm", "{length / 10} mm"')
    text = text.replace('"10 mm"', f'"{length / 20} mm"')
    scene = scene_from_text(text, None, (f"blank.fibre_angle={90 * family} deg",))
    strip = build_blank(scene.blank, scene.material.thickness)
    model = assemble_sheet(strip, material)
    critical = critical_strains(material, 1e-3 * length)[family]
    assert lowest_eigenvalue(model, strip, 0.98 * critical) > 0.0
    assert lowest_eigenvalue(model, strip, 1.02 * critical) < 0.0


def test_even_compression_is_told_in_parts_of_the_critical_strain(blank, material):
    critical = critical_strains(material, 0.5 * WAVE)
    for along, family in (("along_x", 0), ("along_y", 1)):
        for part in (0.5, 1.5):
            positions = strained(blank, **{along: -part * critical[family]})
            found = wrinkle_risk(blank, material, positions, WAVE)
            assert found[COMPRESSION] == pytest.approx(part, rel=1e-6)
            assert found[RISK] == pytest.approx(part, rel=1e-6)
            stretched = strained(blank, **{along: part * critical[family]})
            assert wrinkle_risk(blank, material, stretched, WAVE)[RISK].max() < 1e-9


def test_what_swings_from_element_to_element_cancels(blank, material):
    """Columns of elements shortened and lengthened in turn by ten times the critical strain."""
    critical = critical_strains(material, 0.5 * WAVE)[0]
    x = blank.node_positions[:, 0]
    swing = 10.0 * critical * 0.005 * np.where(np.round(x / 0.01) % 2 == 0, 1.0, -1.0)
    found = wrinkle_risk(blank, material, moved(blank, swing), WAVE)[COMPRESSION][0]
    centre = blank.mid_surface_positions[blank.faces].mean(axis=1)
    assert found[np.abs(centre[:, 0]) < 0.07].max() < 0.5


def test_families_answer_along_their_own_directions(blank, families):
    """Along 30 degrees all moduli are those of family 1, and a fifth of what crosses it."""
    angle = np.radians(30.0)
    along = np.cos(angle), np.sin(angle)
    C = families.stress_and_tangent(np.array([-1e-7, -1e-7, 0.0, 0.0, 0.0, 0.0]))[1]
    direction = np.array([along[0] ** 2, along[1] ** 2, 0.0, 2.0 * along[0] * along[1], 0.0, 0.0])
    membrane = direction @ C @ direction
    bending = direction @ families.bending_matrix() @ direction
    assert membrane > 1e9 and bending > 40e6
    euler = np.pi**2 * bending * 1e-9 / 12.0 / 0.02**2
    expected = 1.0 / (1.0 / euler + 1.0 / (0.1e6 * 1e-3)) / (membrane * 1e-3)
    assert critical_strains(families, 0.02)[0] == pytest.approx(expected, rel=1e-9)


# --- tools ----------------------------------------------------------------------------------------


def test_a_sheet_on_a_tool_has_the_shape_of_the_tool(scene, blank, material):
    tools = build_tool_table(scene.tools, scene.source.directory, scene.process.time)
    critical = critical_strains(material, 0.5 * WAVE)[0]
    half, travel = 0.5 * blank.thickness, np.zeros((1, 1))
    for gap, touch, risk in (
        (0.5, None, 0.0), (2.0, None, 2.0), (2.0, 3.0, 0.0), (4.0, 3.0, 2.0),
    ):  # fmt: skip
        positions = strained(blank, along_x=-2.0 * critical)
        positions[..., 2] += half + gap * blank.thickness
        found = wrinkle_risk(
            blank, material, positions, WAVE, tools=tools, travel=travel,
            touch=None if touch is None else touch * blank.thickness,
        )  # fmt: skip
        assert found[RISK] == pytest.approx(risk, rel=1e-6)


# --- locking and waves ----------------------------------------------------------------------------


def sheared(blank, angle):
    """Fibres along y turned by an angle towards x, at their length."""
    _, y, _ = blank.node_positions.T
    return moved(blank, y * np.sin(angle), y * (np.cos(angle) - 1.0))


def test_nearness_of_locking_is_the_shear_over_the_angle_of_the_law(blank):
    text = SCENE + '[material.membrane]\nlocking_angle = "40 deg"\nlocking_stiffness = "1 MPa"\n'
    text = text.replace('material = { preset = "MD600" }', "") + '[material]\npreset = "MD600"\n'
    locks = scene_from_text(text).material.build()
    for angle in (-20.0, 50.0):
        found = wrinkle_risk(blank, locks, sheared(blank, np.radians(angle)), WAVE)
        assert found[LOCKING] == pytest.approx(abs(angle) / 40.0, rel=1e-9)
        assert (found[RISK] >= found[LOCKING]).all()


def test_pairs_lock_by_their_own_angles_whatever_their_order(families, material):
    found = locking_angles(families)
    assert np.degrees([found[0], found[2]]) == pytest.approx([40.0, 50.0]) and found[1] is None
    assert locking_angles(families.with_fibre_modulus(0.25)) == found
    assert locking_angles(material) == (None,)


def test_a_law_that_does_not_lock_has_no_such_part(blank, material):
    assert set(wrinkle_risk(blank, material, moved(blank), WAVE)) == {RISK, COMPRESSION, WAVES}


@pytest.mark.parametrize("elements", [4, 8])
def test_waves_are_told_by_the_elements_that_they_have(blank, material, elements):
    x = blank.node_positions[:, 0]
    number = 2.0 * np.pi / (0.01 * elements)
    positions = moved(blank, z=0.5 / number * np.cos(number * (x - x.min())))
    found = wrinkle_risk(blank, material, positions, WAVE)[WAVES]
    assert found.max() == pytest.approx(8.0 / elements, rel=0.1)
    assert (found > 0.0).mean() > 0.5


# --- where it is told -----------------------------------------------------------------------------


def result(scene, blank, positions):
    both = np.concatenate([blank.node_positions[None], positions])
    frames = FrameSeries(np.array([0.0, 0.02]), both, np.zeros((2, 0)), np.zeros((2, 0, 3)))
    return build_datasets(scene, blank, frames)


def test_it_is_in_file_summary_and_verdict_where_the_scene_asks(scene, blank, material):
    critical = critical_strains(material, 0.5 * WAVE)[0]
    x = blank.node_positions[:, 0]
    half = moved(blank, np.where(x > 0.0, -2.0 * critical * x, 0.0))  # one half is compressed
    datasets = result(scene, blank, half)
    field = datasets["/"][RISK]
    assert field.attrs["units"] == "1" and field.attrs["location"] == "face"
    assert field.values[0].max() < 1e-9
    summary = field_summary(datasets)
    assert summary["wrinkle_risk_max"] == field.values[-1].max() == pytest.approx(2.0, rel=1e-6)
    assert summary["wrinkle_risk_part"] == pytest.approx(0.5, abs=0.06)
    verdict = next(v for v in field_verdicts(datasets["/"], scene) if v.check == "Wrinkle risk")
    assert verdict.grade == "doubtful" and "compressed fibres" in verdict.text
    calm = next(
        v for v in field_verdicts(result(scene, blank, moved(blank))["/"], scene)
        if v.check == "Wrinkle risk"
    )  # fmt: skip
    assert calm.grade == "good"


def test_a_scene_that_does_not_ask_has_none(scene, blank):
    output = scene.output.model_copy(update={"wrinkle_risk": False})
    quiet = scene.model_copy(update={"output": output})
    datasets = result(quiet, blank, moved(blank))
    assert not any(name.startswith("wrinkle_risk") for name in datasets["/"])
    assert "wrinkle_risk_max" not in field_summary(datasets)
    assert not any(v.check == "Wrinkle risk" for v in field_verdicts(datasets["/"], quiet))
