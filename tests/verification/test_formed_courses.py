"""A ply that is laid in courses and formed with forces: strips move by themselves."""

import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.pattern.tables import rim_table
from lcmchain.pipeline import run
from lcmchain.scene import scene_from_text

# A dome of 25 mm radius under two strips that meet over its pole.
SCENE = """
title = "Two strips on a dome"
output = { vtu = false }
[process]
time = "40 ms"
frames = 3
mass_damping = "200 1/s"
[blank]
size = ["100 mm", "100 mm"]
edge_length = "5 mm"
height = "0.502 mm"
courses = { joints = ["0 mm"] }
[material]
preset = "MD600"
[contact]
friction = 0.157
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "25 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "15 mm" }
[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "27 mm", fillet_radius = "6 mm", side = "below" }
[[tools]]
name = "blank-holder"
shape = { type = "plate_with_hole", hole_radius = "27 mm", fillet_radius = "6 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "0.5 kg" }
"""


@pytest.fixture(scope="module")
def formed(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return run(scene_from_text(SCENE), tmp_path_factory.mktemp("strips"))


def test_two_strips_move_as_mirror_images_and_keep_the_energy(formed):
    sheet, energy = formed.datasets["/"], formed.summary["energy"]
    flat, place = reference_positions(sheet)[:, :2], sheet_positions(sheet)
    numbers, faces = sheet["course"].values[-1], sheet_faces(sheet)
    strips = [np.unique(faces[numbers == number]) for number in (0, 1)]
    away, image = cKDTree(flat[strips[1]]).query(flat[strips[0]] * [1.0, -1.0])
    assert away.max() < 1e-12
    mirrored = place[strips[0]] * [1.0, -1.0, 1.0]
    assert np.abs(mirrored - place[strips[1]][image]).max() < 1e-8
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]


def test_the_joint_opens_over_the_pole_and_its_ends_slide_into_each_other(formed):
    """Each strip shears by itself; a ply of one piece would hold them together.

    Over the pole fibres across the joint would be stretched, at the rim they would be pressed.
    """
    gap = formed.datasets["/"]["joint_gap"].values[-1]
    nodes = np.flatnonzero(np.isfinite(gap))
    x = reference_positions(formed.datasets["/"])[nodes, 0]
    gap = gap[nodes][np.argsort(x)]
    assert len(gap) == 21 and np.argmax(gap) == 10
    assert 7e-3 < gap.max() < 9.5e-3  # 8.2 mm, and 8.3 mm with elements half as long
    assert -3.5e-3 < gap.min() < -2e-3 and np.argmin(gap) in (0, 20)
    assert np.allclose(gap, gap[::-1], atol=1e-7)
    (joint,) = formed.summary["joints"]
    assert joint["gap_max_m"] == gap.max() and joint["gap_min_m"] == gap.min()
    told = [text for text in formed.summary["warnings"] if "courses slide into each other" in text]
    assert len(told) == 1 and "strip_1 and strip_2 overlap by up to 2." in told[0]
    assert not any("passes through itself" in text for text in formed.summary["warnings"])


def test_a_result_in_courses_has_its_picture_and_no_one_rim(formed):
    assert (formed.folder / "courses.png").is_file()
    with pytest.raises(InputError, match="several courses"):
        rim_table(formed.datasets["/"])


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["courses", "slits"])
def test_plies_on_each_other_that_are_cut_alike_rest_and_are_formed(tmp_path, cut):
    """Points beside a cut that took the other lip for their rim were let go and caught again."""
    text = SCENE.replace("1.004 mm", "2.008 mm")
    if cut == "slits":
        slit = 'slits = [[["-50 mm", "0 mm"], ["40 mm", "0 mm"]]]'
        text = text.replace('courses = { joints = ["0 mm"] }', slit)
    two = 'layup = "[0/90, 0/90]"\n' + text + "\n[[interfaces]]\nfriction = 0.2\n"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = run(scene_from_text(two, overrides=["output.pictures=false"]), tmp_path)
    energy = result.summary["energy"]
    assert result.summary["state"] == "complete"
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]
    assert energy["kinetic"] < 1e-2 * energy["internal"]
