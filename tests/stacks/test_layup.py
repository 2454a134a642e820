"""The short form of a stack."""

import math

import pytest

from lcmchain.scene.plies import MOST_PLIES, LayupError, angles_of


def degrees(code):
    return [round(math.degrees(angle), 9) for angle in angles_of(code)]


@pytest.mark.parametrize(
    ("code", "angles"),
    [
        ("[0/90]", [0]),
        ("[0/90, 45/-45]", [0, 45]),
        ("[0/90, 45/-45]s", [0, 45, 45, 0]),
        ("[0/90, 45/-45]2", [0, 45, 0, 45]),
        ("[0/90, 45/-45]2s", [0, 45, 0, 45, 45, 0, 45, 0]),
        ("[0/90, 45/-45]_2S", [0, 45, 0, 45, 45, 0, 45, 0]),
        ("[(0/90)/(45/-45)]s", [0, 45, 45, 0]),
        ("[(0/90)_2/(±45)]", [0, 0, 45]),
        ("[0, 30, -60]", [0, 30, -60]),
        ("[90/0, -45/45]", [90, -45]),
        ("[22.5_3]", [22.5, 22.5, 22.5]),
        (" [ +-45 , 0/90 ] s ", [45, 0, 0, 45]),
        ("[0°/90°, −45°/45°]", [0, -45]),
    ],
)
def test_a_code_says_the_angle_of_every_ply_from_below(code, angles):
    assert degrees(code) == angles


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("[]", "has no plies"),
        ("[ ]s", "has no plies"),
        ("0/90", "no stack of plies"),
        ("[0/90", "no stack of plies"),
        ("[0/90]t", "no stack of plies"),
        ("[0/45]", "at 90 deg to each other"),
        ("[±30]", "at 90 deg to each other"),
        ("[0/90/45]", "a comma stands between plies"),
        ("[0,,90]", "neither an angle nor"),
        ("[a]", "neither an angle nor"),
        ("[±45/0]", "write ±45 or 45/-45"),
        ("[0]0", "no times"),
        ("[0_0]", "no times"),
        (f"[0]{MOST_PLIES + 1}", f"at most {MOST_PLIES}"),
        (f"[0_{MOST_PLIES}, 0_{MOST_PLIES}]9999s", f"at most {MOST_PLIES}"),
    ],
)
def test_what_is_no_stack_is_refused(code, words):
    with pytest.raises(LayupError, match=words):
        angles_of(code)
