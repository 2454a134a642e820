"""A tool that never touches the sheet is told: before a run where it is certain, and after it."""

from __future__ import annotations

import pytest

from lcmchain.check import check_scene
from lcmchain.check.tool_strokes import tools_never_touched, tools_out_of_reach
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
title = "out of reach"
process = { time = "2 ms", frames = 3 }
material = { preset = "MD600" }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
[[tools]]
name = "bed"
shape = { type = "plate", side = "below" }
"""
STROKE = 'type = "stroke", direction = [0, 0, {way}], distance = "{distance} mm"'
TABLE = 'type = "table", direction = [0, 0, 1], times = "0 1 2 ms", travel = "0 {first} {last} mm"'


def tool(
    motion, *, name="punch", height=3.004, shape='type = "sphere_capped_punch", radius="9 mm"'
):
    return f"""
[[tools]]
name = "{name}"
shape = {{ {shape} }}
position = "0 0 {height} mm"
motion = {{ {motion} }}
"""


def out_of_reach(*tools, overrides=()):
    scene = scene_from_text(SCENE + "".join(tools), overrides=overrides)
    return tools_out_of_reach(scene, build_model(scene))


@pytest.mark.parametrize(
    ("motion", "least"),
    [
        (STROKE.format(way=-1, distance=1.5), "0.5 mm"),  # too short: 2 mm are between
        (STROKE.format(way=1, distance=1.5), "2 mm"),  # away from the blank
        (TABLE.format(first=4, last=-1.2), "0.8 mm"),
        (STROKE.format(way=-1, distance=1.98), "0.02 mm"),
    ],
)
def test_a_travel_that_ends_before_the_blank_is_told_by_the_check(motion, least):
    (warning,) = out_of_reach(tool(motion))
    told = f"punch never touches the blank: over its whole travel it comes no closer than {least},"
    assert told in warning
    assert "tools.punch.motion.direction" in warning
    assert ("motion.travel" if "table" in motion else "motion.distance") in warning
    assert warning in check_scene(scene_from_text(SCENE + tool(motion))).warnings


@pytest.mark.parametrize(
    ("motion", "height", "told"),
    [
        (STROKE.format(way=1, distance=1.5), 1.004, True),
        (TABLE.format(first=1, last=1.5), 1.004, True),
        (STROKE.format(way=-1, distance=0.2), 1.004, False),  # presses
        (TABLE.format(first=1.5, last=-0.2), 1.004, False),  # leaves, and comes back to press
    ],
)
def test_a_tool_that_touches_at_the_start_and_moves_away_is_told(motion, height, told):
    found = out_of_reach(tool(motion, height=height))
    assert bool(found) == told
    if told:
        assert "touches the blank at the start and moves away from it, by 1.5 mm" in found[0]
        assert "tools.punch.motion.direction" in found[0]
    pressing = tool(STROKE.format(way=-1, distance=2.1), name="other", height=3.004)
    assert out_of_reach(tool(motion, height=height), pressing) == []


def test_what_may_touch_is_not_told_before_the_run():
    short = tool(STROKE.format(way=-1, distance=1.5))
    long = tool(STROKE.format(way=-1, distance=2.1), name="other")
    guided = tool('type = "guided", direction = [0, 0, -1], mass = "1 kg"', name="other")
    assert out_of_reach(tool(STROKE.format(way=-1, distance=2.0))) == []  # just touches
    assert out_of_reach(tool(TABLE.format(first=4, last=-2.1))) == []
    assert out_of_reach(short, long) == []  # the other one moves the sheet, perhaps to it
    assert out_of_reach(short, guided) == []
    assert out_of_reach(short, overrides=["process.gravity=true"]) == []
    assert out_of_reach() == []  # nothing moves: another remark
    # a sheet that a fixed tool touches stays where it is
    assert len(out_of_reach(short, tool(STROKE.format(way=-1, distance=1), name="other"))) == 2


def test_a_sharp_approach_is_followed_without_a_jump():
    """A tool that passes the rim of the blank closely, and is far from it at the end."""
    sideways = 'type = "stroke", direction = [1, 0, 0], distance = "90 mm"'
    passing = tool(sideways, height=3.004).replace("0 0 3.004", "-45 0 1.014")
    assert out_of_reach(passing) == []  # 0.01 mm above the blank: within what counts as a touch
    (warning,) = out_of_reach(passing.replace("1.014", "1.054"))
    assert "no closer than 0.05 mm" in warning


def test_a_run_tells_which_tools_never_touched():
    scene = scene_from_text(
        SCENE
        + tool(STROKE.format(way=-1, distance=2.3))
        + tool(STROKE.format(way=-1, distance=1.25), name="short")
        + tool('type = "fixed"', name="far", height=9.004)
        + tool(
            STROKE.format(way=1, distance=0.7),
            name="leaving",
            height=0.0,
            shape='type = "plate", side = "below"',
        ).replace("[0, 0, 1]", "[0, 0, -1]")
        + tool('type = "guided", direction = [0, 0, 1], mass = "1 kg"', name="up", height=4.004)
        + tool(
            'type = "fixed"', name="resting", height=-5e-6, shape='type = "plate", side = "below"'
        )
    )
    simulation = Simulation.from_scene(scene)
    snapshots = [simulation.snapshot()]
    for time in (1e-3, 2e-3):
        simulation.advance_to(time)
        snapshots.append(simulation.snapshot())
    found = tools_never_touched(simulation.model, simulation.state, snapshots)
    assert [warning.split()[0] for warning in found] == ["short", "far", "leaving", "up"]
    # 2 mm less its travel, and 0.3 mm by which the punch has pushed the sheet out of its way
    assert "came no closer than 1.05 mm in the saved frames" in found[0]
    assert "tools.short.motion.distance" in found[0]
    assert "tools.far.position, or leave the tool out" in found[1]
    assert "touched the sheet at the start, never pressed on it, and is 0.699 mm" in found[2]
    assert "no closer than 3 mm" in found[3] and "its force" in found[3]
