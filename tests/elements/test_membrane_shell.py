"""The membrane-shell triangle: energies, forces, curvature, convergence, frequency bound."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit, typeof
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import eigsh, spsolve

from lcmchain.elements.blocks import from_blocks, in_blocks
from lcmchain.elements.membrane_shell.kernel import (
    MembraneShellData,
    membrane_shell_forces,
    membrane_shell_state,
    nodal_frequency_bounds,
    patch_force_loop,
    patch_nodes_in_blocks,
    patch_rows,
)
from lcmchain.elements.membrane_shell.patch import angle_shares, triangle_geometry
from lcmchain.errors import InputError
from lcmchain.materials.features.shear import ShearLocking
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.cells import nodal_bound
from lcmchain.mesh.mid_surface import TriangleMesh, triangulate

EDGE, THICKNESS = 5e-3, 1.004e-3
LOCKING = ShearLocking.from_angle(np.radians(25.0), 20e9)
QUADRATICS = {
    "x²/2": (lambda x, y: 0.5 * x * x, (1.0, 0.0, 0.0)),
    "y²/2": (lambda x, y: 0.5 * y * y, (0.0, 1.0, 0.0)),
    "xy": (lambda x, y: x * y, (0.0, 0.0, 2.0)),
    "1 + 2x - y": (lambda x, y: 1.0 + 2.0 * x - y, (0.0, 0.0, 0.0)),
}
# a rectangle, one whose fibres are turned, and a polygon with cut edges of any direction
BLANKS = {
    "aligned": {"size": (0.06, 0.04)},
    "turned": {"size": (0.06, 0.06), "fibre_angle": np.pi / 4},
    "cut": {"rim": ((0.0, 0.0), (0.06, 0.01), (0.07, 0.06), (0.02, 0.07)), "fibre_angle": 0.3},
}


def blank_mesh(*, edge_length=EDGE, thickness=THICKNESS, **shape):
    spec = {"size": None, "rim": None, "drawing": None, "cuts": {}, "courses": None}
    spec |= {"fibre_angle": 0.0, "height": 0.0} | shape
    return build_blank(SimpleNamespace(edge_length=edge_length, **spec), thickness)


@dataclass
class Sheet:
    """A sheet of triangles with the plainly written energy that the kernels are held against."""

    mesh: TriangleMesh
    fabric: object

    def __post_init__(self):
        law = self.fabric.law
        self.bending = np.array([law.B11, law.B22, law.B12])
        self.geometry = triangle_geometry(self.mesh, self.bending)
        self.patch_node = patch_nodes_in_blocks(self.geometry)
        self.data = MembraneShellData(
            law,
            self.fabric.thickness,
            self.patch_node,
            in_blocks(patch_rows(self.geometry)),
            self.mesh.element_count,
        )
        shares = angle_shares(self.mesh.node_positions[self.mesh.elements])
        nodal = self.fabric.areal_mass * shares * self.geometry.area[:, None]
        self.mass = np.bincount(self.mesh.elements.ravel(), nodal.ravel())

    @property
    def fibre_coordinates(self):
        axes = np.stack([self.mesh.fibre_direction_1[0], self.mesh.fibre_direction_2[0]])
        return self.mesh.node_positions @ axes.T

    def curvatures(self, position):
        """κ_11, κ_22, 2κ_12 (E, 3) at positions (N, 3), real or complex."""
        nodes = np.where(self.geometry.nodes < 0, self.geometry.nodes[:, :1], self.geometry.nodes)
        x = position[nodes]
        a = np.einsum("enb,eni->ebi", self.geometry.gradient, x[:, :3])
        h = np.einsum("ecn,eni->eci", self.geometry.curvature, x)
        normal = np.cross(a[:, 0], a[:, 1])
        normal /= np.sqrt(np.sum(normal * normal, axis=1))[:, None]
        return a, np.einsum("eci,ei->ec", h, normal)

    def energies(self, position):
        """Membrane and bending energy [J], summed; complex positions give complex energies."""
        a, curvature = self.curvatures(position)
        E11, E22 = (0.5 * (np.sum(a[:, k] ** 2, axis=1) - 1.0) for k in (0, 1))
        g12 = np.sum(a[:, 0] * a[:, 1], axis=1)
        law, t = self.fabric.law, self.fabric.thickness
        e12 = 0.5 * np.where(g12.real >= 0.0, g12, -g12)
        polynomial = (law.s0, law.s1, law.s2, law.s3, law.s4)
        shear = sum(4.0 * s * e12 ** (k + 2) / (k + 2) for k, s in enumerate(polynomial))
        if self.fabric.locks:
            strain, growth = self.fabric.locking
            excess = np.where(2.0 * e12.real > strain, 2.0 * e12 - strain, 0.0)
            shear = shear + growth * excess**4 / 12.0
        membrane = 0.5 * law.C11 * E11**2 + 0.5 * law.C22 * E22**2 + shear
        area = self.geometry.area
        bending = t**3 / 24.0 * curvature**2 @ self.bending
        return np.sum(area * t * membrane), np.sum(area * bending)

    def gradient(self, position, components):
        """Derivatives of the total energy by complex steps, for pairs (node, direction)."""
        found = []
        for node, direction in components:
            moved = position.astype(complex)
            moved[node, direction] += 1e-30j
            found.append(sum(self.energies(moved)).imag / 1e-30)
        return np.array(found)

    def forces(self, position):
        """Forces (N, 3) of the compiled kernel."""
        rows = 18 * self.patch_node.size // 6
        patch_force = np.full(rows + 5, np.nan)
        x = np.ascontiguousarray(position.T)
        membrane_shell_forces(self.data, x, patch_force, np.empty(0))
        assert np.isnan(patch_force[rows:]).all()
        split = from_blocks(patch_force[:rows], 18, self.mesh.element_count).reshape(-1, 6, 3)
        absent = self.geometry.nodes < 0
        assert (split[absent] == 0.0).all()
        nodes, parts = self.geometry.nodes[~absent], split[~absent].T
        return np.stack([np.bincount(nodes, p, minlength=len(position)) for p in parts], axis=1)

    def stored(self, position):
        """Strains (E, 6), area ratios and bending energies of the compiled kernel."""
        count = self.patch_node.size // 6
        strain, ratio, bending = np.empty((count, 6)), np.empty(count), np.empty(count)
        x = np.ascontiguousarray(position.T)
        membrane_shell_state(self.data, x, strain, ratio, bending)
        real = slice(self.mesh.element_count)
        return strain[real], ratio[real], bending[real]

    def frequency_bound(self, position):
        """The bound of ω² [1/s²] of the sheet, and what governs the node that sets it."""
        omega2 = np.empty(self.mesh.node_count)
        part = np.empty(self.mesh.node_count, dtype=np.int64)
        scratch = np.empty((2, 6, self.mesh.node_count))
        x = np.ascontiguousarray(position.T)
        weight = np.ones(self.mesh.node_count)
        if self.mesh.is_cut:
            corners, gradient = self.mesh.elements, np.abs(self.geometry.gradient)
            shares = angle_shares(self.mesh.node_positions[corners])
            weight = nodal_bound(corners, gradient, shares, self.geometry.area)[1]
        nodal_frequency_bounds(self.data, x, self.mass, weight, *scratch, omega2, part)
        return omega2.max(), part[np.argmax(omega2)]


@pytest.fixture
def sheet(make):
    def build(shape, **changes):
        shape = BLANKS[shape] if isinstance(shape, str) else shape
        return Sheet(triangulate(blank_mesh(**shape)), make.md600(**changes))

    return build


def formed(sheet, rng, *, warp=0.3, stretch=0.02):
    """Positions of a sheet that is sheared, stretched, bent with both signs and rough."""
    x, y = sheet.fibre_coordinates.T
    position = np.stack([x + 0.4 * y + stretch * x, y + 0.05 * x, 40.0 * x * y - 30.0 * x * x], 1)
    return position + warp * EDGE * rng.uniform(-0.2, 0.2, position.shape)


# --- mesh -----------------------------------------------------------------------------------------


def test_paper_mesh_has_7200_triangles_with_legs_along_the_fibres():
    blank = blank_mesh(size=(0.3, 0.3))
    mesh = triangulate(blank)
    assert (mesh.element_count, mesh.node_count) == (7200, blank.pair_count)
    corners = mesh.node_positions[mesh.elements]
    sides = np.abs(np.roll(corners, -1, axis=1) - corners)
    for axis in (0, 1):  # one side along either fibre
        along = (sides[..., 1 - axis] < 1e-12) & (np.abs(sides[..., axis] - EDGE) < 1e-12)
        assert (along.sum(axis=1) == 1).all()


def test_diagonals_keep_all_symmetries_of_a_square():
    mesh = triangulate(blank_mesh(size=(0.06, 0.06)))

    def shapes(positions):
        centres = np.sort(np.round(1e6 * positions[mesh.elements]), axis=1)
        return {tuple(c.ravel()) for c in np.sort(centres.view("f8,f8,f8"), axis=1).view("f8")}

    own = shapes(mesh.node_positions)
    for image in ([-1, 1, 1], [1, -1, 1], [-1, -1, 1]):
        assert shapes(mesh.node_positions * image + 0.0) == own
    assert shapes(mesh.node_positions[:, [1, 0, 2]]) == own


@pytest.mark.parametrize("shape", BLANKS)
def test_triangles_cover_the_blank_and_share_its_mass_evenly(sheet, shape):
    tri = sheet(shape)
    blank = blank_mesh(**BLANKS[shape])
    np.testing.assert_allclose(tri.geometry.area.sum(), blank.area, rtol=1e-12)
    np.testing.assert_allclose(tri.mass.sum(), 0.6 * blank.area, rtol=1e-12)
    if shape == "aligned":  # a cell for an inner node, half of one on a side, a quarter at a corner
        cells = tri.mass / (0.6 * EDGE**2)
        np.testing.assert_allclose(np.unique(np.round(cells, 9)), [0.25, 0.5, 1.0])


def test_triangle_without_area_is_named(sheet):
    tri = sheet("aligned")
    flat = tri.mesh.node_positions.copy()
    first = tri.mesh.elements[7]
    flat[first[2]] = 0.5 * (flat[first[0]] + flat[first[1]])
    mesh = TriangleMesh(
        flat, tri.mesh.elements, tri.mesh.fibre_direction_1, tri.mesh.fibre_direction_2, THICKNESS
    )
    with pytest.raises(InputError, match="no positive area"):
        triangle_geometry(mesh, tri.bending)


# --- curvature ------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", BLANKS)
@pytest.mark.parametrize("name", QUADRATICS)
def test_quadratic_deflection_gives_its_curvature(sheet, shape, name):
    """Exactly, on cut and on regular meshes; at free edges without the moments across them."""
    tri = sheet(shape)
    deflection, expected = QUADRATICS[name]
    weights, nodes = tri.geometry.curvature, tri.geometry.nodes
    w = deflection(*tri.fibre_coordinates.T)
    curvature = np.einsum("ecn,en->ec", weights, np.where(nodes < 0, 0.0, w[nodes]))
    inner = (nodes >= 0).all(axis=1)
    np.testing.assert_allclose(curvature[inner] - expected, 0.0, atol=1e-9)
    if name == "1 + 2x - y":
        np.testing.assert_allclose(curvature, 0.0, atol=1e-9)
    elif shape == "aligned":  # edges along fibres: the curvature along them stays, with the twist
        for side, axis in ((1, 0), (0, 1)):
            x = tri.fibre_coordinates[:, side]
            on_side = np.abs(x[tri.mesh.elements] - x.max()) < 1e-9
            at_edge = (on_side.sum(axis=1) == 2) & ((nodes < 0).sum(axis=1) == 1)
            assert at_edge.sum() > 5
            np.testing.assert_allclose(curvature[at_edge, axis], expected[axis], atol=1e-9)
            np.testing.assert_allclose(curvature[at_edge, 1 - axis], 0.0, atol=1e-9)
            np.testing.assert_allclose(curvature[at_edge, 2], expected[2], atol=1e-9)


def test_free_edges_carry_no_moment(sheet):
    """The eliminated nodes minimise the energy: no other place of them stores less."""
    tri = sheet("cut")
    rng = np.random.default_rng(3)
    full = triangle_geometry(tri.mesh, tri.bending)
    stiff_across = triangle_geometry(tri.mesh, tri.bending * [1.0, 1.0, 1e-9])
    edge = (full.nodes < 0).any(axis=1)
    w = rng.normal(size=tri.mesh.node_count)
    values = np.where(full.nodes < 0, 0.0, w[full.nodes])
    own, other = (
        np.einsum("ecn,en->ec", g.curvature, values)[edge] ** 2 @ tri.bending
        for g in (full, stiff_across)
    )
    assert (own <= other * (1.0 + 1e-9)).all() and (own < 0.9 * other).any()


def test_patch_on_a_conic_falls_back_to_mean_gradients(make):
    """Six nodes on a circle leave the quadratic surface undetermined."""
    angle = np.radians([90.0, 210.0, 330.0, 270.0, 30.0, 150.0])
    positions = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1) * EDGE
    triangles = np.array([[0, 1, 2], [3, 2, 1], [4, 0, 2], [5, 1, 0]])
    directions = np.broadcast_to([1.0, 0.0, 0.0], (4, 3)), np.broadcast_to([0.0, 1.0, 0.0], (4, 3))
    law = make.md600().law
    mesh = TriangleMesh(positions, triangles, *directions, THICKNESS)
    geometry = triangle_geometry(mesh, (law.B11, law.B22, law.B12))
    weights = geometry.curvature[0]
    assert np.isfinite(weights).all() and abs(weights).max() * EDGE**2 < 10.0
    nodes = geometry.nodes[0]
    x, y = positions[nodes, :2].T
    np.testing.assert_allclose(weights @ np.stack([1.0 + 0.0 * x, x, y], axis=1), 0.0, atol=1e-9)
    # a dome of equal curvatures, by symmetry neither twisted nor unequal
    curvature = weights @ (0.5 * (x * x + y * y) + 0.1 * EDGE * (np.arange(6) > 2))
    assert curvature[0] > 0.0
    np.testing.assert_allclose(curvature[[1, 2]], [curvature[0], 0.0], atol=1e-9 * curvature[0])


def test_bent_to_a_cylinder_stores_the_energy_of_a_cylinder(sheet):
    """D/2 κ² per area, along either fibre; the strips at the two straight ends carry no moment."""
    for axis, name in ((0, "B11"), (1, "B22")):
        size = np.array([0.04, 0.04])
        size[axis] = 0.4
        tri = sheet({"size": tuple(size)})
        radius = 0.1
        x, y = tri.fibre_coordinates.T
        s, across = (x, y) if axis == 0 else (y, x)
        angle = s / radius
        arc, height = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
        position = np.stack([arc, across, height], 1) if axis == 0 else (
            np.stack([across, arc, height], 1)
        )  # fmt: skip
        _, ratio, bending = tri.stored(position)
        density = bending / tri.geometry.area
        expected = getattr(tri.fabric.law, name) * THICKNESS**3 / 24.0 / radius**2
        ends = np.abs(s[tri.mesh.elements]).max(axis=1) > s.max() - 1.1 * EDGE
        # the normal of a chord of 5 mm turns by 1.4 degrees: cos² of half of that
        np.testing.assert_allclose(density[~ends], expected, rtol=2e-3)
        half = 0.5 * EDGE / radius
        np.testing.assert_allclose(ratio, np.sin(half) / half, rtol=1e-9)


# --- energy and forces ----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", BLANKS)
def test_forces_are_the_derivative_of_the_energy(sheet, shape):
    tri = sheet(shape)
    rng = np.random.default_rng(5)
    position = formed(tri, rng)
    force = tri.forces(position)
    components = [(n, d) for n in rng.choice(len(position), 20, replace=False) for d in range(3)]
    expected = tri.gradient(position, components)
    actual = np.array([force[c] for c in components])
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-12 * abs(expected).max())


def test_forces_of_a_locked_fabric_are_the_derivative_of_its_energy(sheet):
    tri = sheet("cut", locking=LOCKING)
    position = formed(tri, np.random.default_rng(5))
    strain = np.abs(tri.stored(position)[0][:, 3])
    assert (strain > LOCKING.locking_strain).any() and (strain < LOCKING.locking_strain).any()
    components = [(n, d) for n in range(0, len(position), 9) for d in range(3)]
    expected = tri.gradient(position, components)
    actual = np.array([tri.forces(position)[c] for c in components])
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-12 * abs(expected).max())
    free = sheet("cut").forces(position)
    assert abs(tri.forces(position) - free).max() > 1e-3 * abs(free).max()


def test_bending_forces_alone_are_the_derivative_of_their_energy(sheet):
    """Without the membrane, whose forces are a thousand times larger."""
    soft = dict.fromkeys(("C11", "C22", "s0", "s1", "s2", "s3", "s4"), 0.0)
    tri = sheet("cut", **soft)
    position = formed(tri, np.random.default_rng(6))
    components = [(n, d) for n in range(0, len(position), 9) for d in range(3)]
    expected = tri.gradient(position, components)
    actual = np.array([tri.forces(position)[c] for c in components])
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-12 * abs(expected).max())


def test_stored_energies_agree_with_the_plain_ones(sheet):
    tri = sheet("cut")
    position = formed(tri, np.random.default_rng(7))
    strain, ratio, bending = tri.stored(position)
    membrane, plain_bending = tri.energies(position)
    volume = tri.geometry.area * THICKNESS
    np.testing.assert_allclose(tri.fabric.membrane_energy(strain) @ volume, membrane, rtol=1e-12)
    np.testing.assert_allclose(bending.sum(), plain_bending, rtol=1e-12)
    corners = position[tri.mesh.elements]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(
        ratio, np.linalg.norm(normal, axis=1) / (2.0 * tri.geometry.area), rtol=1e-12
    )


@pytest.mark.parametrize("shape", BLANKS)
def test_rigid_motion_costs_nothing(make, sheet, shape):
    tri = sheet(shape)
    rng = np.random.default_rng(8)
    scale = abs(tri.forces(1.01 * tri.mesh.node_positions)).max()  # one per cent of strain
    for _ in range(3):
        moved = tri.mesh.node_positions @ make.rotation(rng).T + rng.normal(size=3)
        assert abs(tri.forces(moved)).max() < 1e-10 * scale
        assert sum(tri.energies(moved)) < 1e-20


def test_forces_turn_with_the_sheet_and_are_in_equilibrium(make, sheet):
    tri = sheet("cut")
    rng = np.random.default_rng(9)
    position = formed(tri, rng)
    force = tri.forces(position)
    scale = abs(force).max()
    Q = make.rotation(rng)
    turned = tri.forces(position @ Q.T + rng.normal(size=3))
    np.testing.assert_allclose(turned, force @ Q.T, rtol=0.0, atol=1e-9 * scale)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-11 * scale)
    moment = np.cross(position, force).sum(axis=0)
    np.testing.assert_allclose(moment, 0.0, atol=1e-12 * scale * len(position) * EDGE)


@pytest.mark.parametrize("shape", BLANKS)
def test_membrane_patch_test(sheet, shape):
    """A homogeneous deformation strains every triangle alike and leaves inner nodes at rest."""
    tri = sheet(shape)
    gradient = np.array([[1.002, 0.35, 0.0], [0.05, 0.97, 0.0], [0.1, -0.2, 0.0]])
    position = tri.fibre_coordinates @ gradient[:, :2].T
    strain, _, bending = tri.stored(position)
    E = 0.5 * (gradient[:, :2].T @ gradient[:, :2] - np.eye(2))
    expected = [E[0, 0], E[1, 1], 2.0 * E[0, 1]]
    np.testing.assert_allclose(strain[:, [0, 1, 3]] - expected, 0.0, atol=1e-12)
    assert bending.max() < 1e-25
    force = tri.forces(position)
    edge = np.unique(tri.mesh.elements[(tri.geometry.nodes[:, 3:] < 0).any(axis=1)])
    inner = np.setdiff1d(np.arange(len(position)), edge)
    assert abs(force[inner]).max() < 1e-11 * abs(force).max()


# --- convergence ----------------------------------------------------------------------------------


def bending_stiffness_of(tri):
    """Small-deflection stiffness (N, N) of the deflections of a flat sheet."""
    weights, nodes = tri.geometry.curvature, tri.geometry.nodes
    D = tri.bending * THICKNESS**3 / 12.0
    K = np.einsum("e,c,eci,ecj->eij", tri.geometry.area, D, weights, weights)
    patch = np.where(nodes < 0, nodes[:, :1], nodes)  # absent nodes have no weight
    rows, columns = np.repeat(patch, 6, axis=1), np.tile(patch, 6)
    shape = (tri.mesh.node_count,) * 2
    return csr_matrix((K.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def test_simply_supported_plate_converges_quadratically(sheet):
    """Navier's solution of the orthotropic plate under pressure: volume under the deflection."""
    side, errors = 0.08, []
    m, n = np.meshgrid(np.arange(1, 60, 2), np.arange(1, 60, 2))
    for cells in (8, 16, 32):
        tri = sheet({"size": (side, side), "edge_length": side / cells})
        D1, D2, D66 = tri.bending * THICKNESS**3 / 12.0
        stiffness = (np.pi / side) ** 4 * (D1 * m**4 + 4.0 * D66 * (m * n) ** 2 + D2 * n**4)
        amplitude = 16.0 / (np.pi**2 * m * n) / stiffness
        exact = np.sum(amplitude * 4.0 * side**2 / (np.pi**2 * m * n))
        area = tri.mass / tri.fabric.areal_mass
        free = np.flatnonzero((np.abs(tri.fibre_coordinates) < 0.5 * side - 1e-9).all(axis=1))
        K = bending_stiffness_of(tri)[free][:, free].tocsc()
        errors.append(abs(spsolve(K, area[free]) @ area[free] / exact - 1.0))
    assert errors[-1] < 5e-3
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (rates > 1.8).all(), errors


def tangent_of(tri, position, step=1e-8):
    """Stiffness (3N, 3N) of a small sheet by central differences of the compiled forces."""
    K = np.empty((position.size, position.size))
    for i in range(position.size):
        change = np.zeros(position.size)
        change[i] = step
        change = change.reshape(position.shape)
        K[:, i] = (tri.forces(position + change) - tri.forces(position - change)).ravel()
    K /= 2.0 * step
    return 0.5 * (K + K.T)


def in_equilibrium(tri, position, load, free):
    """Positions at which the internal forces carry the load, by Newton's method."""
    position = position.copy()
    for _ in range(30):
        residual = (load - tri.forces(position)).ravel()[free]
        if abs(residual).max() < 1e-9 * abs(load).sum():
            return position
        change = np.zeros(position.size)
        change[free] = np.linalg.solve(tangent_of(tri, position)[np.ix_(free, free)], residual)
        # a rotation as large as a step of a straight Newton iteration would stretch the fibres
        position += (change * min(1.0, 0.5 * EDGE / abs(change).max())).reshape(position.shape)
    raise AssertionError("Newton's method did not converge")


def test_heavy_cantilever_takes_the_shape_of_the_elastica(sheet):
    """Λ = w L³/D = 8.0042 bends the chord to 41.49 degrees, x/L = 0.7244 (the exact elastica).

    Rows of nodes that are held clamp the strip in the middle of its last held cell: half a cell
    belongs to its length.
    """
    parameter, held_cells, cells = 8.0042, 2, 24
    tri = sheet({"size": ((held_cells + cells) * EDGE, 2 * EDGE)}, C11=50e6)
    x = tri.mesh.node_positions
    clamp = x[:, 0].min() + (held_cells - 0.5) * EDGE
    length = (cells + 0.5) * EDGE
    D = tri.bending[0] * THICKNESS**3 / 12.0
    free = np.flatnonzero(np.repeat(x[:, 0] > clamp + 0.6 * EDGE, 3))
    load = np.zeros_like(x)
    load[:, 2] = -parameter * D / length**3 * tri.mass / tri.fabric.areal_mass
    position = x.copy()
    for part in np.linspace(0.2, 1.0, 5):
        position = in_equilibrium(tri, position, part * load, free)
    tip = position[x[:, 0] > x[:, 0].max() - 1e-9].mean(axis=0) - [clamp, 0.0, 0.0]
    assert tip[0] / length == pytest.approx(0.7244, abs=0.005)
    assert np.degrees(np.arctan2(-tip[2], tip[0])) == pytest.approx(41.49, abs=0.4)


# --- frequency bound ------------------------------------------------------------------------------


def true_frequency(tri, position):
    """Highest ω² [1/s²] of the whole sheet, from differences of the compiled forces."""
    scale = diags_array(np.repeat(tri.mass, 3) ** -0.5)
    K = scale @ csr_matrix(tangent_of(tri, position)) @ scale
    return eigsh(K, k=1, which="LA", return_eigenvectors=False)[0]


def test_bound_of_right_triangles_is_the_fibre_wave_exactly(sheet):
    """2 c/l, as for the solid-shell, for equal legs and for unequal ones."""
    tri = sheet("aligned", s0=1.0, s1=0.0, s2=0.0, s3=0.0, s4=0.0, B11=1.0, B22=1.0, B12=1.0)
    fabric = tri.fabric
    bound, part = tri.frequency_bound(tri.mesh.node_positions)
    fibre_wave = 4.0 * fabric.law.C11 / fabric.density / EDGE**2
    assert (bound, part) == (pytest.approx(fibre_wave, rel=1e-6), 0)
    # with the shear and the bending of MD600 it is still close to that, and to the true value
    tri = sheet("aligned")
    bound, _ = tri.frequency_bound(tri.mesh.node_positions)
    assert fibre_wave < bound < 1.001 * fibre_wave
    true = true_frequency(tri, tri.mesh.node_positions)
    assert 0.95 * bound < true <= bound


@pytest.mark.parametrize("shape", BLANKS)
@pytest.mark.parametrize("stiff_bending", [1.0, 1e4])
def test_bound_is_never_below_the_true_frequency(sheet, shape, stiff_bending):
    """Sheared, stretched, bent and rough sheets; with bending as stiff as to govern the step."""
    law = {"B11": 38e6, "B22": 43e6, "B12": 4.2e6}
    tri = sheet(shape, **{key: stiff_bending * value for key, value in law.items()})
    rng = np.random.default_rng(10)
    flat = tri.mesh.node_positions
    assert tri.frequency_bound(flat)[1] == (1 if stiff_bending > 1.0 else 0)
    rough = [formed(tri, rng, warp=0.1, stretch=0.01), formed(tri, rng, warp=0.5, stretch=-0.02)]
    for position in (flat, *rough):
        bound, _ = tri.frequency_bound(position)
        true = true_frequency(tri, position)
        assert true <= bound * (1.0 + 1e-6)
        assert bound < 6.0 * true


def test_bound_knows_the_locked_shear(sheet):
    """With a shear that is stiffer than the fibres once it locks."""
    tri = sheet("turned", locking=LOCKING)
    position = formed(tri, np.random.default_rng(10), warp=0.1, stretch=0.01)
    bound, _ = tri.frequency_bound(position)
    true = true_frequency(tri, position)
    assert true <= bound * (1.0 + 1e-6)
    assert bound < 6.0 * true
    assert bound > 2.0 * sheet("turned").frequency_bound(position)[0]


# --- code -----------------------------------------------------------------------------------------


def has_avx2():
    try:
        return " avx2 " in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False


@pytest.mark.skipif(not has_avx2(), reason="the processor has no AVX2")
def test_the_lane_loop_is_packed(sheet):
    """A function not inlined, a call, or a division that may raise would leave it scalar."""
    tri = sheet("aligned")
    arguments = (
        np.ascontiguousarray(tri.mesh.node_positions.T),
        tri.patch_node,
        tri.data.element_data,
        np.zeros(18 * tri.patch_node.size // 6),
        tri.data.law,
        tri.data.thickness,
    )
    # code loaded from the disk cache cannot be inspected
    options = {k: v for k, v in patch_force_loop.targetoptions.items() if k != "nopython"}
    fresh = njit(**options)(patch_force_loop.py_func)
    fresh.compile(tuple(map(typeof, arguments)))
    (assembly,) = fresh.inspect_asm().values()
    arithmetic = r"\bv?(?:add|sub|mul|div|fn?m(?:add|sub)(?:132|213|231))"
    blocks = re.split(r"\n\.?L?\w+:|\n\s+j\w+\s", assembly)  # cut at labels and jumps
    vectors, scalars = rf"{arithmetic}pd\b.*%[yz]mm", rf"{arithmetic}sd\b"
    packed, scalar = max((len(re.findall(vectors, b)), len(re.findall(scalars, b))) for b in blocks)
    assert packed > 150
    assert scalar < 0.05 * packed
