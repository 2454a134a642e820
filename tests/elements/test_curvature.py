"""The curvature shared with neighbours: the thickness of bent elements, and what it must not do."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.blocks import LANES, from_blocks
from lcmchain.elements.solid_shell.energies import strain_energies
from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.elements.solid_shell.tangent import linearise, node_stiffness
from lcmchain.fields.derived import derive_fields
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.hexahedron import bend_part, edge_neighbours
from lcmchain.model import assemble_model
from lcmchain.verification.random_elements import (
    corner_forces,
    md600,
    positions_of,
    random_curvature,
    separate_elements,
    shared_history,
)

THICKNESS = 1.004e-3
EDGE = 5e-3
COUNT = 5


@pytest.fixture
def batch(make):
    """Deformed elements that share no node, with random curvatures of neighbours."""

    def build(shape, **options):
        rng = np.random.default_rng(41)
        reference = make.flat_reference if shape == "flat" else make.curved_reference
        X, fibres = map(np.array, zip(*(reference(rng) for _ in range(COUNT))))
        x = np.array([make.deformed(rng, *element) for element in zip(X, fibres)])
        options = ElementOptions(**options)
        model = separate_elements(X, fibres, md600(), options)
        curvature = random_curvature(rng, model)
        references = [
            ReferenceElement(*element, md600(), options, c)
            for *element, c in zip(X, fibres, curvature)
        ]
        return model, x, references, shared_history(model, curvature)

    return build


def sheet(positions, options=None, fibre=(1.0, 0.0, 0.0)):
    """A model of a grid of node pairs: positions (2, n1, n2, 3) of the lower and upper face."""
    _, n1, n2, _ = positions.shape
    number = np.arange(n1 * n2).reshape(n1, n2)
    face = np.stack(
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=2
    ).reshape(-1, 4)
    elements = np.hstack([face, face + n1 * n2])
    fibres = np.tile(fibre, (len(elements), 1))
    blank = BlankMesh(positions.reshape(-1, 3), elements, fibres, fibres, THICKNESS)
    template = separate_elements(positions_of_cube(), [[1.0, 0.0, 0.0]], md600(), ElementOptions())
    return assemble_model(
        blank,
        md600(),
        options or ElementOptions(),
        tools=template.tools,
        tool_names=(),
        contact=CONTACT,
        process=PROCESS,
    )


class CONTACT:
    penalty, tangential_ratio, damping_ratio = 1e9, 0.5, 0.0


class PROCESS:
    mass_damping, gravity, time, frames, step_safety = 0.0, False, 1.0, 2, 0.9
    mass_scaling = None


def positions_of_cube():
    from lcmchain.verification.random_elements import CUBE

    return 0.5e-3 * CUBE[None]


def cylinder(turn, n1=7, n2=4, twist=0.0):
    """Node pairs (2, n1, n2, 3) of a strip whose directors turn by ``turn`` per element."""
    radius = 0.5 * EDGE / np.sin(0.5 * turn)
    angle, y = np.meshgrid(
        (np.arange(n1) - 0.5 * (n1 - 1)) * turn, EDGE * np.arange(n2), indexing="ij"
    )
    direction = np.stack([np.sin(angle), np.zeros_like(y), np.cos(angle)], axis=-1)
    middle = radius * direction + np.stack([0 * y, y, 0 * y], axis=-1)
    return np.stack([middle - 0.5 * THICKNESS * direction, middle + 0.5 * THICKNESS * direction])


def flat(n1=7, n2=4):
    x, y = np.meshgrid(EDGE * np.arange(n1), EDGE * np.arange(n2), indexing="ij")
    middle = np.stack([x, y, np.zeros_like(x)], axis=-1)
    up = np.array([0.0, 0.0, 0.5 * THICKNESS])
    return np.stack([middle - up, middle + up])


def compaction(model, positions, renewed=True):
    """E33 of the elements at positions (2, n1, n2, 3), and the history."""
    x = positions_of(positions)
    history = np.zeros(model.history_size)
    if renewed:
        model.renew(x, history)
    padded = model.history_size // model.only_body().history_count
    strain, bending, hourglass = np.empty((padded, 6)), np.empty(padded), np.empty(padded)
    strain_energies(model.only_body().data, x, history, strain, bending, hourglass)
    return strain[: model.element_count, 2], history


@pytest.mark.parametrize("shape", ["flat", "curved"])
def test_kernel_and_reference_element_agree(batch, shape):
    model, x, references, history = batch(shape)
    forces = corner_forces(model, positions_of(x), history)
    for force, reference, nodes in zip(forces, references, x):
        expected = reference.evaluate(nodes).force
        np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-12 * abs(expected).max())
    without = corner_forces(model, positions_of(x))
    assert abs(forces - without).max() > 1e-4 * abs(without).max()


@pytest.mark.parametrize("shape", ["flat", "curved"])
def test_forces_derive_from_the_energy(batch, shape):
    _, x, references, _ = batch(shape, in_plane_shear_hourglass=False)
    step = 2e-4 * THICKNESS
    for nodes, reference in zip(x[:2], references):
        expected = np.zeros(24)
        for i, dx in enumerate(step * np.eye(24).reshape(24, 8, 3)):
            energy = [
                result.energy + result.hourglass_energy
                for result in (reference.evaluate(nodes + k * dx) for k in (-2, -1, 1, 2))
            ]
            expected[i] = (8 * (energy[2] - energy[1]) - (energy[3] - energy[0])) / (12 * step)
        force = reference.evaluate(nodes).force.ravel()
        np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-6 * abs(expected).max())


@pytest.mark.parametrize("shape", ["flat", "curved"])
def test_tangent_is_the_derivative_of_the_forces(batch, shape):
    model, x, _, history = batch(shape)
    displacement = (x - model.only_body().mesh.node_positions.reshape(x.shape)).reshape(-1, 3).T
    K = node_stiffness(linearise(model, displacement, history=history).stiffness)
    step = 1e-3 * model.only_body().geometry.height.min()
    for i in range(0, 24, 5):
        move = np.zeros((8, 3))
        move.flat[i] = step
        near, far = (
            corner_forces(model, positions_of(x + k * move), history)
            - corner_forces(model, positions_of(x - k * move), history)
            for k in (1, 2)
        )
        expected = ((8 * near - far) / (12 * step)).reshape(-1, 24)
        scale = abs(K).max(axis=(1, 2))[:, None]
        np.testing.assert_allclose(K[:, :, i] / scale, expected / scale, rtol=0.0, atol=1e-7)


def test_neighbours_lie_across_the_edges():
    number = np.arange(12).reshape(4, 3)
    face = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=2)
    elements = np.hstack([face.reshape(-1, 4), face.reshape(-1, 4) + 12])
    # elements: 0 1 / 2 3 / 4 5 along ξ (rows) and η
    plus_xi, minus_xi, plus_eta, minus_eta = edge_neighbours(elements)
    assert plus_xi.tolist() == [2, 3, 4, 5, -1, -1]
    assert minus_xi.tolist() == [-1, -1, 0, 1, 2, 3]
    assert plus_eta.tolist() == [1, -1, 3, -1, 5, -1]
    assert minus_eta.tolist() == [-1, 0, -1, 2, -1, 4]
    collapsed = elements.copy()
    collapsed[0, [1, 5]] = collapsed[0, [0, 4]]  # the edge at η = -1 has no length
    assert edge_neighbours(collapsed)[3, 0] == -1
    assert edge_neighbours(collapsed)[2, 0] == 1


@pytest.mark.parametrize("degrees", [5.0, 15.0, 28.6])
@pytest.mark.parametrize("twisted", [False, True])
def test_a_bent_sheet_keeps_its_thickness(degrees, twisted):
    """The chord of an element would lose 1 - cos(φ/2): 3 % of the thickness at 28.6°."""
    turn = np.radians(degrees)
    model = sheet(flat())
    bent = cylinder(turn)
    if twisted:  # the axes of the elements need not follow the curvature
        u, v = np.meshgrid(np.arange(7) - 3.0, np.arange(4) - 1.5, indexing="ij")
        along, across = EDGE * (u + v) / np.sqrt(2), EDGE * (v - u) / np.sqrt(2)
        radius = 0.5 * EDGE / np.sin(0.5 * turn)
        angle = along / radius
        direction = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
        middle = radius * direction + np.stack([0 * angle, across, 0 * angle], axis=-1)
        bent = np.stack(
            [middle - 0.5 * THICKNESS * direction, middle + 0.5 * THICKNESS * direction]
        )
    chord, _ = compaction(model, bent, renewed=False)
    shared, _ = compaction(model, bent)
    loss = 1.0 - np.cos(0.5 * turn) ** 2
    if not twisted:
        np.testing.assert_allclose(chord, -0.5 * loss, rtol=1e-9)
    # at the free ends the curvature is that of the last two elements
    assert abs(shared).max() < 0.005 * abs(chord).max() + 0.05 * turn**4


def skewed_cylinder(radius, skew):
    """Parallelograms whose rows are shifted by ``skew`` edges, on a cylinder of arcs of 5 mm."""
    u, v = np.meshgrid(np.arange(9) - 4.0, np.arange(7) - 3.0, indexing="ij")
    angle = EDGE * (u + skew * v) / radius
    direction = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    middle = radius * direction + np.stack([0 * angle, EDGE * v, 0 * angle], axis=-1)
    return np.stack([middle - 0.5 * THICKNESS * direction, middle + 0.5 * THICKNESS * direction])


@pytest.mark.parametrize(
    ("skew", "radius", "error"),
    [
        (0.0, 0.05, 1.1e-10), (0.0, 0.02, 7e-10), (0.0, 0.01, 3e-9), (0.0, 0.005, 8e-4),
        (0.5, 0.05, 8e-7), (0.5, 0.02, 3e-5), (0.5, 0.01, 5e-4), (0.5, 0.005, 1.1e-2),
    ],
)  # fmt: skip
def test_rectangles_keep_their_thickness_on_an_arc_and_skewed_elements_nearly(skew, radius, error):
    """The figures of the manual's page on departures."""
    positions = skewed_cylinder(radius, skew)
    number = np.arange(63).reshape(9, 7)
    face = np.stack(
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=2
    ).reshape(-1, 4)
    fibres = np.tile([1.0, 0.0, 0.0], (len(face), 1))
    blank = BlankMesh(
        positions.reshape(-1, 3), np.hstack([face, face + 63]), fibres, fibres, THICKNESS
    )
    base = blank.base_vectors(blank.node_positions)
    normal = np.cross(base[:, 0], base[:, 1])
    chord = np.sum(base[:, 2] * normal, axis=1) / np.linalg.norm(normal, axis=1)
    thickness = 2.0 * np.sqrt(chord**2 + blank.initial_bend_part)
    assert abs(thickness / THICKNESS - 1.0).max() == pytest.approx(error, rel=0.2)


def test_alternating_tilt_of_a_flat_sheet_stays_compaction():
    """Else pressure would tilt the directors (manual: departures)."""
    model = sheet(flat())
    tilted = flat()
    tilt = 0.3 * (-1.0) ** np.arange(7)[:, None] * np.ones(4)
    director = 0.5 * THICKNESS * np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=-1)
    middle = 0.5 * (tilted[0] + tilted[1])
    tilted = np.stack([middle - director, middle + director])
    chord, _ = compaction(model, tilted, renewed=False)
    shared, history = compaction(model, tilted)
    np.testing.assert_allclose(shared, chord, rtol=1e-12)
    np.testing.assert_allclose(chord, 0.5 * (np.cos(0.3) ** 2 - 1.0), rtol=1e-9)
    assert abs(from_blocks(history, 4, model.element_count)).max() < 1e-6


def test_alternating_warping_of_the_mid_surface_shares_no_curvature_inside():
    model = sheet(flat(9, 9))
    i, j = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    warped = flat(9, 9)
    warped[..., 2] += 0.2e-3 * (-1.0) ** i
    _, history = compaction(model, warped)
    inside = from_blocks(history, 4, model.element_count).reshape(8, 8, 4)[1:-1, 1:-1]
    assert abs(inside[..., 3]).max() < 1e-12


def test_a_sheet_that_is_curved_at_the_start_has_no_strain_and_turns_freely(make):
    rng = np.random.default_rng(3)
    curved = cylinder(0.3)
    model = sheet(curved, fibre=(0.0, 1.0, 0.0))
    assert model.only_body().data.options.curved is not None
    turned = curved @ make.rotation(rng).T + rng.normal(size=3)
    for positions in (curved, turned):
        strain, history = compaction(model, positions)
        assert abs(strain).max() < 1e-12
        force = corner_forces(model, positions_of(positions), history)
        assert abs(force).max() < 1e-9 * 1e9 * EDGE * THICKNESS


def compacted_bend():
    """Nodes of a bent and compacted sheet, crumpled a little: S33 is not zero."""
    bent = cylinder(0.25)
    middle = bent.mean(axis=0)
    bent = middle + 0.8 * (bent - middle)
    return bent + 1e-5 * np.random.default_rng(8).normal(size=bent.shape)


def test_the_energy_of_a_renewal_is_booked():
    model = sheet(flat())
    x = positions_of(compacted_bend())
    history = np.zeros(model.history_size)
    before = sum(model.only_body().stored_energy(x, history))
    given = model.renew(x, history)
    after = sum(model.only_body().stored_energy(x, history))
    assert given == pytest.approx(after - before, rel=1e-3)
    assert abs(given) > 1e-3 * abs(before)
    # once more changes nothing
    assert model.renew(x, history) == 0.0
    assert from_blocks(history, 4, model.element_count).shape == (model.element_count, 4)
    assert history.size % (4 * LANES) == 0


def test_fields_have_the_thickness_of_the_kernel():
    model = sheet(flat())
    rng = np.random.default_rng(9)
    bent = cylinder(0.3) + 2e-4 * rng.normal(size=cylinder(0.3).shape)
    strain, history = compaction(model, bent)
    flat_positions = bent.reshape(-1, 3)
    thickness = derive_fields(model.only_body().mesh, model.only_body().material, flat_positions)[
        "thickness"
    ]
    np.testing.assert_allclose(thickness, THICKNESS * np.sqrt(1.0 + 2.0 * strain), rtol=1e-9)
    condition = model.only_body().condition(positions_of(bent), history)
    np.testing.assert_allclose(condition.thickness_stretch * THICKNESS, thickness, rtol=1e-9)
    several = bend_part(
        model.only_body().mesh.elements,
        model.only_body().mesh.neighbours,
        np.stack([flat_positions, 2 * flat_positions]),
    )
    np.testing.assert_allclose(several[1], 4.0 * several[0], rtol=1e-9)


def test_a_fold_shares_no_more_than_a_turn_of_sixty_degrees():
    """Normals that flip from element to element must not make a thickness of their own."""
    model = sheet(flat())
    folded = cylinder(np.radians(150.0))
    strain, history = compaction(model, folded)
    rows = from_blocks(history, 4, model.element_count)
    half = 0.5 * THICKNESS * np.cos(np.radians(75.0))
    assert 2.0 * rows[:, 3].max() <= 0.25 * (2.0 * half / THICKNESS) ** 2 * (1.0 + 1e-9)
    thickness = derive_fields(
        model.only_body().mesh, model.only_body().material, folded.reshape(-1, 3)
    )["thickness"]
    np.testing.assert_allclose(thickness, THICKNESS * np.sqrt(1.0 + 2.0 * strain), rtol=1e-9)


def test_between_steps_a_renewal_puts_in_what_half_a_step_before_it_would():
    """ΔU there is ΔU - ½ dt v·Δf here: what the energy of central differences changes by."""
    model = sheet(flat())
    x = positions_of(compacted_bend())
    half_way = 1e-9 * np.random.default_rng(9).normal(size=x.shape)
    given = []
    for counted_at in (x, x - half_way, x + half_way):
        history = np.zeros(model.history_size)
        given.append(model.renew(x, history, counted_at))
    old = corner_forces(model, x, np.zeros(model.history_size))
    change = corner_forces(model, x, history) - old
    way = half_way.T[model.only_body().mesh.elements]
    assert given[1] - given[0] == pytest.approx(-np.sum(change * way), rel=1e-3)
    assert given[2] - given[0] == pytest.approx(np.sum(change * way), rel=1e-3)
