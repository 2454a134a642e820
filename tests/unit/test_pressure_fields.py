"""Pressure fields: what tools press and what bending does, apart and together."""

import itertools
import math

import numpy as np
import pytest

from lcmchain.elements.solid_shell.body import SolidShellBody
from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.fields import (
    FrameSeries,
    model_datasets,
    pressure_fields,
    sheet_areas,
    tool_pressure,
)
from lcmchain.materials.fabric_with_set import FabricWithSet
from lcmchain.materials.law import history_count
from lcmchain.model import build_model
from lcmchain.scene import Element, scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.verification import random_elements

THICKNESS = 1.004e-3

# A plate of 20 g lies on the sheet under 100 N and is damped.
PRESS = """
process = {{ time = "40 ms", mass_damping = "1000 1/s" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }}
contact = {{ friction = {friction}, penalty = "1000 N/mm^3" }}
material = {{ preset = "MD600" }}
element = {{ {element} }}
[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}
[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = ["0 mm", "0 mm", "1.004 mm"]
motion = {{ type = "guided", direction = [0, 0, -1], force = "100 N", mass = "20 g", \
gravity = false, ramp = "10 ms", damping = "20 N*s/m" }}
"""


def flat_body(material, columns=3, rows=2, edge=5e-3):
    text = (
        f'[process]\ntime = "1 s"\n[blank]\nsize = ["{1e3 * edge * columns} mm", '
        f'"{1e3 * edge * rows} mm"]\nedge_length = "{1e3 * edge} mm"\n'
        '[material]\npreset = "MD600"\n'
    )
    mesh = build_model(scene_from_text(text)).only_body().mesh
    return SolidShellBody.build("sheet", mesh, material, Element(), 0, 0)


def homogeneous(angle, thickness, stretch=1.0):
    """Shear with fibres along x and y, the first of which is stretched, and compaction."""
    F = np.diag([stretch, math.cos(angle), thickness / THICKNESS])
    F[0, 1] = math.sin(angle)
    return F


def set_fabric():
    plain = random_elements.md600()
    return FabricWithSet(
        plain.law,
        0.3,
        thickness=plain.thickness,
        areal_mass=plain.areal_mass,
        fibre_density=plain.fibre_density,
        name="with a set",
    )


LAWS = {
    "fabric": random_elements.md600,
    "fabric with a set": set_fabric,
    "isotropic": lambda: random_elements.isotropic(0.3, 1e7),
}


# --- elements -------------------------------------------------------------------------------------


#: Each law, strain and kind of reference once or twice: every combination takes kernels of its own.
COMBINED = {
    ("flat_reference", "fabric", "normal"), ("flat_reference", "isotropic", "director"),
    ("curved_reference", "isotropic", "normal"),
    ("curved_reference", "fabric with a set", "director"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("reference", "law", "strain"),
    [
        pytest.param(*case, marks=[pytest.mark.slow] * (case not in COMBINED))
        for case in itertools.product(
            ["flat_reference", "curved_reference"], LAWS, ["normal", "director"]
        )
    ],
)
def test_contact_is_the_energy_that_a_change_of_the_thickness_takes(law, strain, reference):
    """-dW/dλ / (A t) for a thickness that is scaled along the normal, law by law."""
    rng = np.random.default_rng(5)
    X, fibre = getattr(random_elements, reference)(rng)
    x = random_elements.deformed(rng, X, fibre, stretch=0.05)
    options = ElementOptions(compaction_strain=strain)
    model = random_elements.separate_elements(X[None], fibre[None], LAWS[law](), options)
    body = model.only_body()
    past = after_compaction(body, -0.4)  # compacted further before: nothing is lost on the way

    def energy(nodes):
        return sum(body.stored_energy(random_elements.positions_of(nodes[None]), past))

    director = x[4:] - x[:4]
    base = body.mesh.base_vectors(x)[0]
    normal = np.cross(base[0], base[1])  # of one element: the same at all its nodes
    area, normal = 4.0 * np.linalg.norm(normal), normal / np.linalg.norm(normal)
    thickness = director @ normal
    grown = 0.5 * np.outer(np.tile(thickness, 2) * np.repeat([-1.0, 1.0], 4), normal)
    step = 1e-5
    slope = (energy(x + step * grown) - energy(x - step * grown)) / (2.0 * step)
    found = pressure_fields(body, x, past)["compaction_pressure"]
    np.testing.assert_allclose(found, -slope / (area * thickness.mean()), rtol=1e-6)


@pytest.mark.parametrize(
    ("thickness", "pressure"),
    [(0.9, 0.01688e6), (0.8, 0.05778e6), (0.7, 0.24222e6), (0.65, 0.54152e6), (0.6, 1.25982e6)],
)
def test_flat_compaction_is_all_contact(thickness, pressure):
    body = flat_body(random_elements.md600())
    x = body.mesh.node_positions @ homogeneous(0.0, 1e-3 * thickness).T
    fields = pressure_fields(body, x, body.no_history())
    np.testing.assert_allclose(fields["compaction_pressure"], pressure, rtol=2e-3)
    np.testing.assert_allclose(fields["bending_pressure"], 0.0, atol=1e-9 * pressure)


@pytest.mark.parametrize(
    "law",
    ["fabric", "isotropic", pytest.param("fabric with a set", marks=pytest.mark.slow)],
)
def test_contact_of_a_homogeneous_state_is_the_cauchy_stress(law):
    """λ |S33| per reference area, of the law's own S33, over the present area."""
    material = LAWS[law]()
    body = flat_body(material)
    F = homogeneous(0.4, 0.8e-3, 1.01)
    fields = pressure_fields(body, body.mesh.node_positions @ F.T, body.no_history())
    C = F.T @ F
    strain = 0.5 * np.array(
        [C[0, 0] - 1, C[1, 1] - 1, C[2, 2] - 1, 2 * C[0, 1], 2 * C[1, 2], 2 * C[0, 2]]
    )
    S33 = material.stress_and_tangent(strain)[0][2]
    cauchy = -(F[2, 2] ** 2) * S33 / np.linalg.det(F)
    np.testing.assert_allclose(fields["compaction_pressure"], cauchy, rtol=1e-9)
    np.testing.assert_allclose(fields["bending_pressure"], 0.0, atol=1e-9 * abs(cauchy))


def test_both_parts_together_are_the_pressure_of_the_compaction_law():
    """λ |S33| as of plate-to-plate compaction, in a sheet that is bent and pressed."""
    material = random_elements.md600()
    body = flat_body(material, 6, 2)
    X = body.mesh.node_positions
    radius, h = 0.02, 0.85 * X[:, 2]
    phi = X[:, 0] / radius
    x = np.stack([(radius + h) * np.sin(phi), X[:, 1], (radius + h) * np.cos(phi)], axis=1)
    fields = pressure_fields(body, x, body.no_history())
    half = 0.5 * 5e-3 / radius
    law = material.compaction_pressure(0.85 * math.cos(half)) / (math.sin(half) / half)
    both = fields["compaction_pressure"] + fields["bending_pressure"]
    np.testing.assert_allclose(both, law, rtol=1e-9)
    # the curvature of the fibres alone: λ C11^B (κ h)²/3, with κ of the chord
    curvature = 2.0 * math.sin(half) / 5e-3
    bending = 0.85 * material.law.B11 * (0.5 * THICKNESS * curvature) ** 2 / 3.0
    inside = np.abs(X[body.mesh.elements].mean(axis=1)[:, 0]) < 9e-3  # normals of two chords
    assert inside.sum() == 8
    assert fields["bending_pressure"][inside] == pytest.approx(bending, rel=0.05)


def test_a_sheet_that_is_pulled_apart_has_a_negative_pressure():
    body = flat_body(random_elements.md600())
    x = body.mesh.node_positions @ homogeneous(0.0, 1.1e-3).T
    fields = pressure_fields(body, x, body.no_history())
    assert (fields["compaction_pressure"] < -1e4).all()
    np.testing.assert_allclose(fields["bending_pressure"], 0.0, atol=1e-6)


def test_a_rotation_changes_nothing():
    rng = np.random.default_rng(3)
    body = flat_body(random_elements.md600())
    x = body.mesh.node_positions @ homogeneous(0.3, 0.8e-3).T
    x += 1e-4 * rng.uniform(-1.0, 1.0, x.shape)
    turn = random_elements.rotation(rng)
    one, other = (pressure_fields(body, y, body.no_history()) for y in (x, x @ turn.T + 0.1))
    for name in one:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-8, atol=1e-6, err_msg=name)


def after_compaction(body, strain):
    """The history of a law with a permanent set after a normal strain."""
    history = body.no_history()
    rows = history.reshape(-1, max(body.history_count, 1), 16)
    rows[:, body.history_count - history_count(body.material.law) :] = strain
    return history


def test_the_history_is_used_and_left_as_it_is():
    material = set_fabric()
    body = flat_body(material)
    x = body.mesh.node_positions @ homogeneous(0.0, 0.85e-3).T
    fresh = body.no_history()
    pressed = after_compaction(body, -0.25)
    before = pressed.copy()
    first = pressure_fields(body, x, fresh)["compaction_pressure"]
    later = pressure_fields(body, x, pressed)["compaction_pressure"]
    np.testing.assert_array_equal(pressed, before)
    np.testing.assert_array_equal(fresh, 0.0)
    stretch = 0.85e-3 / THICKNESS
    expected = [material.compaction_pressure(stretch, np.array([k])) for k in (0.0, -0.25)]
    np.testing.assert_allclose(first, expected[0], rtol=1e-9)
    np.testing.assert_allclose(later, expected[1], rtol=1e-9)
    assert expected[1] < 0.7 * expected[0]


# --- tools ----------------------------------------------------------------------------------------


def integral(sheet, name, frame):
    """A node field over the sheet: area of the faces times mean of their nodes."""
    faces = sheet["sheet_face_nodes"].values
    values = sheet[name].values[frame]
    return float(np.sum(sheet_areas(sheet, frame) * values[faces].mean(axis=1)))


@pytest.fixture(scope="module", params=[0.0, 0.3])
def press(request):
    """Snapshots of a sheet between plates, and the groups of its result."""
    scene = scene_from_text(PRESS.format(friction=request.param, element=""))
    simulation = Simulation.from_scene(scene)
    snapshots = [simulation.snapshot()]
    for time in (0.004, 0.007, 0.012, 0.04):
        simulation.advance_to(time)
        snapshots.append(simulation.snapshot())
    frames = FrameSeries.from_snapshots(snapshots, simulation.model.tool_names)
    return snapshots, model_datasets(scene, simulation.model, frames)


def test_the_tool_pressure_adds_up_to_the_tool_force(press):
    """To round-off, while the plates bounce and damp, with friction and without."""
    snapshots, groups = press
    sheet = groups["/"]
    for frame, snapshot in enumerate(snapshots):
        lower, upper = snapshot.tool_force[:, 2]
        for side, force in (("top", upper), ("bottom", -lower)):
            pressed = integral(sheet, f"tool_pressure_{side}", frame)
            assert pressed == pytest.approx(force, rel=1e-12, abs=1e-12)
    assert [s.tool_force[1, 2] > 5.0 for s in snapshots] == [False, True, True, True, True]


def test_a_known_load_presses_with_force_over_area(press):
    _, groups = press
    last = groups["/"].isel(time=-1)
    area = float(sheet_areas(groups["/"], -1).sum())
    for name in ("tool_pressure_top", "tool_pressure_bottom", "compaction_pressure"):
        np.testing.assert_allclose(last[name], 100.0 / area, rtol=1e-4, err_msg=name)
    np.testing.assert_allclose(last["bending_pressure"], 0.0, atol=1.0)
    np.testing.assert_array_equal(groups["/"]["tool_pressure_top"][0], 0.0)


def test_the_nodes_of_the_solid_hold_the_pressure_of_their_face(press):
    _, groups = press
    sheet, solid = groups["/"], groups["/solid"]
    sides = [sheet[f"tool_pressure_{side}"].values for side in ("bottom", "top")]
    np.testing.assert_array_equal(solid["tool_pressure"], np.concatenate(sides, axis=1))
    assert solid["tool_pressure"].attrs["units"] == "Pa"


def test_a_sheet_without_thickness_has_one_tool_pressure():
    scene = scene_from_text(PRESS.format(friction=0.0, element='type = "membrane-shell"'))
    model = build_model(scene)
    X = model.node_positions
    frames = FrameSeries(
        time=np.array([0.0, 1.0]),
        positions=np.stack([X, X @ homogeneous(0.7, THICKNESS).T]),
        tool_travel=np.zeros((2, 2)),
        tool_force=np.zeros((2, 2, 3)),
        tool_names=model.tool_names,
        history=np.empty((2, 0)),
        contact_force=5e4 * np.outer([0.0, 1.0], model.only_body().node_area),
    )
    groups = model_datasets(scene, model, frames)
    sheet = groups["/"]
    assert "tool_pressure_top" not in sheet and "compaction_pressure" not in sheet
    np.testing.assert_array_equal(sheet["tool_pressure"][0], 0.0)
    np.testing.assert_allclose(sheet["tool_pressure"][1], 5e4 / math.cos(0.7), rtol=1e-12)


def test_the_pressure_on_a_sheared_sheet_refers_to_the_present_area():
    body = flat_body(random_elements.md600())
    x = body.mesh.node_positions @ homogeneous(0.7, THICKNESS).T
    pressure = tool_pressure(body, x, body.node_area * 5e4)
    np.testing.assert_allclose(pressure, 5e4 / math.cos(0.7), rtol=1e-12)


# --- bend between closed tools --------------------------------------------------------------------


def closed_bend(radius, gap, edge, time=0.06):
    """A strip bent over a roof of 90 degrees and pressed to ``gap``; lengths in mm."""
    inner, outer, up = radius - 0.5 * gap, radius + 0.5 * gap, gap * math.sqrt(2.0)

    def profile(lift, fillet, solid):
        corners = ((-60, lift - 60), (0, lift), (60, lift - 60))
        points = ", ".join(f'["{x} mm", "{z} mm"]' for x, z in corners)
        return (
            f'{{ type = "extruded_profile", points = [{points}], '
            f'fillet_radii = "0 {fillet} 0 mm", solid = "{solid}" }}'
        )

    apex = -inner * (math.sqrt(2.0) - 1.0)
    scene = scene_from_text(f"""
        process = {{ time = "{time} s", mass_damping = "100 1/s" }}
        blank = {{ size = ["60 mm", "{2 * edge} mm"], edge_length = "{edge} mm", \
height = "{apex + 0.502} mm" }}
        material = {{ preset = "MD600" }}
        [[tools]]
        name = "lower"
        shape = {profile(0.0, inner, "right")}
        [[tools]]
        name = "upper"
        position = ["0 mm", "0 mm", "36 mm"]
        shape = {profile(up, outer, "left")}
        motion = {{ type = "stroke", direction = [0, 0, -1], distance = "36 mm" }}
    """)
    simulation = Simulation.from_scene(scene)
    simulation.advance_to(time)
    return simulation


def test_compaction_in_a_closed_bend_is_what_the_tools_press():
    """10 mm radius, closed to 80 %: within 5 % of the tools, where λ|S33| is half as much again."""
    simulation = closed_bend(10.0, 0.8032, 2.5)
    body, state = simulation.model.only_body(), simulation.state
    x = np.ascontiguousarray(state.position.T)
    fields = pressure_fields(body, x, state.history)
    on_node = tool_pressure(body, x, state.contact_force)
    both_sides = 0.5 * (on_node[: body.mesh.pair_count] + on_node[body.mesh.pair_count :])
    tools = both_sides[body.mesh.faces].mean(axis=1)
    np.testing.assert_allclose(fields["compaction_pressure"], tools, rtol=0.05)
    area = body.mesh.areas(x)
    pressing = float(np.sum(area * fields["compaction_pressure"]))
    assert pressing == pytest.approx(float(np.sum(area * tools)), rel=1e-3)
    centre = body.mesh.mid_surface_positions[body.mesh.faces].mean(axis=1)[:, 0]
    bent, flat = np.abs(centre) < 5e-3, np.abs(centre) > 22e-3
    both = fields["compaction_pressure"] + fields["bending_pressure"]
    assert (both[bent] > 1.4 * tools[bent]).all()
    np.testing.assert_allclose(both[flat], tools[flat], rtol=0.01)
