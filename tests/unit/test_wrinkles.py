"""Height of wrinkles against surfaces that are known."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lcmchain.fields import FrameSeries, build_datasets, field_summary
from lcmchain.fields.wrinkles import WAVE_PART, longest_wave, wrinkle_height
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.mid_surface import triangulate
from lcmchain.scene import scene_from_text
from lcmchain.tools.table import build_tool_table

SCENE = """
title = "waves"
process = { time = "20 ms" }
blank = { size = ["200 mm", "160 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
[[tools]]
name = "below"
shape = { type = "plate", side = "below" }
[[tools]]
name = "above"
shape = { type = "plate", side = "above" }
position = "0 0 5 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
"""
AMPLITUDE = 1e-3
WAVE = 0.04016  # 40 thicknesses, and 8 edges of 5 mm are 0.04
REACH = WAVE / WAVE_PART


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture(scope="module")
def blank(scene):
    return build_blank(scene.blank, scene.material.thickness)


@pytest.fixture(scope="module")
def tools(scene):
    return build_tool_table(scene.tools, scene.source.directory, scene.process.time)


def bent(blank, surface):
    """Nodes (1, n, 3) of the blank on a surface: middles and unit normals over x and y."""
    x, y, z = blank.node_positions.T
    middles, normals = surface(x, y)
    return (middles + z[:, None] * normals)[None]


def wave(length, angle=0.0, phase=0.0, amplitude=AMPLITUDE):
    """A wave over x turned by an angle; the normals stay upright, which moves no middle."""
    c, s = math.cos(angle), math.sin(angle)

    def surface(x, y):
        z = amplitude * np.cos(2.0 * math.pi * (c * x + s * y) / length + phase)
        return np.stack([x, y, z], axis=1), np.array([0.0, 0.0, 1.0])

    return surface


def cylinder(radius):
    def surface(x, y):
        normal = np.stack([np.sin(x / radius), 0.0 * x, np.cos(x / radius)], axis=1)
        return radius * normal + np.stack([0 * x, y, 0 * x], axis=1), normal

    return surface


def sphere(radius):
    def surface(x, y):
        r = np.hypot(x, y)
        across = np.sin(r / radius) / np.where(r > 0.0, r, 1.0)
        normal = np.stack([across * x, across * y, np.cos(r / radius)], axis=1)
        return radius * normal, normal

    return surface


def inside(blank, depth=REACH):
    """Nodes of the mid-surface farther than a depth from the edge of the blank."""
    x, y, _ = np.abs(blank.mid_surface_positions).T
    return (x < 0.1 - depth + 1e-9) & (y < 0.08 - depth + 1e-9)


# --- smooth sheets have none ----------------------------------------------------------------------


def test_the_default_length_is_eight_edges_and_at_least_forty_thicknesses(scene, blank):
    assert longest_wave(blank) == pytest.approx(WAVE)
    coarse = scene.blank.model_copy(update={"edge_length": 0.01})
    assert longest_wave(build_blank(coarse, scene.material.thickness)) == pytest.approx(0.08)


@pytest.mark.parametrize("perturbation", [0.0, 0.2])
def test_a_flat_sheet_moved_and_sheared_has_no_wrinkles(scene, perturbation):
    blank = build_blank(scene.blank, scene.material.thickness, perturbation=perturbation)
    shear = np.array([[1.0, 0.4, 0.0], [0.4, 1.0, 0.0], [0.0, 0.0, 1.0]])
    turn = Rotation.from_euler("xyz", [40.0, -70.0, 130.0], degrees=True).as_matrix()
    positions = blank.node_positions @ (turn @ shear).T + [0.3, -2.0, 5.0]
    assert np.abs(wrinkle_height(blank, positions[None], WAVE)).max() < 1e-13


def test_a_rigid_motion_does_not_change_the_heights(blank):
    positions = bent(blank, wave(0.035))
    turn = Rotation.from_euler("xyz", [100.0, 20.0, 30.0], degrees=True).as_matrix()
    heights = wrinkle_height(blank, np.concatenate([positions, positions @ turn.T + 1.0]), WAVE)
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-14)
    assert np.abs(heights).max() > 0.9 * AMPLITUDE


@pytest.mark.parametrize("radius", [0.15, 0.3])
@pytest.mark.parametrize(("surface", "part"), [(sphere, 1.0), (cylinder, 0.375)])
def test_smooth_curvature_is_missed_by_the_fourth_power_of_the_reach(blank, surface, part, radius):
    heights = np.abs(wrinkle_height(blank, bent(blank, surface(radius)), WAVE)[0])
    expected = part * REACH**4 / (360.0 * radius**3)
    assert heights[inside(blank)].max() == pytest.approx(expected, rel=0.12)
    assert heights.max() < 12.0 * expected  # at the edges the third power counts
    assert heights.max() < 1e-4


# --- waves ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [6.0, 8.0])
@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0])
@pytest.mark.parametrize("sheet", ["solid", "triangles"])
def test_the_height_of_a_wave_is_its_amplitude(blank, sheet, angle, elements):
    mesh = blank if sheet == "solid" else triangulate(blank)
    surface = wave(0.005 * elements, math.radians(angle))
    heights = wrinkle_height(mesh, bent(mesh, surface), WAVE)[0]
    expected = surface(*blank.mid_surface_positions[:, :2].T)[0][:, 2]
    difference = np.abs(heights - expected)
    assert difference[inside(blank)].max() < 0.06 * AMPLITUDE


def test_waves_that_run_along_an_edge_keep_their_height_there(blank):
    surface = wave(0.04)
    heights = wrinkle_height(blank, bent(blank, surface), WAVE)[0]
    x, y, _ = blank.mid_surface_positions.T
    on_edge = (np.abs(y) > 0.0799) & (np.abs(x) < 0.1 - REACH)
    expected = surface(x, y)[0][:, 2]
    assert np.abs(heights - expected)[on_edge].max() < 0.12 * AMPLITUDE


@pytest.mark.parametrize("elements", [4.0, 6.0, 8.0])
def test_waves_parallel_to_a_free_edge_are_taken_for_curvature_in_part(blank, elements):
    surfaces = [bent(blank, wave(0.005 * elements, 0.0, p)) for p in np.linspace(0, np.pi, 9)]
    heights = np.abs(wrinkle_height(blank, np.concatenate(surfaces), WAVE)).max(axis=0) / AMPLITUDE
    x, y, _ = np.abs(blank.mid_surface_positions).T
    middle = y < 0.0301
    for depth in (0.0, 0.005):
        at_edge = heights[middle & (np.abs(x - 0.1 + depth) < 1e-6)]
        assert 0.35 < at_edge.min() and at_edge.max() < 0.85
    farther_in = heights[middle & (x < 0.0901)]
    assert 0.7 < farther_in.min() and farther_in.max() < 1.1


def test_waves_much_longer_than_the_given_length_are_shape(blank):
    heights = wrinkle_height(blank, bent(blank, wave(0.16)), WAVE)[0]
    assert np.abs(heights[inside(blank)]).max() < 0.1 * AMPLITUDE
    longer = wrinkle_height(blank, bent(blank, wave(0.08)), 0.08)[0]
    x, y, _ = np.abs(blank.mid_surface_positions).T
    assert longer[(x + y) < 0.003].max() == pytest.approx(AMPLITUDE, rel=0.1)


def test_means_over_squares_serve_a_long_reach(blank):
    """With a reach of 21 edges the regression takes means; a wave keeps its height."""
    heights = wrinkle_height(blank, bent(blank, wave(0.08)), 0.08)[0]
    x, y, _ = blank.mid_surface_positions.T
    middle = (np.abs(x) < 0.0301) & (np.abs(y) < 0.0301)
    expected = wave(0.08)(x, y)[0][:, 2]
    assert np.abs(heights - expected)[middle].max() < 0.1 * AMPLITUDE


# --- tools ----------------------------------------------------------------------------------------


def test_a_sheet_that_lies_on_a_tool_has_no_wrinkles_there(blank, tools):
    """Crests count by what has lifted off the plate below, troughs by the one above."""
    half, travel = 0.5 * blank.thickness, np.zeros((1, 2))
    x = blank.mid_surface_positions[:, 0]
    crest, trough = (
        inside(blank) & (np.abs(np.remainder(x + 0.001, 0.04) - 0.001 - at) < 1e-6)
        for at in (0.0, 0.02)
    )

    def heights(lift, travel=travel):
        positions = bent(blank, wave(0.04))
        positions[..., 2] += half + lift
        return wrinkle_height(blank, positions, WAVE, tools=tools, travel=travel)[0]

    lying = heights(AMPLITUDE)  # troughs touch the plate; it is far to the one above
    assert lying[crest] == pytest.approx(AMPLITUDE, rel=0.06)
    assert lying[trough] == pytest.approx(-AMPLITUDE, rel=0.06)
    pressed = heights(-0.7 * AMPLITUDE)  # crests stand 0.3 mm above the plate
    assert pressed[crest] == pytest.approx(0.3 * AMPLITUDE, rel=1e-6)
    # the upper plate, 4 mm above the lower one at the end of its stroke, over a sheet of 1 mm
    under = heights(0.004 - 2 * half + 0.8 * AMPLITUDE, np.array([[0.0, 0.001]]))
    assert under[trough] == pytest.approx(-0.2 * AMPLITUDE, rel=1e-5)
    assert under[crest] == pytest.approx(AMPLITUDE, rel=0.06)


# --- files ----------------------------------------------------------------------------------------


def result(scene, mesh, surface):
    positions = np.concatenate([mesh.node_positions[None], bent(mesh, surface)])
    return build_datasets(
        scene,
        mesh,
        FrameSeries(np.array([0.0, 0.02]), positions, np.zeros((2, 0)), np.zeros((2, 0, 3))),
    )


def test_the_field_is_on_the_nodes_with_its_length_and_in_the_summary(scene, blank):
    datasets = result(scene, blank, wave(0.04))
    field = datasets["/"]["wrinkle_height"]
    assert field.attrs["longest_wave_m"] == pytest.approx(WAVE)
    assert field.attrs["location"] == "node"
    assert np.abs(field.values[0]).max() < 1e-14
    summary = field_summary(datasets)
    assert summary["wrinkle_height_max_m"] == np.abs(field.values[-1]).max()


def test_the_scene_chooses_the_longest_wave(scene, blank):
    chosen = with_length(scene, 0.02)
    field = result(chosen, blank, wave(0.04))["/"]["wrinkle_height"]
    assert field.attrs["longest_wave_m"] == 0.02
    assert np.abs(field.values[-1][inside(blank)]).max() < 0.25 * AMPLITUDE


def with_length(scene, length):
    output = scene.output.model_copy(update={"wrinkle_length": length})
    return scene.model_copy(update={"output": output})


def test_chunks_give_the_same_heights(blank, monkeypatch):
    positions = bent(blank, wave(0.04))
    whole = wrinkle_height(blank, positions, WAVE)
    monkeypatch.setattr("lcmchain.fields.wrinkles.CHUNK", 100)
    np.testing.assert_allclose(wrinkle_height(blank, positions, WAVE), whole, atol=1e-15)


def test_a_strip_of_two_elements_is_flat(scene):
    strip = scene.blank.model_copy(update={"size": (0.1, 0.01)})
    blank = build_blank(strip, scene.material.thickness)
    assert np.abs(wrinkle_height(blank, blank.node_positions[None], WAVE)).max() < 1e-14
