"""Kinematic draping against exact nets: sphere, plane, cylinder, cone; its order; its invariances.

A pin-jointed net of short bars is a Chebyshev net, ds² = du² + 2 cos ω du dv + dv², whose angle
obeys ω_uv = -K sin ω (Chebyshev 1878; Mack and Taylor 1956). The geodesic curvature of its lines is
-ω_u and -ω_v: on geodesic start lines ω = 90°. On a sphere the equation and these lines are
unchanged by u → c u, v → v/c, so that ω depends on s = u v/R² alone,

    s ω'' + ω' = -sin ω,  ω(0) = π/2,  ω'(0) = -1,

an ordinary differential equation (Painlevé III), solved here to twelve digits. On developable
surfaces K = 0 and there is no shear, however the net lies.
"""

from functools import cache

import numpy as np
import pytest
from draped_tools import CONE, CYLINDER, DOME, ON_CONE, PLATE, RADIUS, SCENE, draped
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from lcmchain.draping import drape
from lcmchain.scene import scene_from_text


@cache
def similarity_solution(largest):
    """ω(s) on the sphere as a function that interpolates to twelve digits."""
    first = 1e-4
    start = [np.pi / 2 - first + first**3 / 18, -1 + first**2 / 6]

    def slope(s, y):
        return [y[1], (-np.sin(y[0]) - y[1]) / s]

    found = solve_ivp(slope, (first, largest), start, method="DOP853", rtol=1e-12, atol=1e-13,
                      dense_output=True)  # fmt: skip
    return lambda s: np.where(s < first, np.pi / 2 - s, found.sol(np.maximum(s, first))[0])


def exact_shear(u, v):
    s = u * v / RADIUS**2
    return np.sign(s) * (np.pi / 2 - similarity_solution(4.0)(np.abs(s)))


def on_sphere(found, centres):
    """Whether faces lie above the equator, at z = -75 mm under the pole."""
    corners = found.positions[found.mesh.elements]
    reach = np.abs(centres).max(axis=1) < RADIUS * np.pi / 2
    return (corners[..., 2] > -75e-3).all(axis=1) & reach


def shear_error(edge, size=200):
    """Return the differences of the shear angle from the exact one above the equator [rad]."""
    found = draped(DOME, size=size, edge=edge)
    centres = found.mesh.node_positions[found.mesh.elements].mean(axis=1)[:, :2]
    above = on_sphere(found, centres)
    assert above.sum() > 0.5 * len(above)
    return (found.shear_angle - exact_shear(*centres.T))[above]


def test_the_sphere_is_draped_as_the_exact_net_up_to_the_equator():
    errors = np.degrees(np.abs(shear_error(5.0)))
    assert errors.max() < 0.5
    assert errors.max() > 1e-6  # it is a net of bars, not the formula


def test_the_error_on_the_sphere_falls_with_the_square_of_the_bars():
    errors = [np.sqrt(np.mean(shear_error(edge, size=120) ** 2)) for edge in (10.0, 5.0, 2.5)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(orders > 1.7), (errors, orders)


def test_the_diagonal_reaches_the_equator_where_the_exact_net_does():
    """Places, not only angles: the diagonal of the net is a great circle of known length."""
    found = draped(DOME, edge=2.5)
    nodes = found.mesh.node_positions
    diagonal = np.isclose(nodes[:, 0], nodes[:, 1]) & (nodes[:, 0] > 0.0)
    polar = np.arctan2(
        np.linalg.norm(found.positions[:, :2], axis=1), found.positions[:, 2] + 75e-3
    )
    above = diagonal & (polar < np.pi / 2)
    omega = similarity_solution(4.0)

    def arc(u):
        return quad(lambda x: 2.0 * np.cos(0.5 * omega(x * x / RADIUS**2)), 0.0, u)[0] / RADIUS

    assert polar[above].max() > np.radians(85.0)
    for node in np.flatnonzero(above)[::4]:
        assert polar[node] == pytest.approx(arc(nodes[node, 0]), rel=5e-4)


def test_bars_keep_their_length():
    found = draped(DOME)
    for axis, lengths in enumerate(found.net_lengths):
        bars = np.linalg.norm(np.diff(found.net_places, axis=axis), axis=-1)
        wanted = lengths[:, None] if axis == 0 else lengths[None, :]
        assert np.nanmax(np.abs(bars / wanted - 1.0)) < 1e-10


def test_a_plane_is_draped_without_shear():
    found = draped(PLATE, angle=27)
    assert np.abs(found.shear_angle).max() < 1e-12
    assert np.allclose(found.positions[:, :2], found.mesh.node_positions[:, :2], atol=1e-12)


@pytest.mark.parametrize("angle", [0, 27, 45])
@pytest.mark.parametrize(("tool", "overrides"), [(CYLINDER, ()), (CONE, ON_CONE)])
def test_developable_surfaces_are_draped_without_shear(tool, overrides, angle):
    """In whatever direction the net begins; the little that bars make of it falls with h²."""
    errors = [
        np.abs(draped(tool, *overrides, size=60, edge=edge, angle=angle).shear_angle).max()
        for edge in (4.0, 2.0)
    ]
    assert np.degrees(errors[1]) < 0.1
    assert errors[1] < 0.3 * errors[0] + 1e-12


def test_a_turned_scene_is_draped_alike():
    """Tool, blank and fibres turned by 25 degrees about z give the same net, turned."""

    def outline(angle):
        x, y = np.array([[-40, 40, 40, -40], [-30, -30, 30, 30]]) * 1e-3
        c, s = np.cos(angle), np.sin(angle)
        corners = np.column_stack([c * x - s * y, s * x + c * y])
        return "[" + ", ".join(f'["{a:.17g} m", "{b:.17g} m"]' for a, b in corners) + "]"

    tool = 'shape = { type = "cone", half_angle = "60 deg", tip_radius = "30 mm" }\naxis = [AXIS]\n'
    found = []
    for turn in (0.0, np.radians(25.0)):
        tilted = f"{0.3 * np.cos(turn)}, {0.3 * np.sin(turn)}, -1"
        text = SCENE.replace('size = ["SIZE mm", "SIZE mm"]', f"outline = {outline(turn)}")
        text = text.replace("EDGE", "5").replace("ANGLE", f"{np.degrees(turn):.17g}")
        found.append(drape(scene_from_text(text + tool.replace("AXIS", tilted))))
    still, turned = (np.sort(np.abs(net.shear_angle)) for net in found)
    assert np.degrees(still.max()) > 1.0
    assert np.allclose(still, turned, atol=1e-9)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    polar=st.floats(0.0, 0.6),
    azimuth=st.floats(0.0, 6.28),
    angle=st.floats(-180.0, 180.0),
    shift=st.floats(-20.0, 20.0),
)
def test_a_sphere_is_the_same_from_every_seed_in_every_direction(polar, azimuth, angle, shift):
    """The exact angle depends on the way from the seed alone, wherever the net begins."""
    place = RADIUS * np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth),
                               np.cos(polar)]) - [0.0, 0.0, 75e-3]  # fmt: skip
    found = draped(
        DOME,
        "draping.place=[" + ", ".join(f'"{x:.17g} m"' for x in place) + "]",
        f'draping.seed=["{shift:.17g} mm", "3 mm"]',
        f"draping.angle={angle:.17g} deg",
        size=60,
    )
    centres = found.mesh.node_positions[found.mesh.elements].mean(axis=1)[:, :2] - found.seed
    assert np.degrees(np.abs(found.shear_angle - exact_shear(*centres.T))).max() < 0.5
    distance = np.linalg.norm(found.positions + [0.0, 0.0, 75e-3], axis=1)
    assert np.allclose(distance, RADIUS, rtol=1e-10)
