"""Pictures in the units that are built, and the rule that the doctor knows of them."""

import io
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring, tostring

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree
from PIL import Image

from lcmchain.coupling.cosimulation.archive import read_member, unpack
from lcmchain.coupling.cosimulation.description import ICONS_FOLDER, TERMINALS_FILE
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.description import (
    ICON_OF_KIND,
    PREFORM,
    ROTATION,
    TRANSLATION,
    UnitTerminal,
    as_bytes,
    document,
)
from lcmchain.fmu.doctor.description import findings_of, read_description
from lcmchain.fmu.doctor.rules import RULES
from lcmchain.fmu.icons import (
    ICON_OF_FMI2,
    LONGEST_NAME,
    PIXELS,
    as_png,
    as_svg,
    icon_files,
    unit_drawing,
)

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


@pytest.fixture(scope="module")
def built(patch_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("icons")
    return {fmi: build_fmu(patch_file, folder / f"patch{fmi}.fmu", fmi=fmi) for fmi in (2, 3)}


@pytest.fixture
def unpacked(built, tmp_path):
    unpack(built[3], tmp_path / "unit")
    return tmp_path / "unit"


def names_in(path):
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def picture(content):
    image = Image.open(io.BytesIO(content))
    assert image.format == "PNG" and image.mode == "RGBA"
    return np.asarray(image)


def standard(folder):
    found = findings_of(read_description(folder, folder / "unit.fmu"), is_python=True)
    return [finding for finding in found if finding.subject == "standard"]


def test_a_unit_of_fmi_2_has_one_picture_and_fmpy_finds_no_problem(built):
    pixels = picture(read_member(built[2], ICON_OF_FMI2))
    assert pixels.shape == (PIXELS, PIXELS, 4)
    assert not any(name.startswith(ICONS_FOLDER) for name in names_in(built[2]))
    assert validate_fmu(str(built[2])) == []


def test_a_unit_of_fmi_3_has_its_picture_and_those_of_its_terminals(built):
    names = {name for name in names_in(built[3]) if name.startswith(ICONS_FOLDER)}
    assert ICON_OF_FMI2 not in names_in(built[3])
    bases = {"icon", *ICON_OF_KIND.values()} - {"rotation"}  # no tool of this one turns
    pictures = {f"{ICONS_FOLDER}/{base}.{kind}" for base in bases for kind in ("png", "svg")}
    assert names == pictures | {TERMINALS_FILE}
    for name in pictures:
        content = read_member(built[3], name)
        if name.endswith(".png"):
            assert picture(content).size
        else:
            assert etree.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"
    assert validate_fmu(str(built[3])) == []


def test_a_picture_fills_its_square_on_a_clear_background():
    """No stroke and no letter is cut off; forming and filling differ; the SVG has each stroke."""
    shown = {}
    for part in ("forming", "infiltration"):
        drawing = unit_drawing("w" * 40, part)
        shown[part] = picture(as_png(drawing, 64))
        alpha = shown[part][..., 3]
        rim = np.concatenate([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
        assert not rim.any() and (alpha == 255).mean() > 0.2
        places = np.array([point for stroke in drawing.strokes for point in stroke.points])
        assert places.min() > 0.0 and places.max() < drawing.side
        root = etree.fromstring(as_svg(drawing))
        assert len(root.findall("{*}polygon")) == len(drawing.strokes) == 100
        (text,) = root.findall("{*}text")
        assert len(text.text) == LONGEST_NAME and text.text.endswith("...")
    assert not np.array_equal(shown["forming"], shown["infiltration"])


def test_the_same_unit_has_the_same_pictures():
    first, second = (
        icon_files("dome", "forming", 3, [UnitTerminal("t", ROTATION, "", {})]) for _ in range(2)
    )
    assert first == second and f"{ICONS_FOLDER}/rotation.png" in first


def test_terminals_are_drawn_apart_from_each_other_on_two_edges():
    tools = [UnitTerminal(f"tool {k}", TRANSLATION, "moves", {}) for k in range(30)]
    fields = [UnitTerminal("preform", PREFORM, "fields", {})]
    content = as_bytes(document(tools + fields))
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(etree.fromstring(content))
    boxes = {}
    for element in fromstring(content).iter("Terminal"):
        shown = element.find("TerminalGraphicalRepresentation")
        boxes[element.get("name")] = [float(shown.get(key)) for key in ("x1", "y1", "x2", "y2")]
    column = np.array([boxes[tool.name] for tool in tools])
    assert np.allclose(column[:, 0] + column[:, 2], -200.0, atol=1e-3)
    assert np.all(column[1:, 3] < column[:-1, 1])  # each below the one before
    assert column[:, 1].min() > -100.0 and column[:, 3].max() < 100.0
    assert boxes["preform"] == [90.0, -10.0, 110.0, 10.0]


def test_a_unit_without_terminals_has_its_picture_in_a_valid_file():
    root = document([])
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(etree.fromstring(as_bytes(root)))
    assert root.find("Terminals") is None and root.find("GraphicalRepresentation/Icon") is not None


# --- the doctor -----------------------------------------------------------------------------------


def graphics(**changes):
    """Change attributes of the first element of a tag."""

    def change(folder):
        path = folder / TERMINALS_FILE
        root = fromstring(path.read_text(encoding="utf-8"))
        for tag, attributes in changes.items():
            next(root.iter(tag)).attrib.update(attributes)
        path.write_bytes(tostring(root))

    return change


def terminal(**attributes):
    return graphics(TerminalGraphicalRepresentation=attributes)


def without(name):
    return lambda folder: (folder / ICONS_FOLDER / name).unlink()


def holds(name, content):
    return lambda folder: (folder / name).write_bytes(content)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without("icon.png"), "has icon.svg without icon.png"),
        (holds(f"{ICONS_FOLDER}/icon.png", b"GIF89a"), "has icon.png, which is no PNG file"),
        (without("preform.png"), "preform has preform.svg without preform.png"),
        (terminal(iconBaseName="hook"), "punch has no picture hook.png"),
        (terminal(iconBaseName="../resources/hook"), "which is no place within"),
        (terminal(iconBaseName="%2e%2e/hook"), "which is no place within"),
        (terminal(iconBaseName="file:/etc/hook"), "which is no place within"),
        (terminal(iconBaseName="x" * 5000), "has no picture xxx"),
        (terminal(defaultConnectionColor="0 0 256"), 'punch has the colour "0 0 256"'),
        (terminal(defaultConnectionColor="0 0"), 'the colour "0 0"'),
        (terminal(x2="right"), "punch has corners that are no numbers"),
        (graphics(Icon={"y1": ""}), "Icon has corners that are no numbers"),
        (graphics(CoordinateSystem={"x1": "200"}), "does not go from lower left to upper right"),
        (graphics(CoordinateSystem={"suggestedScalingFactorTo_mm": "0"}), "To_mm above 0"),
    ],
)
def test_an_icon_that_breaks_the_rule_is_found(unpacked, change, words):
    change(unpacked)
    (finding,) = standard(unpacked)
    assert finding.text.startswith("icons: ") and words in finding.text
    assert RULES["icons"].asks in finding.remedy and "2.4.9" in finding.remedy


def test_icons_that_are_right_are_not_told(unpacked):
    """One that is flipped, one in a folder, a PNG alone, none at all."""
    assert standard(unpacked) == []
    graphics(Icon={"x1": "100", "x2": "-100"})(unpacked)
    (unpacked / ICONS_FOLDER / "own set").mkdir()
    png = (unpacked / ICONS_FOLDER / "icon.png").read_bytes()
    holds(f"{ICONS_FOLDER}/own set/hook.png", png)(unpacked)
    terminal(iconBaseName="./own%20set/hook")(unpacked)
    without("icon.svg")(unpacked)
    assert standard(unpacked) == []
    without("icon.png")(unpacked)
    assert standard(unpacked) == []


def test_a_picture_of_fmi_2_that_is_none_is_found(built, tmp_path):
    unpack(built[2], tmp_path / "unit")
    assert standard(tmp_path / "unit") == []
    holds(ICON_OF_FMI2, b"BM")(tmp_path / "unit")
    (finding,) = standard(tmp_path / "unit")
    assert "icons: has model.png, which is no PNG file" in finding.text
