"""Nets that begin sheared or along a steered line, against exact nets.

On developable surfaces K = 0, so that ω_uv = 0: a net that begins with an angle between geodesics
keeps it everywhere, and on a plane x(u, v) = A(u) + B(v), whatever both start lines are. On a
sphere two geodesics under ω0 give a function of s = u v/R² alone,

    s ω'' + ω' = -sin ω,  ω(0) = ω0,  ω'(0) = -sin ω0.
"""

import numpy as np
import pytest
from draped_tools import CONE, CYLINDER, DOME, ON_CONE, PLATE, PRE_SHEAR, RADIUS, draped, text_of
from scipy.integrate import solve_ivp

from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

SHEARED = np.radians(20.0)


def shear_on_sphere(begin, u, v):
    """Return the exact shear angle of a net that begins with a shear angle at the pole [rad]."""
    omega = np.pi / 2 - begin

    def slope(s, y):
        return [y[1], (-np.sin(y[0]) - y[1]) / s]

    s = u * v / RADIUS**2
    found = np.full(s.shape, np.nan)
    for sign, start in ((1.0, omega), (-1.0, np.pi - omega)):  # ω(-s) = π - that of π - ω0
        first = 1e-6
        curve = solve_ivp(
            slope, (first, 2.0), [start - np.sin(start) * first, -np.sin(start)],
            method="DOP853", rtol=1e-11, atol=1e-12, dense_output=True,
        )  # fmt: skip
        here = sign * s > 0.0
        angle = curve.sol(np.maximum(np.abs(s[here]), first))[0]
        found[here] = sign * (np.pi / 2 - angle)
    return found


def line(points):
    rows = ", ".join("[" + ", ".join(f'"{x:.17g} m"' for x in point) + "]" for point in points)
    return f"draping.start_line=[{rows}]"


def centres(found):
    return found.mesh.node_positions[found.mesh.elements].mean(axis=1)[:, :2] - found.seed


# --- pre-shear ------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0, 27])
def test_a_plane_keeps_the_shear_that_the_net_begins_with(angle):
    found = draped(PLATE, PRE_SHEAR, size=60, angle=angle)
    assert np.allclose(found.shear_angle, SHEARED, atol=1e-12)
    first, second = (np.radians(angle), np.radians(angle + 70.0))
    axes = np.array([[np.cos(a), np.sin(a)] for a in (first, second)])
    flat = found.mesh.node_positions[:, :2] - found.seed
    fibres = np.array([[np.cos(first), np.sin(first)], [-np.sin(first), np.cos(first)]])
    assert np.allclose(found.positions[:, :2] - found.seed, flat @ fibres.T @ axes, atol=1e-12)


@pytest.mark.parametrize(("tool", "overrides"), [(CYLINDER, ()), (CONE, ON_CONE)])
def test_developable_surfaces_keep_it_too(tool, overrides):
    errors = [
        np.abs(draped(tool, *overrides, PRE_SHEAR, size=60, edge=e).shear_angle - SHEARED).max()
        for e in (4.0, 2.0)
    ]
    assert np.degrees(errors[1]) < 0.15
    assert errors[1] < 0.3 * errors[0] + 1e-12


def test_the_sphere_is_the_exact_net_of_any_angle_at_the_pole():
    errors = []
    for edge in (5.0, 2.5):
        found = draped(DOME, PRE_SHEAR, size=100, edge=edge)
        wrong = found.shear_angle - shear_on_sphere(SHEARED, *centres(found).T)
        errors.append(np.sqrt(np.mean(wrong**2)))
    assert np.degrees(errors[0]) < 0.05
    assert np.log2(errors[0] / errors[1]) > 1.7
    assert np.degrees(np.abs(found.shear_angle - SHEARED).max()) > 15.0  # it does not stay as it is


def test_a_net_sheared_the_other_way_is_mirrored_about_fibre_1():
    there, back = draped(DOME, PRE_SHEAR), draped(DOME, "draping.pre_shear=-20 deg")
    mirrored = back.positions * [1.0, -1.0, 1.0]
    nodes = there.mesh.node_positions
    twin = [
        int(np.argmin(np.linalg.norm(nodes[:, :2] - node[:2] * [1.0, -1.0], axis=1)))
        for node in nodes[::37]
    ]
    assert np.allclose(there.positions[::37], mirrored[twin], atol=1e-9)


# --- steered start line ---------------------------------------------------------------------------

BEND = 80e-3


def arc(way):
    """Return points of an arc in the plate's mid-surface, to the left, at lengths of it [m]."""
    turn = np.asarray(way) / BEND
    return np.column_stack(
        [BEND * np.sin(turn), BEND * (1.0 - np.cos(turn)), np.full(np.size(way), 0.5e-3)]
    )


def test_on_a_plane_fibres_follow_the_given_arc():
    """Nodes lie on the arc a chord apart, and all lines along fibre 1 are the same arc, shifted."""
    found = draped(PLATE, line(arc(np.linspace(-35e-3, 35e-3, 29))), size=60, edge=2.0)
    flat = found.mesh.node_positions - [*found.seed, 0.0]
    turn = 2.0 * np.arcsin(1e-3 / BEND)  # of one bar, the chord of 2 mm
    at = flat[:, 0] / 2e-3 * turn
    places = np.column_stack([BEND * np.sin(at), BEND * (1.0 - np.cos(at)) + flat[:, 1]])
    assert np.abs(flat[:, 0]).max() == pytest.approx(30e-3)
    assert np.allclose(found.positions[:, :2], places, atol=2e-8)
    assert np.allclose(found.shear_angle, centres(found)[:, 0] / 2e-3 * turn, atol=1e-5)


def test_a_line_along_a_geodesic_gives_the_net_without_it():
    """A great circle of the dome through the pole, for fibres in x."""
    turn = np.linspace(-0.8, 0.8, 33)
    great = RADIUS * np.column_stack([np.sin(turn), 0.0 * turn, np.cos(turn)]) - [0, 0, 75e-3]
    steered, free = draped(DOME, line(great), size=60), draped(DOME, size=60)
    assert np.allclose(steered.positions, free.positions, atol=1e-8)


def test_beyond_its_ends_the_line_goes_on_straight():
    found = draped(PLATE, line(arc(np.linspace(-9e-3, 9e-3, 19))), size=60, edge=2.0)
    ends = np.degrees(np.abs(found.shear_angle[np.abs(centres(found)[:, 0]) > 12e-3]))
    assert np.ptp(ends) < 1e-9
    # the bars from -8 to 8 mm are chords: the last one turns by 3.5 bars from the middle
    assert ends[0] == pytest.approx(3.5 * np.degrees(2.0 * np.arcsin(1e-3 / BEND)), abs=1e-3)


def test_the_seed_comes_to_lie_on_the_line_and_fibre_2_across_it():
    points = arc(np.linspace(-40e-3, 40e-3, 33))
    found = draped(
        PLATE, line(points), 'draping.place=["20 mm", "30 mm", "0 mm"]', "draping.pre_shear=15 deg",
        size=20, edge=2.0,
    )  # fmt: skip
    away = [20e-3, 30e-3 - BEND]
    nearest = BEND * np.array(away) / np.linalg.norm(away) + [0.0, BEND]
    assert np.allclose(found.place[:2], nearest, atol=1e-7)
    along_2 = found.net_places[found.net_places.shape[0] // 2]
    direction = (along_2[-1] - along_2[0])[:2] / np.linalg.norm(along_2[-1] - along_2[0])
    tangent = np.array([-away[1], away[0]]) / np.linalg.norm(away)
    assert direction @ tangent == pytest.approx(np.sin(np.radians(15.0)), abs=1e-6)


@pytest.mark.parametrize(
    ("entries", "key", "words"),
    [
        (["draping.pre_shear=89 deg"], "draping.pre_shear", "above -89 and below 89 deg"),
        (["draping.pre_shear=20"], "draping.pre_shear", "has no unit"),
        (['draping.start_line=[["0 mm", "0 mm", "0 mm"]]'], "draping.start_line", "at least 2"),
        (
            [line(arc([0.0, 1e-2])), "draping.angle=5 deg"],
            "draping.angle",
            "direction start_line gives",
        ),
    ],
)
def test_wrong_entries_are_refused_by_name(entries, key, words):
    with pytest.raises(InputError, match=words) as error:
        scene_from_text(text_of(PLATE, size=60), overrides=entries)
    assert key in f"{error.value}"


def test_points_that_are_one_are_refused():
    with pytest.raises(InputError, match="two points that are one"):
        draped(PLATE, line([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3], [0.02, 0.0, 0.0]]), size=60)
