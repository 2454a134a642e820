"""Plies, materials by name and interfaces in a scene, and what each of its forms builds."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.interfaces.table import Interface
from lcmchain.model import build_model
from lcmchain.quantities.fields import FIELD_OF_VARIABLE
from lcmchain.scene import on_rung, scene_json_schema
from lcmchain.scene.plies import RESERVED_NAMES

PRESET = 'material = { preset = "MD600" }\n'
BLANK = 'blank = { size = ["40 mm", "20 mm"], edge_length = "5 mm" }\n'
PLY = '[[plies]]\nsize = ["40 mm", "20 mm"]\nedge_length = "5 mm"\n'
TWO = '[materials.lower]\npreset = "MD600"\n[materials.upper]\npreset = "glass-plain-600"\n'
RESIN = """[permeability]
law = "gebart"
fibre_radius = "3.5 um"
[infiltration]
time = "1 h"
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
gates = [{ name = "left", box = ["-21 -11 -1 mm", "-19 11 9 mm"], pressure = "3 bar" }]
vents = [{ name = "right", box = ["19 -11 -1 mm", "21 11 9 mm"] }]
"""
WET = RESIN.replace("gates", "# gates") + 'film = { thickness = "1 mm", pressure = "1 bar" }\n'
WET += 'with_forming = { window = "1 ms" }\n'
BAG = '[[pressure]]\nname = "bag"\nface = "top"\nvalue = "1 kPa"\n'
T = 1.004e-3  # thickness of MD600 [m]


def test_plies_touch_and_their_thicknesses_add_up(scene_of):
    stack = scene_of(
        PLY + 'material = "lower"\nheight = "3 mm"\n' + PLY + 'material = "upper"\n' + PLY
        + 'material = "lower"\n' + TWO
    ).stack  # fmt: skip
    assert stack[0].blank.height == 3e-3
    for under, ply in zip(stack, stack[1:]):
        assert ply.bottom == pytest.approx(under.top, abs=1e-15)
    upper = stack[1].thickness
    assert upper != T
    assert stack.thickness == pytest.approx(2 * T + upper, rel=1e-12)
    assert (stack.bottom, stack.top) == pytest.approx((3e-3 - T / 2, 3e-3 + 1.5 * T + upper))


def test_a_ply_lies_on_what_is_below_it_and_beside_what_is_not(scene_of):
    """Two patches on one ply lie at one height, and the thickest place has two plies."""
    patch = PLY.replace('["40 mm", "20 mm"]', '["10 mm", "10 mm"]')
    patch += 'center = ["{} mm", "0 mm"]\n'
    stack = scene_of(PRESET + PLY + patch.format(-10) + patch.format(10)).stack
    assert [ply.blank.height for ply in stack] == pytest.approx([0.0, T, T])
    assert stack.thickness == pytest.approx(2 * T)
    assert stack.thickness_at(-0.010, 0.0) == pytest.approx(2 * T)
    assert stack.thickness_at(0.0, 0.0) == pytest.approx(T)
    assert stack.extent == pytest.approx((0.04, 0.02))


def test_the_short_form_is_that_of_plies(scene_of):
    short = scene_of('layup = "[0/90, 45/-45]"\n' + PRESET + BLANK)
    long = scene_of(PRESET + PLY + PLY + 'fibre_angle = "45 deg"\n')
    assert [ply.name for ply in short.stack] == [ply.name for ply in long.stack]
    models = [build_model(scene) for scene in (short, long)]
    np.testing.assert_array_equal(models[0].node_positions, models[1].node_positions)
    angles = [body.mesh.fibre_direction_1[0] for body in models[0].bodies]
    np.testing.assert_allclose(angles, [[1, 0, 0], [0.5**0.5, 0.5**0.5, 0]], atol=1e-12)


def test_a_scene_with_one_sheet_is_a_stack_of_one(scene_of):
    scene = scene_of(PRESET + BLANK)
    (ply,) = scene.stack
    assert (ply.name, ply.blank, ply.material) == ("sheet", scene.blank, scene.material)
    assert scene.only_ply("a test") == ply
    (body,) = build_model(scene).bodies
    assert (body.name, body.material.name) == ("sheet", "MD600")


def test_the_model_has_a_body_of_its_own_material_and_element_for_every_ply(scene_of):
    scene = scene_of(
        PLY + 'name = "a"\nmaterial = "lower"\ncenter = ["3 mm", "-2 mm"]\n'
        + PLY + 'name = "b"\nmaterial = "upper"\nelement = { hourglass = "published" }\n' + TWO
    )  # fmt: skip
    a, b = build_model(scene).bodies
    assert (a.name, a.type, a.material.name) == ("a", "solid-shell", "MD600")
    assert (b.name, a.data.options.conservative, b.data.options.conservative) == ("b", True, None)
    assert b.material.thickness == scene.materials["upper"].thickness
    middle = a.mesh.node_positions.mean(axis=0)
    np.testing.assert_allclose(middle, [3e-3, -2e-3, 0.0], atol=1e-12)
    flat = on_rung(scene_of(PRESET + PLY + 'element = "membrane-shell"\n'), "solid-shell")
    assert "plies.ply_1.element" in flat.source.left_out


def test_plies_without_faces_are_refused(scene_of):
    """Those of triangles have one layer of nodes: nothing would lie on them."""
    scene = scene_of(PRESET + PLY + PLY)
    with pytest.raises(InputError, match="element: of the ply ply_1 is .*without two faces"):
        build_model(on_rung(scene, "membrane-shell"))


def test_the_found_time_is_that_of_the_slowest_ply(scene_of):
    tool = (
        '[[tools]]\nname = "punch"\nshape = { type = "plate", side = "above" }\n'
        'motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }\n'
        'position = "0 0 20 mm"\n'
    )
    large = PLY.replace('"40 mm"', '"80 mm"')

    def found(plies):
        text = f'material = {{ preset = "MD600" }}\n{plies}{tool}'
        return scene_of(text, ["process={frames = 2}"]).process.time

    assert found(PLY + large) == found(large + PLY) == found(large) > 1.5 * found(PLY)


def test_an_entry_of_two_plies_goes_before_one_of_their_materials(scene_of):
    scene = scene_of(
        PLY + 'material = "lower"\n' + PLY + 'material = "upper"\n' + PLY + 'material = "lower"\n'
        + TWO
        + '[[interfaces]]\nbetween = ["ply_3", "ply_2"]\nfriction = 0.3\n'
        + '[[interfaces]]\nbetween = ["lower", "upper"]\nfriction = 0.2\n'
        + '[[interfaces]]\nfriction = 0.1\n'
    )  # fmt: skip
    found = {entry.between: entry.friction for entry in build_model(scene).interfaces}
    assert found == {None: 0.1, ("ply_1", "ply_2"): 0.2, ("ply_2", "ply_3"): 0.3}
    plain = build_model(scene_of(PRESET + PLY + PLY)).interfaces
    assert plain == (Interface(),)
    assert build_model(scene_of(PRESET + BLANK)).interfaces == ()


def test_effects_are_switched_off_in_every_ply(scene_of):
    scene = scene_of(
        PLY + 'material = "lower"\n' + PLY + 'material = "upper"\n' + TWO
        + '[effects]\ncompaction = "off"\nenhanced_strain = "off"\n'
    )  # fmt: skip
    assert [switched.key for switched in scene.switched] == ["compaction", "enhanced_strain"]
    assert not any(ply.material.compacts for ply in scene.stack)
    assert not any(ply.element.enhanced_strain for ply in scene.stack)


def test_names_of_fields_are_no_names_of_plies():
    """A mesh and a field of one group cannot have one name."""
    assert set(FIELD_OF_VARIABLE) <= set(RESERVED_NAMES)


def test_editors_know_plies_and_named_materials():
    schema = scene_json_schema()
    ply = schema["$defs"]["Ply"]["properties"]
    assert {"size", "edge_length", "name", "material", "center", "element"} <= set(ply)
    assert ply["element"]["anyOf"][0]["enum"] == ["solid-shell", "membrane-shell", "kinematic"]
    (named,) = schema["properties"]["materials"]["patternProperties"].values()
    assert named["anyOf"] == schema["properties"]["material"]["anyOf"]


WRONG = {
    "blank beside plies": (PRESET + BLANK + PLY, "blank: stands beside"),
    "layup beside plies": ('layup = "[0]"\n' + PRESET + PLY, "layup: stands beside"),
    "empty layup": ('layup = "[]"\n' + PRESET + BLANK, "layup: has no plies"),
    "angle beside layup": (
        'layup = "[0]"\n' + PRESET + BLANK.replace("}", ', fibre_angle = "3 deg" }'),
        "blank.fibre_angle: stands beside",
    ),
    "no blank": (PRESET, r"blank: is missing; for example \[blank\]"),
    "no material": (BLANK, r"material: is missing; for example \[material\]"),
    "no material of a ply": (PLY + 'material = "lower"\n' + PLY + TWO, 'the ply "ply_2" names no'),
    "unknown material": (
        PRESET + PLY + 'material = "loewr"\n' + TWO,
        r'plies\[0\] "ply_1".material: is "loewr".*did you mean "lower"',
    ),
    "two names": (
        PRESET + PLY + 'name = "a"\n' + PLY + 'name = "a"\n', r'plies\[1\].name: is "a"'
    ),
    "name of the program's": (PRESET + PLY + 'name = "thickness"\n', "choose another"),
    "overlap": (
        PRESET + PLY + PLY + 'height = "0.4 mm"\n',
        r'plies\[1\] "ply_2".height: puts the ply 0.604 mm deep into "ply_1"',
    ),
    "wrong order": (PRESET + PLY + PLY + 'height = "-9 mm"\n', "10 mm deep into"),
    "negative friction": (
        PRESET + PLY + PLY + "[[interfaces]]\nfriction = -0.1\n", r"interfaces\[0\].friction: must"
    ),
    "a ply with itself": (
        PRESET + PLY + PLY + '[[interfaces]]\nbetween = ["ply_1", "ply_1"]\n',
        r'interfaces\[0\].between: names the ply "ply_1" twice',
    ),
    "unknown ply": (
        PRESET + PLY + PLY + '[[interfaces]]\nbetween = ["ply_1", "ply_7"]\n',
        r'interfaces\[0\].between: is "ply_7"',
    ),
    "the same two": (
        PRESET + PLY + PLY + '[[interfaces]]\nbetween = ["ply_1", "ply_2"]\n'
        '[[interfaces]]\nbetween = ["ply_2", "ply_1"]\n',
        r"interfaces\[1\].between: says the same two",
    ),
    "interfaces of one sheet": (PRESET + BLANK + "[[interfaces]]\n", "the scene has one sheet"),
    "a net": ('element = "kinematic"\n' + PRESET + PLY + PLY, 'element: is "kinematic"'),
    "resin while plies with a gap are formed": (
        PRESET + PLY + PLY + 'height = "1.3 mm"\n' + WET,
        r'plies\[1\] "ply_2".height: leaves a gap of 0.296 mm to "ply_1"',
    ),
    "resin while plies in each other are formed": (
        PRESET + PLY + PLY + 'height = "0.9 mm"\n' + WET,
        r'plies\[1\] "ply_2".height: puts the ply 0.104 mm deep into "ply_1"',
    ),
    "a pressure on a smaller ply": (
        PRESET + PLY + PLY.replace('"20 mm"', '"15 mm"') + BAG,
        r'pressure\[0\] "bag": acts on the outer faces .* but its plies have unlike outlines',
    ),
    "value of a named material": (
        PLY + 'material = "lower"\n[materials.lower]\npreset = "MD600"\nthickness = "3 N"\n',
        'materials.lower.thickness: "3 N"',
    ),
    "law of a named material": (
        PLY + 'material = "lower"\n[materials.lower]\nlaw = "fabrik"\n',
        'materials.lower.law: is "fabrik"',
    ),
    "preset of a named material": (
        PLY + 'material = "lower"\n[materials.lower]\npreset = "MD60"\n',
        'materials.lower.preset: there is no preset "MD60"',
    ),
    "edge of a ply": (
        PRESET + PLY + PLY.replace('"5 mm"', '"19 mm"'),
        r'plies\[1\] "ply_2".edge_length: 19 mm leaves fewer',
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_stack_is_one_error_that_names_the_key(scene_of, name):
    text, message = WRONG[name]
    with pytest.raises(InputError, match=message) as caught:
        build_model(scene_of(text))
    assert "errors:" not in str(caught.value)


def test_a_stack_of_one_outline_may_be_pressed(scene_of):
    scene = scene_of(PRESET + PLY + PLY.replace("5 mm", "4 mm") + 'fibre_angle = "45 deg"\n' + BAG)
    assert scene.stack.has_one_outline and len(scene.pressure) == 1


def test_resin_may_flow_through_a_stack_of_one_outline_while_it_is_formed(scene_of):
    scene = scene_of(PRESET + PLY + PLY.replace("5 mm", "4 mm") + 'fibre_angle = "45 deg"\n' + WET)
    assert scene.wet_forming is not None


def test_a_formed_stack_may_be_filled(scene_of):
    scene = scene_of(PRESET + PLY + PLY + RESIN)
    assert list(scene.infiltrations) == ["sheet"]
    bag = 'vent_pressure = "0 bar"\nclosure = { type = "bag", pressure = "1 bar" }\n'
    assert scene_of(PRESET + PLY + PLY + RESIN + bag).infiltration.closure.type == "bag"


def test_an_overlap_of_up_to_half_a_thickness_and_a_gap_are_allowed(scene_of):
    for height in ("0.51 mm", "30 mm"):
        stack = scene_of(PRESET + PLY + PLY + f'height = "{height}"\n').stack
        assert stack[1].blank.height == pytest.approx(float(height.split()[0]) * 1e-3)
    beside = 'center = ["41 mm", "0 mm"]\nheight = "0 mm"\n'
    assert scene_of(PRESET + PLY + PLY + beside).stack[1].blank.height == 0.0


@pytest.mark.parametrize("command", ["lcmchain coupon", "a hard case"])
def test_what_takes_one_sheet_names_the_command_and_the_entry(scene_of, command):
    short = 'layup = "[0]2"\n' + PRESET + BLANK
    for text, key in ((PRESET + PLY + PLY, "plies"), (short, "layup")):
        with pytest.raises(InputError, match=f"{key}: names 2 plies .*but {command} takes one"):
            scene_of(text).only_ply(command)
