"""What is said about effects is what the compiled model does, for every law and element."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lcmchain.effects
from lcmchain.check import check_scene, run_effects
from lcmchain.effects.switches import EFFECTS, effects_of
from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.materials.laws import TABLES
from lcmchain.model import build_model
from lcmchain.pipeline import run
from lcmchain.scene import scene_from_text
from lcmchain.verification import random_elements as make

NO_EFFECTS = {"__init__", "effect", "switches", "interaction", "pressures"}
HEADINGS = ("Adds:", "Source:", "Stability limit:", "Scene:", "Fields:")

MATERIALS = {
    "fabric": 'preset = "MD600"',
    "fabric-with-set": 'law = "fabric-with-set"\npreset = "MD600"\ncompaction.permanent_set = 0.4',
    "fibre-families": """law = "fibre-families"
thickness = "1 mm"
areal_mass = "600 g/m^2"
fibre_density = "1800 kg/m^3"
membrane = { C23 = "0.1 MPa", C13 = "0.1 MPa" }
compaction = { c0 = "0.15 MPa", c1 = 60.0, c2 = 2.5 }
bending = { C33 = "0.1 MPa", C23 = "0.1 MPa", C13 = "0.1 MPa" }
fibres = [
    { angle = "0 deg", tension = "20 MPa", compression = "5 MPa", bending = "2 MPa" },
    { angle = "60 deg", tension = "20 MPa", compression = "5 MPa", bending = "2 MPa" },
]
shear = [{ between = [1, 2], shear_polynomial = "0.2 0 1 0 0 MPa", torsion = "0.1 MPa" }]""",
    "isotropic": 'law = "isotropic"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    'young_modulus = "10 MPa"\npoisson_ratio = NU',
    "orthotropic": 'law = "orthotropic"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    'E1 = "10 MPa"\nE2 = "5 MPa"\nE3 = "2 MPa"\nnu12 = 0.2\nnu13 = NU\nnu23 = NU\n'
    'G12 = "1 MPa"\nG13 = "1 MPa"\nG23 = "1 MPa"\nbending_factor = 0.5',
    "stiffness": 'law = "stiffness"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    "membrane = MATRIX\nbending = MATRIX",
    "neo-hooke": 'law = "neo-hooke"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    'shear_modulus = "0.4 MPa"',
    "ogden": 'law = "ogden"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    'mu = "0.4 0.01 MPa"\nalpha = [2.0, 4.0]',
}
# laws whose bending does not couple the thickness with the plane
UNCOUPLED = ("fabric", "fabric-with-set", "fibre-families", "neo-hooke", "ogden")
SHEET = """
process = {{ time = "1 ms" }}
blank = {{ size = ["30 mm", "20 mm"], edge_length = "5 mm" }}
element = "{element}"

[material]
{material}
"""
STIFFNESS = np.diag([5.0, 4.0, 3.0, 1.0, 1.0, 1.0]) + 0.5 * np.pad(
    np.ones((3, 3)) - np.eye(3), (0, 3)
)


def material_text(law, *, coupled=True):
    matrix = STIFFNESS if coupled else np.diag(np.diag(STIFFNESS))
    rows = ", ".join('"' + " ".join(f"{c:g}" for c in row) + ' MPa"' for row in matrix)
    text = MATERIALS[law].replace("NU", "0.3" if coupled else "0.0")
    return text.replace("MATRIX", f"[{rows}]")


def sheet_scene(law, element="solid-shell", *, coupled=True):
    text = SHEET.format(element=element, material=material_text(law, coupled=coupled))
    return scene_from_text(text)


def by_name(effects):
    return {effect.name: effect for effect in effects}


def test_every_law_of_the_scene_is_tried():
    assert set(MATERIALS) == {table.law_name() for table in TABLES}


def test_every_effect_is_one_file_that_says_what_it_adds():
    folder = Path(lcmchain.effects.__file__).parent
    names = {
        ".".join(("lcmchain.effects", *file.relative_to(folder).with_suffix("").parts))
        for file in folder.rglob("*.py")
        if file.stem not in NO_EFFECTS
    }
    assert {file.__name__ for file in EFFECTS} == names
    for file in EFFECTS:
        assert [h for h in HEADINGS if f"\n{h} " not in file.__doc__] == [], file.__name__


#: Laws of which kernels are compiled for this alone. Those of films, of families, and of a law with
#: set, agree with the reference element, which leaves nothing out (tests/families, tests/elements).
OF_THE_SLOW_RUN = ("fabric-with-set", "fibre-families", "neo-hooke", "ogden")


@pytest.mark.parametrize("coupled", [True, False], ids=["coupled", "uncoupled"])
@pytest.mark.parametrize(
    "law",
    [pytest.param(law, marks=[pytest.mark.slow] * (law in OF_THE_SLOW_RUN)) for law in MATERIALS],
)
def test_an_inactive_effect_of_the_element_would_change_nothing(law, coupled):
    """Forces with an effect switched on and off differ exactly where the model says it is on."""
    model = build_model(sheet_scene(law, coupled=coupled))
    told = by_name(effects_of(model))
    rng = np.random.default_rng(3)
    bent = model.node_positions.T + rng.uniform(-2e-4, 2e-4, (3, model.node_count))

    def forces(**changes):
        body = model.only_body()
        assert body.data.general is None  # all elements have the quick kernel
        data = body.data._replace(quick_options=body.data.quick_options._replace(**changes))
        changed = replace(model, bodies=(replace(body, data=data),))
        return make.corner_forces(changed, bent, np.zeros(model.history_size))

    with_strain, without = forces(enhanced=True), forces(enhanced=None)
    differs = np.abs(with_strain - without).max() > 1e-12 * np.abs(without).max()
    assert told["enhanced strain"].active == differs
    assert differs == (coupled and law not in UNCOUPLED)
    # the tangent that grows with compaction is what makes the conservative correction necessary
    if not told["compaction"].active:
        np.testing.assert_array_equal(forces(conservative=True), forces(conservative=None))
    else:
        assert np.abs(forces(conservative=True) - forces(conservative=None)).max() > 0.0


@pytest.mark.parametrize("law", MATERIALS)
def test_compaction_is_active_where_the_normal_stiffness_grows(law):
    material = sheet_scene(law).material.build()
    E = np.zeros((2, 6))
    E[1, 2] = -0.2
    tangent = material.stress_and_tangent(E)[1][:, 2, 2]
    told = by_name(effects_of(build_model(sheet_scene(law))))
    assert told["compaction"].active == (tangent[1] > 1.01 * tangent[0])


def test_a_curved_sheet_has_the_enhanced_strain():
    rng = np.random.default_rng(0)
    X, fibre = make.curved_reference(rng)
    model = make.separate_elements(X[None], fibre[None], make.md600(), ElementOptions())
    effect = by_name(effects_of(model))["enhanced strain"]
    assert effect.active and "curved" in effect.reason
    assert model.only_body().data.options.enhanced is not None


def test_memory_is_active_where_the_state_holds_a_history():
    for law in MATERIALS:
        model = build_model(sheet_scene(law))
        effect = by_name(effects_of(model))["memory"]
        assert effect.active == model.remembers == (law == "fabric-with-set")
    assert "largest compaction strain" in by_name(effects_of(build_model(
        sheet_scene("fabric-with-set"))))["memory"].reason  # fmt: skip


def test_the_element_effects_of_the_2d_approach():
    told = by_name(effects_of(build_model(sheet_scene("fabric", "membrane-shell"))))
    active = {name for name, effect in told.items() if effect.active}
    assert active == {"bending", "in-plane bending of fibres"}


def test_check_and_summary_list_what_the_model_contains(tmp_path):
    scene = scene_from_text("""
        title = "all"
        process = { time = "0.2 ms", frames = 2, gravity = true, mass_damping = "50 1/s" }
        blank = { size = ["30 mm", "30 mm"], edge_length = "10 mm", height = "0.502 mm" }
        material = { preset = "MD600" }
        contact = { friction = 0.2 }
        output = { pictures = false, vtu = false }

        [[tools]]
        name = "die"
        shape = { type = "plate", side = "below" }

        [[tools]]
        name = "plate"
        shape = { type = "plate", side = "above" }
        position = "0 0 1.004 mm"
        friction = 0.0
        motion = { type = "guided", direction = [0, 0, -1], mass = "0.1 kg", force = "1 N" }
        """)
    told = [effect.name for effect in run_effects(scene, build_model(scene)) if effect.active]
    assert [e.name for e in check_scene(scene).effects if e.active] == told
    run(scene, tmp_path)
    assert json.loads((tmp_path / "summary.json").read_text())["effects"] == told
    assert {"contact with die", "friction on die", "guided tool plate", "gravity"} <= set(told)
    assert "friction on plate" not in told
