"""Verdicts on a result: every grade of every check, and that they agree with the warnings."""

import re

import numpy as np
import pytest

from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.fields.wrinkles import elements_per_wave
from lcmchain.judgements.contact import (
    hidden_compaction_warnings,
    penetration_warnings,
    ply_depth_warnings,
)
from lcmchain.judgements.fields import field_warnings, wave_warnings
from lcmchain.judgements.grades import Verdict, worst_grade
from lcmchain.judgements.quasi_static import (
    balance_warning,
    process_time_needed,
    quasi_static_warnings,
    snap_warnings,
    still_moving_warning,
)
from lcmchain.judgements.verdicts import verdicts
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.mid_surface import triangulate
from lcmchain.model import build_model
from lcmchain.quantities.readable import percent
from lcmchain.scene import scene_from_text

SCENE = """
process = { time = "200 ms" }
blank = { size = ["110 mm", "100 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
[[tools]]
name = "punch"
shape = { type = "plate", side = "above" }
position = "0 0 2 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
"""
MAPPING = {
    "status_count": {"inside": 98, "extrapolated": 0, "unmapped": 0},
    "cell_count": 98,
    "target_coverage": 1.0,
    "worst_distance": 1e-4,
}
PLACE = {
    "registration": {
        "root_mean_square": 6e-4, "root_mean_square_after": 2e-5, "thickness": 1e-3
    },
    "registered": False,
}  # fmt: skip
SOUND = {
    "state": "complete",
    "balance_error_max": 0.0,
    "kinetic_to_internal_over_tenth_of_stroke": 0.0,
    "kinetic_to_internal_end": 0.0,
    "damping_to_external": 0.0,
    "hourglass_to_internal": 0.0,
    "process_time_needed_s": {"shear_period_s": 0.03, "least_s": 0.09, "sufficient_s": 0.3},
    "step_halvings": 0,
    "penetration_max_m": {"punch": 0.0, "die": 0.0},
    "mapping": {"part": MAPPING},
}


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture
def datasets(scene):
    """A flat sheet of 110 elements that nothing has happened to, in two frames."""
    blank = build_blank(scene.blank, scene.material.thickness)
    frames = FrameSeries(
        time=np.array([0.0, 0.2]),
        positions=np.stack([blank.node_positions] * 2),
        tool_travel=np.zeros((2, 1)),
        tool_force=np.zeros((2, 1, 3)),
        tool_names=("punch",),
    )
    return build_datasets(scene, blank, frames)


def judged(scene, datasets, **changes) -> dict[str, Verdict]:
    return {v.check: v for v in verdicts(SOUND | changes, scene, datasets)}


def test_a_sound_result_is_good_in_every_check_and_asks_for_no_change(scene, datasets):
    found = judged(scene, datasets)
    assert len(found) == 14
    assert {verdict.grade for verdict in found.values()} == {"good"}
    assert {verdict.remedy_key for verdict in found.values()} == {""}


@pytest.mark.parametrize(
    ("entry", "check", "doubtful", "bad", "key"),
    [
        ("balance_error_max", "Energy balance", 0.02, 0.031, "process.step_safety"),
        ("kinetic_to_internal_over_tenth_of_stroke", "Quasi-static", 0.2, 0.31, "process.time"),
        ("kinetic_to_internal_end", "At rest at the end", 0.1, 0.16, "process.mass_damping"),
        ("damping_to_external", "Damping", 0.14, 0.16, "process.damping_average"),
        ("hourglass_to_internal", "Resolution by elements", 0.14, 0.16, "blank.edge_length"),
    ],
)
def test_grades_of_shares(scene, datasets, entry, check, doubtful, bad, key):
    for value, grade in ((doubtful, "doubtful"), (bad, "bad")):
        verdict = judged(scene, datasets, **{entry: value})[check]
        assert verdict.grade == grade
        assert key in verdict.remedy_key
        assert percent(value) in verdict.text


@pytest.mark.parametrize("factor", [0.999, 1.001])
@pytest.mark.parametrize(
    ("entry", "limit"),
    [
        ("balance_error_max", 0.01),
        ("kinetic_to_internal_over_tenth_of_stroke", 0.1),
        ("kinetic_to_internal_end", 0.05),
        ("damping_to_external", 0.05),
        ("hourglass_to_internal", 0.05),
        ("penetration_max_m", 1.004e-4),
    ],
)
def test_a_check_is_doubtful_exactly_where_the_summary_warns(scene, datasets, entry, limit, factor):
    value = factor * limit
    summary = SOUND | {entry: {"punch": value} if entry == "penetration_max_m" else value}
    needed = process_time_needed(build_model(scene))
    warned = bool(
        still_moving_warning(summary)
        + penetration_warnings(summary, scene.material.thickness)
        + balance_warning(summary, scene)
        + quasi_static_warnings(summary, scene, needed)
    )
    grade = worst_grade(verdicts(summary, scene, datasets))
    assert warned == (factor > 1.0)
    assert grade == ("doubtful" if warned else "good")


@pytest.mark.parametrize(
    ("time", "grade"),
    [("400 ms", "good"), ("100 ms", "good"), ("80 ms", "doubtful"), ("20 ms", "bad")],
)
def test_grades_of_the_process_time(datasets, time, grade):
    """Three periods of 30 ms are needed, and less than one is no process of the sheet."""
    verdict = judged(scene_from_text(SCENE.replace("200 ms", time)), datasets)["Process time"]
    assert verdict.grade == grade
    assert "30 ms" in verdict.text and "90 ms" in verdict.text and time in verdict.text


def driven_by(motion, gravity="false"):
    """The scene with another motion of its tool, and the sheet's weight or none."""
    stroke = '{ type = "stroke", direction = [0, 0, -1], distance = "1 mm" }'
    text = SCENE.replace(stroke, motion)
    return scene_from_text(text.replace('"200 ms"', f'"200 ms", gravity = {gravity}'))


PRESSED = '{ type = "guided", direction = [0, 0, -1], mass = "1 kg", force = "5 N" }'


@pytest.mark.parametrize(
    ("motion", "gravity", "inertia", "damping"),
    [
        (PRESSED, "false", "tools.motion.ramp, tools.motion.damping", "tools.motion.ramp"),
        ('{ type = "fixed" }', "true", "process.mass_damping", ""),
    ],
)
def test_where_weight_and_force_set_the_pace_other_entries_help(
    datasets, motion, gravity, inertia, damping
):
    """A longer process does not slow them, and whatever is not stored goes into the dampers."""
    shares = {"kinetic_to_internal_over_tenth_of_stroke": 9.0, "damping_to_external": 0.9}
    found = judged(driven_by(motion, gravity), datasets, **shares)
    for check, entries in (("Quasi-static", inertia), ("Damping", damping)):
        assert (found[check].grade, found[check].remedy_key) == ("doubtful", entries)
        assert "weight and forces" in found[check].text
        assert "at rest at the end" in found[check].text


def test_where_nothing_is_driven_no_process_time_is_needed(datasets):
    still = SCENE.replace(', distance = "1 mm"', "").replace('"stroke"', '"fixed"')
    scene = scene_from_text(still.replace(", direction = [0, 0, -1]", ""))
    assert "Process time" not in judged(scene, datasets)


def test_the_deepest_tool_is_named_and_judged_by_the_thickness(scene, datasets):
    for depth, grade in ((0.12e-3, "doubtful"), (0.16e-3, "bad")):  # 0.15 of 1.004 mm
        depths = {"punch": 0.01e-3, "die": depth}
        verdict = judged(scene, datasets, penetration_max_m=depths)["Penetration"]
        assert (verdict.grade, verdict.remedy_key) == (grade, "contact.penalty")
        assert f"{1e3 * depth:.3f} mm into die" in verdict.text


@pytest.mark.parametrize(("part", "grade"), [(0.09, "good"), (0.2, "doubtful"), (0.31, "bad")])
def test_a_depth_between_plies_is_judged_by_the_thinner_one(scene, datasets, part, grade):
    deepest = {"part": part, "depth_m": part * 1e-3, "ply": "top", "into": "base", "time_s": 0.08}
    verdict = judged(scene, datasets, stack={"ply_depth": deepest})["Depth between plies"]
    assert verdict.grade == grade
    assert f"top reach up to {part:.3f} mm into base, at 80 ms: {percent(part)}" in verdict.text
    assert bool(verdict.remedy_key) == (grade != "good")
    warned = ply_depth_warnings({"stack": {"ply_depth": deepest}})
    assert len(warned) == (grade == "bad")
    assert all(f"{percent(part)} of the thinner one" in text for text in warned)
    assert "Depth between plies" not in judged(scene, datasets, stack={"ply_count": 2})


@pytest.mark.parametrize(
    ("thickness", "force", "grade"),
    [(0.009, 0.019, "good"), (0.011, 0.0, "doubtful"), (0.0, 0.021, "doubtful"),
     (0.031, 0.0, "bad"), (0.004, 0.061, "bad")],
)  # fmt: skip
def test_depths_that_hide_compaction_are_judged_by_thickness_and_force(
    scene, datasets, thickness, force, grade
):
    hidden = {"hidden_thickness_part": thickness, "hidden_force_part": force}
    verdict = judged(scene, datasets, **hidden)["Pressure between tools"]
    assert verdict.grade == grade
    assert f"{100 * force:.2g} % more pressure" in verdict.text
    warned = list(hidden_compaction_warnings(hidden))
    assert len(warned) == (grade != "good")


@pytest.mark.parametrize(
    ("strain", "grade"), [(-0.004, "good"), (0.006, "doubtful"), (-0.016, "bad")]
)
def test_grades_of_the_fibre_strain(scene, datasets, strain, grade):
    datasets["/"]["fibre_strain_2"][-1, 7] = strain
    assert judged(scene, datasets)["Fibre strain"].grade == grade


@pytest.mark.parametrize(("count", "grade"), [(0, "good"), (1, "doubtful"), (2, "bad")])
def test_shear_beyond_the_measured_range_is_local_up_to_a_hundredth_of_the_area(
    scene, datasets, count, grade
):
    """MD600 was measured up to 60 degrees; one of 110 elements is local."""
    datasets["/"]["shear_angle"][0, :count] = np.radians(-61.0)
    verdict = judged(scene, datasets)["Shear angle"]
    assert verdict.grade == grade
    assert bool(field_warnings(datasets["/"], scene.material.build())) == (count > 0)


def test_locking_is_judged_beside_the_measured_range(datasets):
    locking = (
        '{ preset = "MD600", membrane = { locking_angle = "50 deg", locking_stiffness = "9 MPa" } }'
    )
    scene = scene_from_text(SCENE.replace('{ preset = "MD600" }', locking))
    datasets["/"]["shear_angle"][1, :3] = np.radians(55.0)
    verdict = judged(scene, datasets)["Shear angle"]
    assert verdict.grade == "bad"
    assert "nothing beyond 60 deg" in verdict.text
    assert "2.73 % of the area beyond 50 deg, where the fabric locks" in verdict.text


def test_shear_without_a_measured_range_is_not_judged(datasets):
    scene = scene_from_text(SCENE)
    membrane = scene.material.membrane.model_copy(update={"shear_range": None})
    material = scene.material.model_copy(update={"membrane": membrane})
    verdict = judged(scene.model_copy(update={"material": material}), datasets)["Shear angle"]
    assert (verdict.grade, verdict.remedy_key) == ("not judged", "material.membrane.shear_range")


@pytest.mark.parametrize(("count", "grade"), [(0, "good"), (1, "doubtful"), (2, "bad")])
def test_packing_beyond_what_fibres_can_be_packed_to(scene, datasets, count, grade):
    datasets["/"]["fibre_volume_fraction"][1, :count] = 0.91
    verdict = judged(scene, datasets)["Thickness and packing"]
    assert verdict.grade == grade
    assert "1.004 to 1.004 mm" in verdict.text
    assert bool(field_warnings(datasets["/"], scene.material.build())) == (count > 0)


@pytest.mark.parametrize(
    ("changes", "grade", "words"),
    [
        ({"status_count": {"extrapolated": 3}}, "doubtful", "3 reach beyond the edge"),
        ({"status_count": {"extrapolated": 3, "unmapped": 1}}, "bad", "1 hold no values"),
        (PLACE, "doubtful", "0.600 mm as root mean square"),
        ({"error": "no sheet within 3 mm"}, "bad", "failed: no sheet within 3 mm"),
    ],
)
def test_grades_of_mappings(scene, datasets, changes, grade, words):
    verdict = judged(scene, datasets, mapping={"part": MAPPING | changes})["Mapping to part"]
    assert verdict.grade == grade
    assert words in verdict.text and 'mapping "part"' in verdict.remedy_key


def test_a_registered_target_is_judged_where_it_was_mapped(scene, datasets):
    changes = PLACE | {"registered": True}
    verdict = judged(scene, datasets, mapping={"part": MAPPING | changes})["Mapping to part"]
    assert verdict.grade == "good" and "0.020 mm as root mean square" in verdict.text


def wave(datasets, elements, slope=0.5):
    """Give the last frame a wave along x, of a slope, with elements of 10 mm."""
    sheet = datasets["/"]
    x = sheet["reference_position_x"].values
    number = 2.0 * np.pi / (elements * 0.01)
    sheet["displacement_z"][-1] = slope / number * np.cos(number * (x - x.min()))
    return sheet


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("elements", [3, 4, 5, 6, 8, 10])
def test_a_wave_has_as_many_elements_as_were_given_to_it(elements, triangles):
    """Also on triangles, whose legs follow the fibres."""
    element = 'element = "membrane-shell"' if triangles else ""
    scene = scene_from_text(element + SCENE.replace('"110 mm"', '"240 mm"'))
    blank = build_blank(scene.blank, scene.material.thickness)
    blank = triangulate(blank) if triangles else blank
    positions = blank.node_positions[None]
    frames = FrameSeries(np.zeros(1), positions, np.zeros((1, 0)), np.zeros((1, 0, 3)))
    found = elements_per_wave(wave(build_datasets(scene, blank, frames), elements))
    inner = found[np.isfinite(found)]
    assert inner.size > 0.5 * found.size
    assert inner == pytest.approx(elements, abs=0.35)
    assert inner.mean() == pytest.approx(elements, abs=0.1)


def test_what_fibres_turn_in_the_plane_is_no_wave(datasets):
    sheet = datasets["/"]
    x = sheet["reference_position_x"].values
    sheet["displacement_y"][-1] = 0.005 * np.cos(2.0 * np.pi / 0.05 * x)
    assert np.isinf(elements_per_wave(sheet)).all()


def test_shallow_waves_domes_and_single_bends_are_no_waves(datasets):
    assert np.isinf(elements_per_wave(wave(datasets, 8, slope=0.07))).all()
    sheet = wave(datasets, 22)  # half a wave over the sheet
    assert np.isinf(elements_per_wave(sheet)).all()
    x = sheet["reference_position_x"].values
    sheet["displacement_z"][-1] = np.maximum(x, 0.0)
    assert np.isinf(elements_per_wave(sheet)).all()


@pytest.mark.parametrize(("elements", "grade"), [(10, "good"), (5, "doubtful"), (3, "bad")])
def test_grades_of_waves(scene, datasets, elements, grade):
    wave(datasets, elements)
    verdict = judged(scene, datasets)["Resolution of wrinkles"]
    assert (verdict.grade, bool(verdict.remedy_key)) == (grade, grade != "good")
    least = float(re.match(r"the shortest wave has ([\d.]+) elements", verdict.text)[1])
    assert least == pytest.approx(elements, abs=0.35)
    warned = wave_warnings(datasets["/"])
    assert bool(warned) == (grade != "good")
    if warned:
        assert f"down to {least:.1f} elements per wavelength" in warned[0]
        assert "blank.edge_length" in warned[0]


def test_halved_steps_are_doubtful(scene, datasets):
    verdict = judged(scene, datasets, step_halvings=2)["Time step"]
    assert (verdict.grade, verdict.remedy_key) == ("doubtful", "process.step_safety")
    assert "halved 2 times" in verdict.text


def test_a_stopped_run_is_bad_says_why_and_is_not_expected_at_rest(scene, datasets):
    reason = "stopped: element 7 is inverted at 3 ms"
    found = judged(scene, datasets, state=reason, kinetic_to_internal_end=9.0)
    assert found["Run"].grade == "bad" and reason in found["Run"].text
    assert "At rest at the end" not in found


@pytest.mark.parametrize(("reached", "grade"), [(0.04, "good"), (None, "bad")])
def test_a_release_that_came_to_rest_is_at_rest_whatever_it_still_stores(
    reached, grade, scene, datasets
):
    """The kinetic energy is more than the internal one, of which a released sheet has none."""
    released = [{"name": "press"}, {"name": "off", "rest": {"reached_s": reached}}]
    moving = {"kinetic_to_internal_end": 1.7, "stages": released}
    verdict = judged(scene, datasets, **moving)["At rest at the end"]
    assert verdict.grade == grade
    assert ("stage off" in verdict.text) == (reached is not None)
    assert bool(still_moving_warning(moving)) == (reached is None)


def test_a_run_that_failed_after_forming_is_expected_at_rest(scene, datasets):
    times = {"process_time_s": 0.2, "time_reached_s": 0.2}
    found = judged(scene, datasets, state="stopped: no sheet near", **times)
    assert found["Run"].grade == "bad" and "its fields are whole" in found["Run"].text
    assert found["At rest at the end"].grade == "good"
    found = judged(scene, datasets, state="interrupted", **times | {"time_reached_s": 0.1})
    assert "At rest at the end" not in found


def test_what_a_summary_does_not_hold_is_left_out(scene, datasets):
    found = verdicts({"state": "interrupted"}, scene, datasets)
    assert [verdict.check for verdict in found] == [
        "Run", "Resolution of wrinkles", "Fibre strain", "Shear angle", "Thickness and packing"
    ]  # fmt: skip
    assert worst_grade(found) == "bad"


def test_damping_says_what_it_makes_of_the_force_of_the_punch(scene, datasets):
    parts = {"force_N": 27.8, "damping_N": 1.13, "inertia_N": -0.34}
    loads = {"punch": {"parts_at_maximum": parts}}
    verdict = judged(scene, datasets, damping_to_external=0.138, punch="punch", tool_loads=loads)
    assert (
        "of the 27.8 N of punch around its maximum damping makes 1.1 N" in verdict["Damping"].text
    )
    assert "inertia -0.34 N" in verdict["Damping"].text


def test_a_snap_is_named_in_verdict_and_warning(scene, datasets):
    snap = {"time_s": 0.16, "travel_m": 0.0712, "force_drop_N": 1.25}
    loads = {"punch": {"snaps": [snap]}, "die": {}}
    words = "under punch: its force falls at a travel of 71.2 mm by 1.2 N"
    verdict = judged(scene, datasets, tool_loads=loads)["Snaps"]
    assert verdict.grade == "doubtful" and words in verdict.text
    assert verdict.remedy_key == "process.time, blank.edge_length"
    (warning,) = snap_warnings(loads, scene)
    assert words in warning and 'process.time = "400 ms"' in warning
    assert "Snaps" not in judged(scene, datasets, tool_loads={"punch": {}})
    # a holder that bounces is no sheet that snaps
    holder = {"holder": {"snaps": [snap]}}
    assert snap_warnings(holder, scene) == []
    assert "Snaps" not in judged(scene, datasets, tool_loads=holder)
    # what falls onto a tool may do so
    falling = driven_by('{ type = "guided", direction = [0, 0, -1], mass = "1 kg" }', "true")
    assert snap_warnings(loads, falling) == []
    assert "Snaps" not in judged(falling, datasets, tool_loads=loads)
