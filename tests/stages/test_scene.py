"""The tables of stages: what they fill in, and one clear error for each contradiction."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lcmchain.effects.process.tool_motion import active
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.fields.stages import STAGE
from lcmchain.mesh.blank import build_blank
from lcmchain.model import build_model
from lcmchain.report.html import tool_data
from lcmchain.scene import scene_from_text
from lcmchain.scene.rungs import on_rung
from lcmchain.scene.stages import stage_at
from lcmchain.solver.remedies import slower_loads
from lcmchain.state import State
from lcmchain.study.sources import SceneText, Variant
from lcmchain.summary import _formed_frame

SCENE = """
process = { frames = 13 }
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[[tools]]
name = "die"
shape = { type = "plate", side = "below" }

[[tools]]
name = "punch"
shape = { type = "plate", side = "above" }
position = "0 0 1.01 mm"
stages = ["press", "open"]

[[grippers]]
name = "clamp"
box = ["-30 -10 -1 mm", "-30 10 2 mm"]
hold = "xyz"
stages = ["press"]

[[stages]]
name = "press"
time = "4 ms"
motions.punch = { type = "stroke", direction = [0, 0, -1], distance = "0.2 mm" }

[[stages]]
name = "open"
time = "2 ms"
motions.punch = { type = "stroke", direction = [0, 0, 1], distance = "0.5 mm", profile = "linear" }

[[stages]]
name = "release"
time = "6 ms"
rest = true
"""

UNSTAGED = """
process = { time = "2 s" }
blank = { size = ["60 mm", "20 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
"""


def scene(*overrides, text=SCENE):
    return scene_from_text(text, overrides=overrides)


PRESSURE = """
[[pressure]]
name = "air"
face = "top"
value = "1 kPa"
stages = ["release"]
"""


def test_the_process_takes_the_times_of_its_stages_and_has_frames_at_their_borders():
    staged = scene()
    assert staged.process.time == pytest.approx(12e-3)
    times = staged.frame_times
    assert times.size == 13 and times[0] == 0.0 and times[-1] == staged.process.time
    assert {0.004, 0.006} <= {round(float(time), 12) for time in times}
    assert [stage_at(staged, time) for time in (0.0, 4e-3, 4.1e-3, 6e-3, 12e-3)] == [0, 0, 1, 1, 2]
    assert scene('stages.press.time="8 ms"').process.time == pytest.approx(16e-3)


def test_a_tool_has_its_course_over_all_stages_along_one_line():
    """Which pictures and checks read; the other way along the line counts back."""
    motion = scene().tools[1].motion
    travel = dict(zip(motion.times, motion.travel, strict=True))
    assert travel[0.0] == 0.0 and travel[4e-3] == pytest.approx(0.2e-3)
    assert motion.times[-1] == pytest.approx(6e-3) and motion.travel[-1] == pytest.approx(-0.3e-3)
    middle = np.interp(2e-3, motion.times, motion.travel)
    assert middle == pytest.approx(0.1e-3, rel=1e-6)  # of a smooth stroke
    assert scene().tools[0].motion.type == "fixed"


def test_stages_say_who_is_at_work_and_what_moves():
    press, opened, release = scene().stage_plans()
    assert (press.tools, opened.tools, release.tools) == ((True, True), (True, True), (True, False))
    assert [plan.grippers for plan in (press, opened, release)] == [(True,), (False,), (False,)]
    assert (press.start, opened.start, release.start) == (0.0, 4e-3, 6e-3)
    assert opened.motions[1].profile == "linear" and not release.motions[1].moves


FOUND = (
    SCENE.replace('time = "4 ms"\n', "").replace('time = "2 ms"\n', "")
)  # fmt: skip


def test_times_are_found_where_strokes_lead_and_damping_with_them():
    found = scene(text=FOUND)
    press, opened, release = found.stage_plans()
    assert found.time_is_found and found.stages[0].time_is_found
    assert not found.stages[2].time_is_found
    assert press.mass_damping == pytest.approx(10.0 / press.time)
    assert press.averaging == pytest.approx(0.06 * press.time)
    assert release.mass_damping == 0.0 and np.isinf(release.averaging)
    assert opened.time == pytest.approx(press.time)
    own = scene('stages.press.mass_damping="7 1/s"', text=FOUND).stage_plans()[0]
    assert own.mass_damping == 7.0


def test_the_damping_of_a_stage_is_its_own():
    """Also where another stage has a larger one."""
    given = scene('stages.press.mass_damping="700 1/s"')
    press, opened, _ = given.stage_plans()
    assert press.mass_damping == 700.0
    assert opened.mass_damping == scene().process.mass_damping < 700.0


def test_a_scene_on_another_rung_keeps_its_stages():
    net = on_rung(scene(), "kinematic")
    assert [stage.name for stage in net.stages] == ["press", "open", "release"]
    assert net.process.time == pytest.approx(12e-3) and not net.grippers


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (['process.time="10 ms"'], "process.time.*leave it out"),
        (["process.frames=3"], "process.frames.*at least 4"),
        (["tools.punch.stages=['press', 'opne']"], 'no stage of this name.*did you mean "open"'),
        (["tools.punch.stages=['press', 'press']"], 'names "press" twice'),
        (["tools.punch.stages=[]"], "tools.*stages"),
        (["tools.punch.stages=['press']"], 'stages.1. "open".motions.punch.*not at work in this'),
        (["stages.open.name='press'"], 'has the name "press" twice'),
        (["stages.press.motions.pnuch={type='fixed'}"], 'did you mean "punch"'),
        (
            ["tools.punch.motion={type='stroke', direction=[0, 0, -1], distance='1 mm'}"],
            "stages.press.motions.punch",
        ),
        (["stages.open.motions.punch.direction=[1, 0, 1]"], "along another line"),
        (["stages.open.motions.punch.end='5 ms'"], "stages.open.time.*earlier end"),
        (
            ["stages.open.motions.punch={type='table', direction=[0,0,1], times='0 5 ms', "
             "travel='0 1 mm'}"],
            "after the end of the stage",
        ),
        (["stages.release.mass_damping='1 1/s'"], "leave one of them out"),
        (["stages.press.rest_energy=0.01"], "belongs to rest = true"),
        (["stages.release.springback_from='release'"], "stage before this one"),
        (["process.quasi_static=2.0"], "the times of all stages are given"),
        (
            ["stages.open.motions.clamp={type='stroke', direction=[1,0,0], distance='1 mm'}"],
            'gripper "clamp", which is not at work',
        ),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_one_clear_error(overrides, told):
    with pytest.raises(InputError) as error:
        scene(*overrides)
    message = str(error.value)
    assert re.search(told, message, re.DOTALL), message
    assert "errors:" not in message


def test_a_stage_without_time_and_stroke_is_an_error():
    with pytest.raises(InputError, match="stages.*release.*time.*is missing"):
        scene(text=SCENE.replace('time = "6 ms"\n', ""))
    alone = SCENE.partition("[[stages]]")[0].replace("frames = 13", 'time = "5 ms"')
    with pytest.raises(InputError, match="the scene has no .*stages"):
        scene(text=alone)


def test_a_tool_is_at_work_in_its_stages_and_a_border_belongs_to_the_one_before():
    model = build_model(scene())
    works = [model.tools_at_work(time)[1] for time in (0.0, 4e-3, 6e-3, 6.1e-3, 12e-3)]
    assert works == [True, True, True, False, False]
    assert model.tools_at_work(12e-3)[0]


def test_what_is_told_of_an_entry_is_of_its_stages():
    """A ramp by default is a part of a stage; a tool that is drawn back has been elsewhere."""
    scene = scene_from_text(SCENE + PRESSURE)
    told = dict(scene.source.defaulted)
    assert told["pressure.air.ramp"] == "0.1 of the stage in which it comes to work"
    (punch,) = (e for e in active(build_model(scene)) if e.name == "prescribed motion of punch")
    assert punch.reason == "between -0.3 and 0.2 mm, -0.3 mm at the end of 12 ms"


def test_a_remedy_names_the_ramp_of_a_pressure_where_it_is_at_work():
    whole = build_model(scene_from_text(SCENE + PRESSURE))
    model = whole.in_stage(0, State.at_rest(whole))
    assert "pressure.ramp" not in slower_loads(model, 0.4)
    assert slower_loads(model, 0.4).startswith("stages.press.time")
    released = whole.in_stage(2, State.at_rest(whole))
    assert "pressure.ramp" in slower_loads(released, 0.4)


def test_the_view_of_the_report_shows_tools_in_the_frames_in_which_they_work():
    """The punch is idle in the release; a tool that never works is not there at all."""
    staged = scene()
    blank = build_blank(staged.blank, staged.material.thickness)
    frames = FrameSeries(
        np.zeros(1), blank.node_positions[None], np.zeros((1, 0)), np.zeros((1, 0, 3))
    )
    sheet = build_datasets(staged, blank, frames)["/"]
    history = xr.Dataset(
        {"tool_travel": (("time", "tool"), np.zeros((3, 2))), STAGE: ("time", [0, 1, 2])}
    )
    works = {tool["name"]: tool["works"] for tool in tool_data(staged, sheet, history)}
    assert works == {"die": [True, True, True], "punch": [True, True, False]}
    released = history.isel(time=[2])
    assert [tool["name"] for tool in tool_data(staged, sheet, released)] == ["die"]


@pytest.mark.parametrize(
    ("rests", "frame"),
    [((False, False, True), 6), ((False, False, False), 12), ((True, False, True), 6),
     ((False, True, True), 4), ((True, True, True), 12)],
)  # fmt: skip
def test_damping_is_judged_where_forming_ends(rests, frame):
    """Stages of 4, 2 and 6 ms, a frame each: forming ends with the last one without rest."""
    staged = scene()
    stages = [s.model_copy(update={"rest": rest}) for s, rest in zip(staged.stages, rests)]
    staged = staged.model_copy(update={"stages": tuple(stages)})
    assert (
        _formed_frame(staged, np.linspace(0.0, 12e-3, 13).tolist(), 13 * [1.0], 13 * [1.0]) == frame
    )
    assert (
        _formed_frame(scene_from_text(UNSTAGED), [0.0, 1.0, 2.0], [0.0, 1.0, 0.6], [0.0, 0.9, 0.1])
        == 2
    )


def test_damping_and_inertia_are_judged_before_tools_open():
    """The sheet gives its work back to tools that open: what is left of it judges nothing."""
    unstaged, stored = scene_from_text(UNSTAGED), [*range(8), 7.0, 7.0, 3.0, 1.0, 0.0]
    times = np.linspace(0.0, 12e-3, 13).tolist()
    assert _formed_frame(unstaged, times, [*range(10), 6.0, 5.0, 5.0], stored) == 9
    assert _formed_frame(unstaged, times, [*range(10), 8.0, 7.0, 6.0], stored) == 12


def test_a_study_leaves_the_borders_of_stages_as_frames():
    variant = Variant("5 mm", "edge", ("blank.edge_length=5 mm",), 5e-3)
    text = SceneText(SCENE, str(Path("scene.toml").resolve()))
    assert text.job(variant).scene.process.frames == 4
    plain = SceneText(UNSTAGED, str(Path("scene.toml").resolve()))
    assert plain.job(variant).scene.process.frames == 2
