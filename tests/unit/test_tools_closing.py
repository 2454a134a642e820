"""The check sees tools that close through each other, or on less than a sheet."""

from __future__ import annotations

import pytest

from lcmchain.check import check_scene
from lcmchain.scene import scene_from_text

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


def told(*tools):
    report = check_scene(scene_from_text(SCENE.format(tools="".join(tools))))
    return [warning for warning in report.warnings if "no space for the sheet" in warning]


def hole(radius, name="die", side="below", z=0.0):
    return HOLE.format(name=name, radius=radius, side=side, z=z)


def test_a_punch_that_is_larger_than_its_hole_is_told_with_tools_place_gap_and_travel():
    (warning,) = told(PUNCH.format(distance=20), hole(14))
    assert warning.startswith("punch and die overlap by ")
    assert "at 40 ms, punch at a travel of 20 mm" in warning
    assert "which is 1.004 mm thick, from " in warning and "check tools.punch.motion" in warning
    overlap = float(warning.split("overlap by ")[1].split(" mm")[0])
    # the pole lies 19 mm below the die's face, the cylinder of 15 mm above it in the hole of 14 mm
    assert 0.9 < overlap < 1.6


@pytest.mark.parametrize("radius, found", [(15.4, 1), (15.6, 0), (17, 0)])
def test_half_a_thickness_between_punch_and_hole_is_the_limit(radius, found):
    assert len(told(PUNCH.format(distance=20), hole(radius))) == found


def test_tools_on_the_same_side_have_no_sheet_between_them():
    assert told(PUNCH.format(distance=20), hole(14, "holder", "above", 1.004)) == []


def test_plates_that_are_closest_on_the_way_are_told_at_that_time():
    low = PLATE.format(name="bed", side="below", z=0, motion='type = "fixed"')
    (warning,) = told(low, PLATE.format(name="press", side="above", z=10.3, motion=THERE_AND_BACK))
    assert "bed and press are 0.3 mm apart" in warning
    assert "at 17.05 ms, press at a travel of 10 mm" in warning
    higher = PLATE.format(name="press", side="above", z=10.6, motion=THERE_AND_BACK)
    assert told(low, higher) == []
