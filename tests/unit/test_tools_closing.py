"""The check sees tools that close through each other, or on less than a sheet."""

from __future__ import annotations

import io
from pathlib import Path

import meshio
import numpy as np
import pytest
from rich.console import Console

from lcmchain import pipeline
from lcmchain.check import check_scene
from lcmchain.effects.contact_depth import closest_gap
from lcmchain.errors import LIKELY_CAUSE, InputError, SimulationError
from lcmchain.forming_run import FormingRun
from lcmchain.model import build_model
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.state import TIME

SCENE = """
title = "tools that close"
[process]
time = "40 ms"
[blank]
size = ["60 mm", "60 mm"]
edge_length = "10 mm"
height = "0.502 mm"
[material]
preset = "MD600"
{tools}
"""
PUNCH = """
[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "15 mm" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "{distance} mm" }}
"""
HOLE = """
[[tools]]
name = "{name}"
shape = {{ type = "plate_with_hole", hole_radius = "{radius} mm", fillet_radius = "5 mm", side = "{side}" }}
position = "0 0 {z} mm"
"""  # noqa: E501
PLATE = """
[[tools]]
name = "{name}"
shape = {{ type = "plate", side = "{side}" }}
position = "0 0 {z} mm"
motion = {{ {motion} }}
"""
# down by 10 mm at 17 ms, between two of the evenly spaced times, and back
THERE_AND_BACK = (
    'type = "table", direction = [0, 0, -1], times = "0 16.9 17.05 17.2 40 ms", '
    'travel = "0 9 10 9 0 mm"'
)
# a form that is raised by 15 mm in its middle, under a plate that ends 1.2 mm above it
STEP = """
[[tools]]
name = "form"
shape = {{ type = "surface_mesh", file = "form.stl", length_unit = "mm" }}
[[tools]]
name = "press"
shape = {{ type = "plate", side = "above" }}
position = "0 0 17 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "0.8 mm" }}
""".format()


# oval skins that are smaller than the sheet; the upper one ends 1 mm above the lower one
SKINS = """
[[tools]]
name = "lower"
shape = {{ type = "surface_mesh", file = "{folder}/lower.stl", length_unit = "mm" }}
[[tools]]
name = "upper"
shape = {{ type = "surface_mesh", file = "{folder}/upper.stl", length_unit = "mm" }}
position = "0 0 18.5 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "20.2 mm" }}
"""


def step_surface(half, height):
    """A square plate [mm] of that half width, with a square of half of it raised in the middle."""
    x = np.array([-half, -0.2 * half, 0.2 * half, half])
    corner = [[[a, b, 0.0] for b in x] for a in x]
    points = np.array(corner).reshape(-1, 3)
    top = points[[5, 6, 9, 10]] + [0.0, 0.0, height]
    points = np.concatenate([points, top])
    quads = [[4 * i + j, 4 * i + 4 + j, 4 * i + 5 + j, 4 * i + 1 + j]
             for i in range(3) for j in range(3) if (i, j) != (1, 1)]  # fmt: skip
    quads += [[16, 18, 19, 17], [5, 9, 18, 16], [9, 10, 19, 18], [10, 6, 17, 19], [6, 5, 16, 17]]
    triangles = [[a, b, c] for a, b, c, d in quads] + [[a, c, d] for a, b, c, d in quads]
    return meshio.Mesh(points, [("triangle", np.array(triangles))])


def checked(*tools):
    return check_scene(scene_from_text(SCENE.format(tools="".join(tools))))


def told(*tools):
    report = checked(*tools)
    return [warning for warning in report.warnings if "no space for the sheet" in warning]


def hole(radius, name="die", side="below", z=0.0):
    return HOLE.format(name=name, radius=radius, side=side, z=z)


def test_a_punch_that_is_larger_than_its_hole_is_refused_with_tools_place_gap_and_travel():
    with pytest.raises(InputError) as refused:
        checked(PUNCH.format(distance=20), hole(14))
    warning = refused.value.message
    assert refused.value.key == 'tools[0] "punch".motion'
    assert warning.startswith("punch and die overlap by ")
    assert "at 40 ms, punch at a travel of 20 mm" in warning
    assert "which is 1.004 mm thick, from " in warning and "check tools.punch.motion" in warning
    overlap = float(warning.split("overlap by ")[1].split(" mm")[0])
    # the pole lies 19 mm below the die's face, the cylinder of 15 mm above it in the hole of 14 mm
    assert 0.9 < overlap < 1.6


@pytest.mark.parametrize(("reached", "blamed"), [(0.4, False), (0.9, True)])
def test_a_run_that_a_guard_stops_blames_tools_that_have_left_no_space(
    reached, blamed, tmp_path, monkeypatch
):
    def stopped_by_a_guard(self, checkpoint=None):
        self.snapshots = [self.simulation.snapshot()]
        self.simulation.state.clock[TIME] = reached * self.simulation.model.process_time
        raise SimulationError(f"nodes are deep. {LIKELY_CAUSE}a soft contact; set a higher penalty")

    monkeypatch.setattr(pipeline, "compile_loops", lambda *arguments: None)
    monkeypatch.setattr(FormingRun, "complete", stopped_by_a_guard)
    plates = [
        PLATE.format(name="lower", side="below", z=0, motion='type = "fixed"'),
        PLATE.format(
            name="upper", side="above", z=1.1,
            motion='type = "stroke", direction = [0, 0, -1], distance = "0.7 mm"',
        ),
    ]  # fmt: skip
    quiet = "[output]\npictures = false\nvtu = false\nreport = false\n"
    scene = scene_from_text(SCENE.format(tools="".join(plates)) + quiet)
    with pytest.raises(SimulationError) as stopped:
        pipeline.run(scene, tmp_path)
    told = str(stopped.value)
    assert told.startswith(f"nodes are deep. {LIKELY_CAUSE}")
    assert ("no space for the sheet" in told) == blamed
    assert told.endswith("; else " * blamed + "a soft contact; set a higher penalty")


@pytest.mark.parametrize("radius, found", [(15.4, 1), (15.6, 0), (17, 0)])
def test_half_a_thickness_between_punch_and_hole_is_the_limit(radius, found):
    assert len(told(PUNCH.format(distance=20), hole(radius))) == found


def test_tools_on_the_same_side_have_no_sheet_between_them():
    assert told(PUNCH.format(distance=20), hole(14, "holder", "above", 1.004)) == []


def test_plates_that_are_closest_on_the_way_are_told_at_that_time():
    low = PLATE.format(name="bed", side="below", z=0, motion='type = "fixed"')
    (warning,) = told(low, PLATE.format(name="press", side="above", z=10.4, motion=THERE_AND_BACK))
    assert "bed and press are 0.4 mm apart" in warning
    assert "at 17.05 ms, press at a travel of 10 mm" in warning
    higher = PLATE.format(name="press", side="above", z=10.6, motion=THERE_AND_BACK)
    assert told(low, higher) == []


@pytest.mark.parametrize("above, refused", [(0.325, True), (0.34, False)])
def test_a_gap_below_the_fibres_without_pores_is_refused(above, refused):
    """600 g/m² of 1.81 g/cm³ are 0.3315 mm high."""
    low = PLATE.format(name="bed", side="below", z=0, motion='type = "fixed"')
    press = PLATE.format(name="press", side="above", z=10.0 + above, motion=THERE_AND_BACK)
    if not refused:
        assert len(told(low, press)) == 1
        return
    with pytest.raises(InputError, match=r"0\.325 mm apart .* without pores, are 0\.3315 mm high"):
        checked(low, press)


def test_check_shows_gaps_between_tools_against_the_thickness_before_anything_else():
    """At the end of the process, and where they are closest on the way."""
    low = PLATE.format(name="bed", side="below", z=0, motion='type = "fixed"')
    press = PLATE.format(name="press", side="above", z=10.653, motion=THERE_AND_BACK)
    report = checked(low, press)
    shown = io.StringIO()
    for table in report.first_tables():
        Console(file=shown, width=160).print(table)
    lines = shown.getvalue().splitlines()
    titles = [line for line in lines if line.startswith(("Tools", "Gaps", "Expected"))]
    assert titles[0].startswith("Tools at the start")
    assert titles[1].startswith("Gaps between tools; the sheet is 1.004 mm thick")
    (row,) = [line for line in lines if line.strip().startswith("bed and press")]
    assert "10.653 mm, 1061% of the thickness" in row
    assert "0.653 mm, 65% of the thickness, at 17.05 ms" in row


def test_tools_that_rest_or_lie_on_one_side_have_no_row():
    report = checked(hole(17), hole(17, "holder", "above", 1.004), PUNCH.format(distance=20))
    assert [closing.pair for closing in report.closing] == [(0, 2)]


DEEP = """
[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "75 mm" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "90 mm" }}
[[tools]]
name = "floor"
shape = {{ type = "plate", side = "below" }}
position = "0 0 {floor} mm"
"""


def test_a_gap_far_below_the_flat_sheet_is_found_by_check_and_by_the_control_of_depths():
    """The pole of a ball above a floor: from the sheet all ways lead to the sides of the ball."""
    scene = scene_from_text(SCENE.format(tools=DEEP.format(floor=-89.796)))
    (closing,) = check_scene(scene).closing
    assert closing.end.gap == pytest.approx(0.8e-3, rel=1e-3)
    assert closing.end.place == pytest.approx([0.0, 0.0, -89.396e-3], abs=2e-3)
    model = build_model(scene)
    found = closest_gap(model.tools, [model.only_body().mesh], model.process_time)
    assert found == pytest.approx(closing.closest.gap, rel=1e-6)
    assert model.environment.depth_time is not None


def test_no_gap_is_found_that_is_not_there_where_a_distance_field_knows_only_bounds(tmp_path):
    """A raised square of a surface mesh, far from its surface a bound of the distance alone."""
    form = step_surface(half=50.0, height=15.0)
    meshio.write(tmp_path / "form.stl", form)
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(tools=STEP), encoding="utf-8")
    (closing,) = check_scene(read_scene(path, ['blank.height="16 mm"'])).closing
    # the field rounds its corners by less than its spacing
    assert 1.05e-3 < closing.end.gap <= 1.2001e-3
    model = build_model(read_scene(path, ['blank.height="16 mm"']))
    assert model.environment.depth_time is None


def test_no_gap_is_found_beside_the_rims_of_skins_that_the_sheet_reaches_over():
    """At the corners of the sheet both fields are bounds of a distance, and zero."""
    folder = Path(__file__).parents[2] / "examples" / "stack_in_moulds"
    text = SCENE.format(tools=SKINS.format(folder=folder.as_posix()))
    size = ["blank.size=280 190 mm", "blank.height=0.6 mm", "blank.edge_length=20 mm"]
    (closing,) = check_scene(scene_from_text(text, overrides=size)).closing
    assert 0.9e-3 < closing.end.gap <= 1.01e-3
