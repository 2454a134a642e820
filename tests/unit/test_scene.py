"""A scene file becomes SI numbers, completely accounted for."""

import hashlib
import math
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from lcmchain.errors import InputError, LcmchainError
from lcmchain.quantities.units import (
    ANGLE,
    AREAL_MASS,
    LENGTH,
    STIFFNESS,
    TEMPERATURE,
    QuantityError,
    parse_quantity,
    split_row,
)
from lcmchain.scene import (
    Blank,
    FabricMaterial,
    IsotropicMaterial,
    OrthotropicMaterial,
    Scene,
    read_scene,
    scene_from_text,
    scene_json_schema,
)
from lcmchain.scene.presets import MD600

EXAMPLES = Path(__file__).parents[2] / "examples"

SCENE = """
title = "Small hemisphere"

[process]
time = "20 ms"

[blank]
size = "100 80 mm"
edge_length = "5 mm"
fibre_angle = "45 deg"

[material]
preset = "MD600"
compaction.c1 = 55.0

[contact]
friction = 0.157

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "30 mm" }
position = "0 0 5 mm"
motion = { type = "stroke", direction = [0, 0, -2], distance = "20 mm" }

[[tools]]
name = "holder"
shape = { type = "plate", side = "above" }
position = ["0 mm", "0 mm", "1 cm"]
friction = 0.3
motion = { type = "guided", direction = [0, 0, -1], mass = "1.7 kg" }
"""


# --- units ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("5 mm", LENGTH, 0.005),
        ("1.004mm", LENGTH, 0.001004),
        ("1 inch", LENGTH, 0.0254),
        ("40 mil", LENGTH, 0.001016),
        ("-3.5 µm", LENGTH, -3.5e-6),
        ("2e-3 m", LENGTH, 0.002),
        ("0.1563 MPa", STIFFNESS, 156300.0),
        ("42.3208 N/mm^2", STIFFNESS, 42320800.0),
        ("600 g/m²", AREAL_MASS, 0.6),
        ("45 deg", ANGLE, math.pi / 4),
        ("0.5 rad", ANGLE, 0.5),
    ],
)
def test_quantities_become_the_nearest_si_float(text, dimension, value):
    assert parse_quantity(text, dimension) == value


@pytest.mark.parametrize(
    ("text", "dimension", "complaint"),
    [
        ("5", LENGTH, "has no unit"),
        ("5 kg", LENGTH, "of dimension mass"),
        ("5 mm^2", LENGTH, "length^2"),
        ("5 deg", LENGTH, "is an angle"),
        ("5 mm", ANGLE, "of dimension length"),
        ("5 percent", ANGLE, "of dimension dimensionless"),
        ("5,5 mm", LENGTH, "decimal comma"),
        ("5 milimeter", LENGTH, 'unknown unit "milimeter"'),
        ("5 mm]", LENGTH, "unknown unit"),
        ("five mm", LENGTH, "not a number with a unit"),
        ("nan mm", LENGTH, "not a number with a unit"),
        ("1e999 mm", LENGTH, "too large"),
        ("0.2 mPa", STIFFNESS, 'megapascal is written "0.2 MPa"'),
        ("284 F", TEMPERATURE, 'write "284 degF"'),
    ],
)
def test_what_is_no_quantity_is_explained(text, dimension, complaint):
    with pytest.raises(QuantityError, match=complaint.replace("^", r"\^")):
        parse_quantity(text, dimension)


@given(st.decimals(-1_000_000, 1_000_000, allow_nan=False, places=4))
def test_a_length_is_the_same_in_every_unit(number):
    in_metres = parse_quantity(f"{number} m", LENGTH)
    in_millimetres = parse_quantity(f"{number * 1000} mm", LENGTH)
    assert in_metres == in_millimetres == float(number)


@given(st.text(alphabet="m gkPadeg/*^()[]{}-+.,²°%'\"\\#:=0123456789", max_size=12))
def test_any_other_text_is_refused_in_one_way(unit):
    try:
        value = parse_quantity(f"1 {unit}", LENGTH)
    except QuantityError:
        return
    assert math.isfinite(value)


def test_a_row_shares_the_unit_at_its_end():
    assert split_row("0 -20 1.5e1 mm") == ["0 mm", "-20 mm", "1.5e1 mm"]
    assert split_row("0, 20 N*s/m") == ["0 N*s/m", "20 N*s/m"]
    assert split_row("5 mm") is None


# --- scene ----------------------------------------------------------------------------------------


def test_scene_values_are_si():
    scene = scene_from_text(SCENE)
    assert scene.process.time == 0.02
    assert scene.blank.size == (0.1, 0.08)
    assert scene.blank.fibre_angle == pytest.approx(math.pi / 4)
    punch, holder = scene.tools
    assert punch.shape.radius == 0.03
    assert punch.position == (0.0, 0.0, 0.005)
    assert holder.position == (0.0, 0.0, 0.01)
    assert holder.motion.mass == 1.7 and holder.motion.gravity
    assert punch.motion.direction == (0.0, 0.0, -1.0), "directions are normalised"


def test_defaults_that_are_other_entries_are_filled():
    scene = scene_from_text(SCENE)
    punch, holder = scene.tools
    assert punch.motion.end == scene.process.time
    assert punch.friction == scene.contact.friction == 0.157
    assert holder.friction == 0.3, "a given value stays"


def test_preset_is_the_published_fabric_and_keys_replace_its_values():
    material = FabricMaterial.model_validate(MD600)
    assert material.thickness == 1.004e-3
    assert material.density == pytest.approx(597.6, abs=0.05)
    assert material.membrane.shear_polynomial == (
        0.1919e6,
        -2.3637e6,
        14.7593e6,
        -40.7199e6,
        42.3208e6,
    )
    assert (material.compaction.c0, material.compaction.c1, material.compaction.c2) == (
        0.1563e6, 60.4653, 2.4528,
    )  # fmt: skip
    assert material.bending.C11 == 38.0615e6 and material.bending.C22 == 43.0668e6
    assert material.membrane.shear_convention == "engineering"

    scene = scene_from_text(SCENE)
    assert scene.material.compaction.c1 == 55.0
    assert scene.material.compaction.c0 == material.compaction.c0


def test_every_value_is_recorded_as_given_or_defaulted():
    scene = scene_from_text(SCENE)
    recorded = dict(scene.source.given + scene.source.defaulted)
    given_keys = {key for key, _ in scene.source.given}

    def leaf_keys(model, prefix=""):
        for name in type(model).model_fields:
            value = getattr(model, name)
            if isinstance(value, BaseModel):
                yield from leaf_keys(value, f"{prefix}{name}.")
            elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
                for entry in value:
                    yield from leaf_keys(entry, f"{prefix}{name}.{entry.name}.")
            else:
                yield f"{prefix}{name}"

    unrecorded = set(leaf_keys(scene)) - set(recorded)
    # a check lists all effects, and settings only where one is given
    settings = {f"effects.{name}" for name in type(scene.effects).model_fields}
    assert settings <= unrecorded
    unrecorded -= settings
    # the alternatives to blank.size, and those of a stack and of stages
    of_stack = {"plies", "layup", "materials", "interfaces"}
    of_stages = {"stages", *(f"tools.{tool.name}.stages" for tool in scene.tools)}
    assert unrecorded == {"blank.outline", "blank.drawing"} | of_stack | of_stages
    assert len(recorded) == len(scene.source.given) + len(scene.source.defaulted)
    assert {"blank.edge_length", "tools.holder.friction", "material.compaction.c1"} <= given_keys
    assert recorded["blank.edge_length"] == "5 mm"
    assert recorded["material.compaction.c0"] == "0.1563 MPa (preset MD600)"
    assert recorded["tools.punch.friction"] == "0.157 (contact.friction)"
    assert recorded["tools.punch.motion.end"] == "0.02 s (process.time)"
    assert recorded["contact.penalty"] == "automatic"


def test_recorded_keys_can_be_set_again():
    scene = scene_from_text(SCENE)
    settable = [f"{k}={v}" for k, v in scene.source.given if k not in ("title",)]
    again = scene_from_text(SCENE, overrides=settable)
    assert again.model_dump() == scene.model_dump()


def test_source_keeps_text_and_hash(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    scene = read_scene(path)
    assert scene.source.text == SCENE
    assert scene.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert scene.source.directory == tmp_path.resolve()
    changed = read_scene(path, ["process.frames=5"])
    assert changed.source.sha256 != scene.source.sha256
    assert "--set process.frames=5" in changed.source.text
    assert scene_from_text(changed.source.text).process == scene.process


def test_scene_is_frozen():
    scene = scene_from_text(SCENE)
    with pytest.raises(ValidationError):
        scene.process.time = 1.0
    assert hash(scene.tools[0]) == hash(scene_from_text(SCENE).tools[0])


def test_python_takes_si_numbers_and_texts():
    assert Blank(size=(0.3, 0.2), edge_length="5 mm") == Blank(size="300 200 mm", edge_length=0.005)
    with pytest.raises(ValidationError):
        Blank(size=(0.3, 0.2), edge_length=-0.005)


def test_solid_laws_offer_the_masses_that_a_fabric_does():
    steel = IsotropicMaterial(
        thickness="1 mm", density="7850 kg/m^3", young_modulus="210 GPa", poisson_ratio=0.3
    )
    assert steel.areal_mass == pytest.approx(7.85)
    assert steel.fibre_density is None


def test_compliance_of_an_orthotropic_law_is_symmetric_and_isotropic_in_the_limit():
    material = OrthotropicMaterial(
        thickness=1e-3, density=1e3, E1=2e9, E2=2e9, E3=2e9, nu12=0.3, nu13=0.3, nu23=0.3,
        G12=1e9, G13=1e9, G23=1e9,
    )  # fmt: skip
    compliance = material.normal_compliance
    assert compliance == pytest.approx(compliance.T)
    assert compliance[0] == pytest.approx([1.0, -0.3, -0.3])


@pytest.mark.parametrize(
    ("override", "read"),
    [
        ("tools.punch.friction=0.2", lambda s: s.tools[0].friction == 0.2),
        ("tools[1].friction=0.2", lambda s: s.tools[1].friction == 0.2),
        ("tools.1.friction = 0.2", lambda s: s.tools[1].friction == 0.2),
        ("blank.edge_length=2.5 mm", lambda s: s.blank.edge_length == 0.0025),
        ('blank.edge_length="2.5 mm"', lambda s: s.blank.edge_length == 0.0025),
        ("process.gravity=true", lambda s: s.process.gravity is True),
        ("element.integration_points=5", lambda s: s.element.integration_points == 5),
        ('tools.holder.motion={type = "fixed"}', lambda s: s.tools[1].motion.type == "fixed"),
        ("material.thickness=0.9 mm", lambda s: s.material.thickness == 0.9e-3),
        ("tools=[]", lambda s: s.tools == ()),
        ("title=a = b", lambda s: s.title == "a = b"),
        ("title=1\n[contact]", lambda s: s.title == "1\n[contact]"),
    ],
)
def test_overrides(override, read):
    assert read(scene_from_text(SCENE, overrides=[override]))


def test_a_single_override_may_stand_alone():
    text = SCENE + "\n"
    alone = scene_from_text(text, overrides="contact.friction=0.3")
    assert alone.contact.friction == 0.3
    assert alone == scene_from_text(text, overrides=["contact.friction=0.3"])


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("process.time", "is not key=value"),
        ("=3", "is not key=value"),
        ("tools.pnuch.friction=0.2", 'did you mean "punch"'),
        ("tools[7].friction=0.2", "there is no entry 7, the list has 2"),
        ("tools.friction=0.2", "as in tools.0.friction or tools.punch.friction"),
        ("tools.die.friction=0.2", "as in tools.0.friction or tools.punch.friction"),
        ("title.text=5", '"title" holds no entries'),
        (f"tools.{'7' * 5000}.friction=0.2", "there is no entry 777"),
        (f"tools[{'7' * 5000}].friction=0.2", "is not a dotted key"),
        (f"blank.{'x.' * 5000}y=1", "20 levels deep"),
        (f"title={'[' * 5000}", "nested far too deeply"),
        ("title=\udcff", "cannot be written to a file"),
        (f"contact.friction=0x{'f' * 9000}", "too large to compute"),
        ("blank..size=5", "is not a dotted key"),
        ("blank.edge_lenght=5 mm", 'did you mean "edge_length"'),
    ],
)
def test_wrong_overrides(override, complaint):
    with pytest.raises(InputError, match=complaint.replace("[", r"\[")):
        scene_from_text(SCENE, overrides=[override])


def test_an_entry_of_a_list_without_names_is_told_by_its_number():
    text = SCENE + "\n[[interfaces]]\nitself = true\n"
    with pytest.raises(InputError, match=r"number from 0, as in interfaces\.0\.friction$"):
        scene_from_text(text, overrides=["interfaces.friction=0.2"])
    changed = scene_from_text(text, overrides=["interfaces.0.friction=0.2"])
    assert changed.interfaces[0].friction == 0.2


def test_all_errors_are_reported_together():
    text = SCENE.replace('"5 mm"\nfibre', "5\nfibre").replace('mass = "1.7 kg"', 'mass = "1.7 mm"')
    text += "\n[element]\nintegration_point = 3\n"
    with pytest.raises(InputError) as error:
        scene_from_text(text)
    message = str(error.value)
    assert "has 3 errors" in message
    assert "blank.edge_length: 5 has no unit" in message
    assert 'tools[1] "holder".motion.mass: "1.7 mm" is of dimension length' in message
    assert 'element.integration_point: unknown key; did you mean "integration_points"?' in message


# --- examples and schema --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["hemisphere_holder", "hemisphere_free", "stl_tool"])
def test_examples_are_valid_and_start_in_touch(name):
    scene = read_scene(EXAMPLES / name / "scene.toml")
    thickness = scene.material.thickness
    assert scene.blank.height - thickness / 2 == pytest.approx(0.0, abs=1e-9)
    by_name = {tool.name: tool for tool in scene.tools}
    assert by_name["die"].position[2] == 0.0
    assert 0.0 <= by_name["punch"].position[2] - thickness <= 0.1e-3
    if "holder" in by_name:
        assert by_name["holder"].position[2] == thickness


def test_json_schema_describes_the_examples():
    jsonschema = pytest.importorskip("jsonschema")
    schema = scene_json_schema()
    validator = jsonschema.Draft202012Validator(schema)
    for path in EXAMPLES.glob("*/scene.toml"):
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        assert not list(validator.iter_errors(document)), path
        sheet = document["blank"] if "blank" in document else document["plies"][0]
        sheet["edge_length"] = 5
        assert list(validator.iter_errors(document)), "a bare number is no quantity"


def test_json_schema_quantities_are_texts_with_an_example():
    schema = scene_json_schema()
    assert schema["properties"].keys() == Scene.model_fields.keys()
    edge_length = schema["$defs"]["Blank"]["properties"]["edge_length"]
    assert edge_length["type"] == "string" and edge_length["examples"] == ["5 mm"]
    assert schema["$defs"]["PresetMaterial"]["required"] == ["preset"]
    assert "type" in schema["$defs"]["StrokeMotion"]["required"]

    def quantities(node):
        if isinstance(node, dict):
            if "pattern" in node:
                yield node
            for value in node.values():
                yield from quantities(value)
        elif isinstance(node, list):
            for value in node:
                yield from quantities(value)

    found = list(quantities(schema))
    assert len(found) > 40
    assert all(node["examples"] for node in found)
    assert '"null"' not in str(schema).replace("'", '"'), "TOML has no null"


@pytest.mark.parametrize("angle", [5.0, 29.0, 31.0, 53.0, 85.0])
def test_shear_stress_that_falls_anywhere_up_to_90_degrees_is_refused(angle):
    """S = s0 E + s1 E² falls beyond E = -s0 / 2 s1 = ½ sin γ."""
    slope = -1.0 / math.sin(math.radians(angle))
    with pytest.raises(InputError, match="falling shear stress") as caught:
        scene_from_text(SHEARED.format(slope=slope))
    told = re.search(r"from a shear angle of ([\d.]+) deg", str(caught.value))
    assert float(told[1]) == pytest.approx(angle, abs=0.5)


def test_shear_stress_that_rises_up_to_90_degrees_is_taken():
    scene = scene_from_text(SHEARED.format(slope=-0.999))
    assert scene.material.membrane.shear_polynomial[1] == pytest.approx(-0.999e6)


SHEARED = """
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "10 mm" }}
material = {{ preset = "MD600", membrane = {{ shear_polynomial = "1 {slope:.9f} 0 0 0 MPa" }} }}
"""


def test_a_message_about_very_many_errors_can_be_read():
    text = SCENE + "[output]\n" + "".join(f"wrong_{i} = {i}\n" for i in range(5000))
    with pytest.raises(InputError) as error:
        scene_from_text(text)
    message = str(error.value)
    assert "has 5,000 errors" in message and "output.wrong_0: unknown key" in message
    assert len(message) < 2500
    shown = message.count("\n  output.wrong_")
    assert message.endswith(f"and {5000 - shown:,} more")
    with pytest.raises(InputError) as error:
        scene_from_text(SCENE, overrides=["x" * 100_000])
    assert len(str(error.value)) < 300
    assert len(str(LcmchainError("m" * 200_000))) <= 2500
