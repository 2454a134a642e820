"""Pressures on regions and on the faces of named plies: resultants, shares, tables, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.effects.face_pressure import (
    FacePressure,
    RegionalPressure,
    face_forces,
    face_frequencies,
    present_pressures,
    regional_forces,
)
from lcmchain.effects.switches import effects_of
from lcmchain.elements.blocks import LANES
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

SHEET = """
process = { time = "2 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""
STACK = """
process = { time = "2 ms" }
material = { preset = "MD600" }
plies = [
    { name = "film", size = ["30 mm", "20 mm"], edge_length = "5 mm" },
    { name = "patch", size = ["10 mm", "10 mm"], edge_length = "5 mm" },
    { name = "top", size = ["30 mm", "30 mm"], edge_length = "5 mm" },
]
"""


CROSSED = [["0 mm", "0 mm"], ["5 mm", "5 mm"], ["5 mm", "0 mm"], ["0 mm", "5 mm"]]


def entry(**given):
    given = {"name": "bag", "face": "top", "value": "0.1 MPa", "ramp": "0 ms"} | given
    text = ", ".join(f"{key} = {value!r}".replace("'", '"') for key, value in given.items())
    return f"{{ {text} }}"


def model_of(*entries, text=SHEET):
    scene = scene_from_text(text, overrides=[f"pressure=[{', '.join(entries)}]"])
    return build_model(scene)


def forces(model, time=1.0, position=None):
    """Forces on the nodes (3, N) [N]."""
    x = model.node_positions.T.copy() if position is None else position
    load = np.zeros(model.corner_force_size)
    table = model.face_pressure
    if isinstance(table, FacePressure):
        bottom, top = (np.interp(time, table.times, side) for side in (table.bottom, table.top))
        face_forces(table.elements, x, bottom, top, None, load)
    else:
        now = present_pressures(table, time)
        regional_forces(table.elements, x, now, table.share, None, load)
    slot = model.nodes.force_slot
    return np.stack([load[slot + d * LANES].sum(axis=0) for d in range(3)])


PLACES = {
    "along edges of elements": ({"box": ["-10 -5 -1 mm", "5 5 1 mm"]}, 15e-3 * 10e-3),
    "through elements": ({"box": ["-9 -4 -1 mm", "3 4 1 mm"]}, 12e-3 * 8e-3),
    "beyond the sheet": ({"box": ["0 -50 -1 mm", "90 50 1 mm"]}, 15e-3 * 20e-3),
    "polygon": (
        {"polygon": [["0 mm", "0 mm"], ["9 mm", "0 mm"], ["0 mm", "7 mm"]]},
        0.5 * 9e-3 * 7e-3,
    ),
    "disc": ({"point": "1 2 0 mm", "radius": "6 mm"}, np.pi * 6e-3**2),
}


@pytest.mark.parametrize("place", PLACES)
def test_the_force_is_pressure_times_the_area_of_the_region(place):
    given, area = PLACES[place]
    model = model_of(entry(**given))
    force = forces(model)
    np.testing.assert_allclose(force.sum(axis=1), [0.0, 0.0, -1e5 * area], atol=1e-10)
    # whole and empty elements to the last digit: their share is 1 and 0
    share = model.face_pressure.entry_shares[0, 1]
    centre = model.only_body().mesh.mid_surface_positions[model.only_body().mesh.faces].mean(axis=1)
    if place == "along edges of elements":
        inside = (np.abs(centre[:, 0] + 2.5e-3) < 7.5e-3) & (np.abs(centre[:, 1]) < 5e-3)
        np.testing.assert_array_equal(share[model.face_pressure.elements.place], inside)
    assert not model.face_pressure.entry_shares[0, 0].any()


def test_a_region_over_all_is_the_pressure_on_the_whole_face():
    whole = model_of(entry(face="both"))
    region = model_of(entry(face="both", box=["-1 -1 -1 m", "1 1 1 m"]))
    assert isinstance(whole.face_pressure, FacePressure)
    assert isinstance(region.face_pressure, RegionalPressure)
    rng = np.random.default_rng(0)
    x = whole.node_positions.T + rng.uniform(-3e-4, 3e-4, (3, whole.node_count))
    x = np.ascontiguousarray(x)
    np.testing.assert_allclose(
        forces(region, position=x), forces(whole, position=x), rtol=1e-13, atol=1e-18
    )
    assert region.face_pressure.largest == whole.face_pressure.largest


def test_regions_have_tables_of_their_own():
    """Two pressures on halves, one that comes as the other goes; the bound takes the largest."""
    left = entry(box=["-15 -10 -1 mm", "0 10 1 mm"], name="left")
    left = left.replace(
        'value = "0.1 MPa", ramp = "0 ms"', 'times = "0 1 ms", values = "0.2 0 MPa"'
    )
    right = entry(box=["0 -10 -1 mm", "15 10 1 mm"], name="right")
    right = right.replace(
        'value = "0.1 MPa", ramp = "0 ms"', 'times = "0.5 2 ms", values = "0 -0.3 MPa"'
    )
    model = model_of(left, right)
    x = model.node_positions[:, 0]
    for time, pressures in ((0.25e-3, (0.15e6, 0.0)), (1.25e-3, (0.0, -0.15e6))):
        force = forces(model, time)[2]
        sums = force[x < -1e-9].sum(), force[x > 1e-9].sum()
        area = 15e-3 * 20e-3 - 0.5 * 5e-3 * 20e-3  # but the nodes on the border
        assert sums == pytest.approx([-p * area for p in pressures], abs=1e-9)
        assert model.face_pressure.size_at(time) == pytest.approx(max(map(abs, pressures)))
    peak = model.face_pressure.peak[model.face_pressure.elements.place]
    centre = model.only_body().mesh.mid_surface_positions[model.only_body().mesh.faces].mean(axis=1)
    np.testing.assert_allclose(peak, np.where(centre[:, 0] < 0.0, 0.2e6, 0.3e6))
    found = np.empty(model.face_pressure.elements.padded_count)
    face_frequencies(model.face_pressure.elements, model.node_positions.T.copy(), 1.0, found)
    assert (found * model.face_pressure.peak).max() < (found * 0.31e6).max()
    reasons = [e.reason for e in effects_of(model) if e.name.startswith("pressure")]
    assert reasons[1] == "-0.3 to 0 MPa over the process, on 12 faces"


def test_the_named_ply_of_unlike_plies_is_pressed():
    """Also where another ply lies on its face: contact between them is the scene's affair."""
    model = model_of(entry(ply="film", face="both"), entry(ply="top", name="cover"), text=STACK)
    film, patch, top = model.bodies
    force = forces(model)
    of = {
        body.name: force[2, body.first_node : body.first_node + body.mesh.node_count]
        for body in model.bodies
    }
    pairs = film.mesh.pair_count
    assert of["film"][:pairs].sum() == pytest.approx(1e5 * 30e-3 * 20e-3)
    assert of["film"][pairs:].sum() == pytest.approx(-1e5 * 30e-3 * 20e-3)
    assert not of["patch"].any()
    assert of["top"].sum() == pytest.approx(-1e5 * 30e-3 * 30e-3)
    assert not of["top"][: top.mesh.pair_count].any()


@pytest.mark.parametrize(
    ("entries", "text", "message"),
    [
        ([entry()], STACK, r'pressure\[0\] "bag": acts on the outer faces .* name the ply'),
        ([entry(ply="flim")], STACK, r'"bag".ply: is "flim", but there is no such ply'),
        ([entry(box=["50 0 -1 mm", "60 5 1 mm"])], SHEET, r"holds no part of the sheet \(box"),
        ([entry(box=["0 0 2 mm", "6 5 3 mm"])], SHEET, r"and its height is 0 mm"),
        ([entry(box=["5 0 -1 mm", "5 5 1 mm"])], SHEET, "has no area"),
        ([entry(point="0 0 0 mm")], SHEET, r"radius: is missing: a pressure acts on an area"),
        ([entry(rim=True).replace("True", "true")], SHEET, "rim: names no area of the sheet"),
        (
            [entry(polygon=CROSSED)],
            SHEET,
            "polygon: crosses itself",
        ),
    ],
)  # fmt: skip
def test_what_is_no_region_is_refused(entries, text, message):
    with pytest.raises(InputError, match=message):
        model_of(*entries, text=text)
