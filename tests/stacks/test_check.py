"""What a check says of a stack, and where tools, gaps and meshes meet several plies."""

import numpy as np
import pytest
from rich.console import Console

from lcmchain.check import check_scene, large_mesh
from lcmchain.check.large_mesh import checked_mesh
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import stack_tables
from lcmchain.check.tool_strokes import closing_tools, tools_that_close
from lcmchain.check.tools_at_start import require_no_initial_overlap
from lcmchain.effects.switches import effects_of
from lcmchain.errors import InputError
from lcmchain.judgements.quasi_static import process_time_needed
from lcmchain.judgements.verdicts import field_verdicts
from lcmchain.model import build_model
from lcmchain.scene.reading.single_tables import (
    formed_material,
    formed_permeability,
    formed_plies,
    is_scene_file,
)
from lcmchain.study.accuracy import ladder
from lcmchain.study.sensitivity import default_inputs
from lcmchain.study.sources import SceneText

PLY = '[[plies]]\nsize = ["40 mm", "40 mm"]\nedge_length = "10 mm"\n'
MD600 = 'material = { preset = "MD600" }\n'
T = 1.004  # thickness of MD600 [mm]
PLATES = """
[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}
[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {height} mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "{stroke} mm" }}
"""


def printed(tables):
    console = Console(width=200)
    with console.capture() as capture:
        for table in tables:
            console.print(table)
    return capture.get()


def test_the_plies_stand_as_they_lie_with_what_is_between_them(scene_of):
    scene = scene_of(
        PLY + 'material = "a"\n' + PLY + 'name = "upper"\nmaterial = "b"\nfibre_angle = "45 deg"\n'
        'center = ["5 mm", "0 mm"]\n[materials.a]\npreset = "MD600"\n[materials.b]\n'
        'preset = "glass-plain-600"\n[[interfaces]]\nbetween = ["a", "b"]\nfriction = 0.25\n'
    )
    text = printed(stack_tables(scene, [16, 17]))
    lines = text.splitlines()
    upper, lower = (
        [line.strip().startswith(name) for line in lines].index(True) for name in ("upper", "ply_1")
    )
    assert upper < lower
    assert "45 deg" in lines[upper]
    assert "shifted by (5, 0) mm" in lines[upper]
    assert "MD600" in lines[lower]
    assert "16" in lines[lower]
    assert "ply_1 and upper" in text
    assert "0.25" in text
    assert stack_tables(scene_of(MD600 + PLY), [16]) == []


def test_a_material_of_no_ply_is_told(scene_of):
    text = MD600 + PLY + 'material = "a"\n[materials.a]\npreset = "MD600"\n'
    assert "material is the material of no ply" in " ".join(scene_warnings(scene_of(text)))
    used = MD600 + PLY
    assert "of no ply" not in " ".join(scene_warnings(scene_of(used)))


@pytest.mark.parametrize("height", [T, 2 * T])
def test_a_tool_may_touch_the_uppermost_ply_and_reach_into_none(scene_of, height):
    scene = scene_of(MD600 + PLY.replace("[[plies]]", f'[[plies]]\nheight = "{T / 2} mm"') + PLY
                     + PLATES.format(height=height, stroke=0.1))  # fmt: skip
    tools = build_model(scene).tools
    if height > 1.5 * T:
        gaps = require_no_initial_overlap(scene, tools)
        assert [gap.gap for gap in gaps] == pytest.approx([0.0, 0.0], abs=1e-9)
        return
    with pytest.raises(
        InputError, match=r'tools\[1\] "upper".position: .*reaches 1 mm into'
    ) as caught:
        require_no_initial_overlap(scene, tools)
    assert f"z = 0 mm and {2 * T:.4g} mm" in str(caught.value)
    assert 'plies[0] "ply_1".height' in str(caught.value)


def test_tools_that_leave_half_the_stack_are_told_by_its_whole_thickness(scene_of):
    def told(stroke):
        scene = scene_of(MD600 + PLY.replace("[[plies]]", f'[[plies]]\nheight = "{T / 2} mm"')
                         + PLY + PLATES.format(height=2 * T, stroke=stroke))  # fmt: skip
        model = build_model(scene)
        closing = closing_tools(scene, [ply.build_blank() for ply in scene.stack], model)
        return tools_that_close(scene, model, closing)

    assert told(0.9 * T) == []
    (text,) = told(1.1 * T)
    assert f"which is {2 * T:.4g} mm thick" in text


def test_a_holder_on_two_plies_swings_on_both(scene_of):
    holder = (
        '[[tools]]\nname = "holder"\nshape = {{ type = "plate", side = "above" }}\n'
        'position = "0 0 {} mm"\nmotion = {{ type = "guided", direction = [0, 0, -1], '
        'mass = "1 kg", force = "1 N" }}\n'
    )
    one, two = (
        process_time_needed(
            build_model(scene_of(MD600 + PLY * count + holder.format(T * (count - 0.5))))
        ).holder_periods["holder"]
        for count in (1, 2)
    )
    assert two == pytest.approx(np.sqrt(2.0) * one)


def test_a_check_of_very_many_elements_coarsens_all_plies(scene_of, monkeypatch):
    scene = scene_of(MD600 + PLY + PLY.replace('"10 mm"', '"5 mm"'))
    monkeypatch.setattr(large_mesh, "LARGE", 50)
    monkeypatch.setattr(large_mesh, "ENOUGH", 20)
    found = checked_mesh(scene)
    assert found.refinement == pytest.approx(2.0)  # 16 and 64 elements
    edges = [ply.blank.edge_length for ply in found.scene.stack]
    assert edges == pytest.approx([0.02, 0.01])
    (text,) = found.remarks([ply.build_blank() for ply in found.scene.stack])
    assert "about 80 elements" in text


def test_what_holds_for_all_plies_is_told_once(scene_of):
    names = [effect.name for effect in effects_of(build_model(scene_of(MD600 + PLY * 3)))]
    assert names.count("compaction") == 1
    other = PLY + 'element = { hourglass = "published" }\n'
    mixed = [effect.name for effect in effects_of(build_model(scene_of(MD600 + PLY * 2 + other)))]
    assert "hourglass control of ply_1, ply_2" in mixed
    assert "hourglass control of ply_3" in mixed


def test_each_fabric_is_judged_by_its_own_law(scene_of, laid):
    """The wide lower ply is sheared by 15 degrees, the small upper one by one."""

    def found(lower, upper):
        scene = scene_of(
            PLY.replace('"40 mm"', '"160 mm"') + 'material = "a"\n' + PLY + 'material = "b"\n'
            f'[materials.a]\npreset = "MD600"\nmembrane.shear_range = "{lower} deg"\n'
            '[materials.b]\nname = "other"\npreset = "MD600"\n'
            f'membrane.shear_range = "{upper} deg"\n'
        )
        verdicts = {v.check: v for v in field_verdicts(laid(scene)["/"], scene)}
        return verdicts["Shear angle of MD600"], verdicts["Shear angle of other"]

    wide, small = found(60, 5)
    assert (wide.grade, small.grade) == ("good", "good")
    wide, small = found(5, 0.1)
    assert "good" not in (wide.grade, small.grade)
    assert "materials.a.membrane.shear_range" in wide.remedy_key
    assert "materials.b.membrane.shear_range" in small.remedy_key


def test_words_about_the_blank_become_words_about_plies(scene_of):
    stack = scene_of(MD600 + PLY * 2).stack
    text = 'use a smaller blank.edge_length; use blank.edge_length = "3 mm"'
    told = stack.in_own_words(text)
    assert "blank" not in told
    assert "edge_length of [[plies]]" in told
    one = scene_of(MD600 + PLY.replace("[[plies]]", "[blank]")).stack
    assert one.in_own_words(text) == text


def test_a_study_of_fields_names_its_command(scene_of, tmp_path):
    (tmp_path / "scene.toml").write_text(
        'process = { time = "10 ms" }\n' + MD600 + PLY * 2, encoding="utf-8"
    )
    with pytest.raises(InputError, match="plies: names 2 plies .* lcmchain study accuracy varies"):
        ladder(SceneText.from_file(tmp_path / "scene.toml"))


def test_numbers_of_every_material_and_interface_are_inputs_of_a_sensitivity(scene_of):
    scene = scene_of(
        PLY + 'material = "a"\n' + PLY + 'material = "b"\n[materials.a]\npreset = "MD600"\n'
        '[materials.b]\npreset = "glass-plain-600"\n[[interfaces]]\nfriction = 0.25\n'
    )
    inputs = default_inputs(scene)
    assert inputs["interfaces.0.friction"] == "0.25"
    assert {"materials.a.compaction.c0", "materials.b.compaction.c0"} <= set(inputs)


def test_a_file_with_plies_is_a_scene(tmp_path):
    for number, text in enumerate((PLY, 'layup = "[0]2"\n', "plies = []\n", "# plies\n")):
        (tmp_path / f"{number}.toml").write_text(text, encoding="utf-8")
        assert is_scene_file(tmp_path / f"{number}.toml") == (number < 3)


def test_a_result_of_a_stack_has_no_one_material_but_its_permeability():
    text = (
        'process = { time = "10 ms" }\npermeability = { law = "gebart", fibre_radius = "3.5 um" }\n'
        + PLY + 'material = "a"\n' + PLY + 'material = "a"\n[materials.a]\npreset = "MD600"\n'
    )  # fmt: skip
    with pytest.raises(InputError, match="a stack of plies"):
        formed_material(text)
    assert formed_permeability(text).law == "gebart"


def test_a_result_of_a_stack_has_a_material_for_each_ply():
    """With the overrides of the run."""
    head = 'process = { time = "10 ms" }\n'
    named = head + (
        PLY + 'name = "low"\n' + PLY + 'material = "thin"\n'
        '[material]\npreset = "MD600"\n[materials.thin]\npreset = "MD600"\n'
        '# Overrides:\n# --set materials.thin.thickness="0.5 mm"\n'
        '# --set plies.low.edge_length="4 mm"\n'
    )
    found = formed_plies(named)
    assert list(found) == ["low", "ply_2"]
    assert [table.thickness for table in found.values()] == [1.004e-3, 0.5e-3]
    blank = 'blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm" }\n'
    laid = formed_plies('layup = "[0/90, 45/-45]s"\n' + head + MD600 + blank)
    assert list(laid) == ["ply_1", "ply_2", "ply_3", "ply_4"]
    with pytest.raises(InputError, match="has no plies"):
        formed_plies(head + MD600 + blank)


def test_a_check_speaks_of_the_plies_that_the_scene_has(scene_of):
    """Warnings of edge lengths name those of [[plies]], not a blank that is not there."""
    plate = 'shape = { type = "plate", side = "below" }'
    hole = (
        'shape = { type = "plate_with_hole", hole_radius = "15 mm", fillet_radius = "5 mm", '
        'side = "below" }'
    )
    tools = PLATES.format(height=2.1 * T, stroke=0.05).replace(plate, hole)
    scene = scene_of(MD600 + PLY + 'height = "0.502 mm"\n' + PLY + tools)
    (warning,) = [text for text in check_scene(scene).warnings if "fillet" in text]
    assert "edge_length of [[plies]]" in warning
    assert "blank." not in warning


def test_a_fillet_is_compared_with_the_elements_of_each_ply(scene_of):
    """The finest ply of a stack says nothing of the others: each is named with its own edge."""
    hole = (
        '[[tools]]\nname = "die"\nshape = { type = "plate_with_hole", hole_radius = "30 mm", '
        'fillet_radius = "6 mm", side = "below" }\nposition = "0 0 -1 mm"\n'
    )

    def told(*edges):
        plies = "".join(
            PLY.replace('"10 mm"', f'"{edge} mm"') + f'name = "{name}"\n'
            for name, edge in zip(("low", "mid", "top"), edges)
        )
        scene = scene_of(MD600 + plies + hole)
        return [text for text in scene_warnings(scene) if "long for the fillet" in text]

    assert told(2, 2.5, 2) == []
    (text,) = told(2, 8, 2)
    assert text.startswith("the elements of the ply mid (8 mm) are long")
    assert 'use plies[1] "mid".edge_length = "' in text
    (text,) = told(8, 2, 8)
    assert text.startswith("the elements of the plies low and top (8 mm) are long")
    assert len(told(8, 2, 9)) == 2
    (text,) = told(8, 8, 8)  # as one sheet of such elements
    assert text.startswith("the elements (8 mm) are long")
