"""Fields from node positions: closed-form deformations, conservation, and frame indifference."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.fields.derived import derive_fields, face_area_vectors
from lcmchain.mesh.blank import BlankMesh
from lcmchain.quantities.fields import FIELD_OF_VARIABLE
from lcmchain.scene import scene_from_text

THICKNESS = 1.004e-3
FIBRE_FREE = ("thickness", "areal_fibre_mass", "shear_angle", "fibre_strain_1", "fibre_strain_2")


@pytest.fixture(scope="module")
def md600():

    scene = scene_from_text(
        '[process]\ntime = "1 ms"\n[blank]\nsize = ["4 mm", "4 mm"]\nedge_length = "1 mm"\n'
        '[material]\npreset = "MD600"\n'
    )
    return scene.material.build()


def sheet(columns=4, rows=3, edge=0.005, *, triangles=False, fibre_angle=0.0):
    """Flat blank in the layout of build_blank; with triangles, the last cell is halved."""
    x, y = np.meshgrid(edge * np.arange(columns + 1), edge * np.arange(rows + 1), indexing="ij")
    middle = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    index = np.arange(x.size).reshape(x.shape)
    faces = np.stack(
        [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1
    ).reshape(-1, 4)
    if triangles:
        a, b, _, d = faces[-1]
        faces[-1] = [b, d, a, a]  # the cut edge first
        keep = np.unique(faces)
        renumber = np.full(len(middle), -1)
        renumber[keep] = np.arange(len(keep))
        middle, faces = middle[keep], renumber[faces]
    half = np.array([0.0, 0.0, 0.5 * THICKNESS])
    count, pairs = len(faces), len(middle)
    one = [math.cos(fibre_angle), math.sin(fibre_angle), 0.0]
    two = [-math.sin(fibre_angle), math.cos(fibre_angle), 0.0]
    return BlankMesh(
        np.concatenate([middle - half, middle + half]),
        np.hstack([faces, faces + pairs]),
        np.tile(one, (count, 1)),
        np.tile(two, (count, 1)),
        THICKNESS,
    )


def rotation(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), -axis)
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K


def trellis(angle, thickness=THICKNESS):
    """Deformation gradient of shear with inextensible fibres along x and y, and compaction."""
    return np.array(
        [
            [1.0, math.sin(angle), 0.0],
            [0.0, math.cos(angle), 0.0],
            [0.0, 0.0, thickness / THICKNESS],
        ]
    )


def direction(fields, family):
    return np.stack([fields[f"fibre_direction_{family}_{axis}"] for axis in "xyz"], axis=-1)


def test_undeformed_blank(md600):
    blank = sheet(triangles=True)
    fields = derive_fields(blank, md600, blank.node_positions)
    assert set(fields) <= set(FIELD_OF_VARIABLE)
    np.testing.assert_allclose(fields["thickness"], THICKNESS, rtol=1e-13)
    np.testing.assert_allclose(fields["areal_fibre_mass"], 0.6, rtol=1e-13)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.33017, rtol=1e-4)
    np.testing.assert_allclose(direction(fields, 1), np.tile([1, 0, 0], (12, 1)), atol=1e-13)
    for name in ("shear_angle", "fibre_strain_1", "fibre_strain_2"):
        np.testing.assert_allclose(fields[name], 0.0, atol=1e-12)


# Fibre volume fraction of MD600 (600 g/m², 1810 kg/m³) at shear angle and thickness [mm],
# v_f = m_A / (rho_f t cos(gamma)): reference values, section 2.6.
@pytest.mark.parametrize(
    ("angle", "thickness", "fraction"),
    [
        *[(0, 1.004, 0.330), (15, 1.004, 0.342), (30, 1.004, 0.381), (45, 1.004, 0.467)],
        *[(50, 1.004, 0.514), (60, 1.004, 0.660), (0, 0.8, 0.414), (30, 0.8, 0.478)],
        *[(50, 0.8, 0.645), (15, 0.7, 0.490), (45, 0.7, 0.670), (45, 0.6, 0.781)],
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_trellis_shear_with_compaction(md600, angle, thickness, fraction, sign):
    blank = sheet(triangles=True)
    gamma, t = sign * math.radians(angle), 1e-3 * thickness
    fields = derive_fields(blank, md600, blank.node_positions @ trellis(gamma, t).T)
    np.testing.assert_allclose(fields["shear_angle"], gamma, atol=1e-12)
    np.testing.assert_allclose(fields["thickness"], t, rtol=1e-12)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], fraction, atol=6e-4)
    np.testing.assert_allclose(
        fields["fibre_volume_fraction"], 0.6 / (1810.0 * t * math.cos(gamma)), rtol=1e-12
    )
    np.testing.assert_allclose(fields["areal_fibre_mass"], 0.6 / math.cos(gamma), rtol=1e-12)
    for family in (1, 2):
        np.testing.assert_allclose(fields[f"fibre_strain_{family}"], 0.0, atol=1e-12)


def test_tilted_directors_count_with_their_normal_part(md600):
    """Transverse shear moves the top face sideways: the thickness between the faces stays."""
    blank = sheet()
    F = np.eye(3)
    F[0, 2] = 0.7
    fields = derive_fields(blank, md600, blank.node_positions @ F.T)
    np.testing.assert_allclose(fields["thickness"], THICKNESS, rtol=1e-12)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.33017, rtol=1e-4)


def test_sign_of_shear_follows_the_sheet_not_the_viewer(md600):
    blank = sheet()
    F = rotation([1, 0, 0], math.pi) @ trellis(math.radians(25))
    fields = derive_fields(blank, md600, blank.node_positions @ F.T)
    np.testing.assert_allclose(fields["shear_angle"], math.radians(25), atol=1e-12)


small = st.floats(-0.35, 0.35, allow_nan=False)


@given(
    gradient=st.lists(small, min_size=9, max_size=9),
    axis=st.tuples(small, small, st.floats(0.1, 1.0)),
    angle=st.floats(-math.pi, math.pi),
    fibre_angle=st.floats(-1.5, 1.5),
)
def test_homogeneous_deformation(md600, gradient, axis, angle, fibre_angle):
    """Every field against its definition with the deformation gradient itself."""
    F = np.eye(3) + 0.5 * np.reshape(gradient, (3, 3))
    F = rotation(axis, angle) @ F
    blank = sheet(2, 2, triangles=True, fibre_angle=fibre_angle)
    fields = derive_fields(blank, md600, blank.node_positions @ F.T + [1.0, -2.0, 0.5])
    a1, a2 = F @ blank.fibre_direction_1[0], F @ blank.fibre_direction_2[0]
    normal = np.linalg.inv(F).T @ [0.0, 0.0, 1.0]
    expected = {
        "thickness": THICKNESS / np.linalg.norm(normal),
        "fibre_volume_fraction": 0.6 / (1810.0 * THICKNESS) / np.linalg.det(F),
        "areal_fibre_mass": 0.6 / (np.linalg.det(F) * np.linalg.norm(normal)),
        "fibre_strain_1": np.linalg.norm(a1) - 1.0,
        "fibre_strain_2": np.linalg.norm(a2) - 1.0,
        "shear_angle": math.pi / 2 - math.acos(a1 @ a2 / (np.linalg.norm(a1) * np.linalg.norm(a2))),
    }
    for name, value in expected.items():
        np.testing.assert_allclose(fields[name], value, rtol=1e-9, atol=1e-10, err_msg=name)
    for family, a in ((1, a1), (2, a2)):
        np.testing.assert_allclose(
            direction(fields, family), np.tile(a / np.linalg.norm(a), (4, 1)), atol=1e-10
        )


@given(seed=st.integers(0, 2**31), size=st.floats(0.0, 0.3))
def test_fibre_mass_is_conserved_on_warped_elements(md600, seed, size):
    """Distorted, warped elements and triangles: areal mass times area is the initial mass."""
    blank = sheet(6, 5, triangles=True)
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, (blank.pair_count, 3))
    noise = np.tile(size * 0.005 * noise, (2, 1))
    fields = derive_fields(blank, md600, blank.node_positions + noise)
    middle = (blank.node_positions + noise)[: blank.pair_count] + [0.0, 0.0, 0.5 * THICKNESS]
    areas = np.linalg.norm(face_area_vectors(middle[blank.faces]), axis=-1)
    mass = math.fsum(fields["areal_fibre_mass"] * areas)
    assert mass == pytest.approx(0.6 * 29.5 * 0.005**2, rel=1e-12)
    # the same fibres, seen as volume fraction times volume
    volume = fields["fibre_volume_fraction"] * fields["thickness"] * areas
    assert math.fsum(1810.0 * volume) == pytest.approx(mass, rel=1e-12)


def wrapped(blank, radius):
    """Wrap a sheet on a cylinder about y: arc length is kept in the mid-surface."""
    x, y, z = blank.node_positions.T
    phi = x / radius
    return np.stack([(radius + z) * np.sin(phi), y, (radius + z) * np.cos(phi)], axis=1)


def test_sheet_wrapped_on_a_cylinder(md600):
    """Fibres are measured on the chord, in half its angle; the thickness is that of the arc."""
    radius, blank = 0.05, sheet(8, 2)
    half = 0.5 * 0.005 / radius
    fields = derive_fields(blank, md600, wrapped(blank, radius))
    np.testing.assert_allclose(fields["fibre_strain_1"], math.sin(half) / half - 1.0, rtol=1e-9)
    np.testing.assert_allclose(fields["thickness"], THICKNESS, rtol=1e-9)
    np.testing.assert_allclose(fields["shear_angle"], 0.0, atol=1e-12)
    phi = (np.repeat(np.arange(8), 2) + 0.5) * 0.005 / radius
    tangent = np.stack([np.cos(phi), 0.0 * phi, -np.sin(phi)], axis=1)
    np.testing.assert_allclose(direction(fields, 1), tangent, atol=1e-12)
    np.testing.assert_allclose(direction(fields, 2), np.tile([0, 1, 0], (16, 1)), atol=1e-12)


@pytest.mark.parametrize("radius", [0.03, 0.06, -0.03, math.inf])
def test_a_sheet_that_is_curved_at_the_start_keeps_its_thickness(md600, radius):
    """As it stands, opened, bent the other way and flattened: its first bend is no thinning."""
    flat = sheet(8, 2)
    positions = flat.node_positions if radius == math.inf else wrapped(flat, radius)
    fields = derive_fields(wrapped_blank(flat, 0.03), md600, positions)
    np.testing.assert_allclose(fields["thickness"], THICKNESS, rtol=1e-9)


def wrapped_blank(blank, radius):
    """A sheet whose undeformed shape is wrapped on a cylinder about y."""
    phi = blank.node_positions[blank.faces].mean(axis=1)[:, 0] / radius
    along = np.stack([np.cos(phi), 0.0 * phi, -np.sin(phi)], axis=1)
    return BlankMesh(
        wrapped(blank, radius), blank.elements, along, np.tile([0.0, 1.0, 0.0], (len(phi), 1)),
        THICKNESS,
    )  # fmt: skip


def test_error_of_the_wrapped_sheet_is_of_second_order(md600):
    strains, thicknesses = [], []
    for count in (4, 8, 16):
        blank = sheet(count, 1, edge=0.04 / count)
        fields = derive_fields(blank, md600, wrapped(blank, 0.03))
        strains.append(abs(fields["fibre_strain_1"]).max())
        thicknesses.append(abs(fields["thickness"] - THICKNESS).max())
    rates = np.log2(np.array(strains[:-1]) / strains[1:])
    assert np.all(np.abs(rates - 2.0) < 0.05)
    # neighbours tell the curvature: the chord of 10 mm elements would lose 1.4 % of the thickness
    assert max(thicknesses) < 1e-4 * THICKNESS


def test_frames_at_once_are_the_frames_one_by_one(md600):
    blank = sheet(triangles=True)
    frames = np.stack([blank.node_positions @ trellis(g, 0.9e-3).T for g in (0.0, 0.2, -0.4)])
    together = derive_fields(blank, md600, frames)
    for number, positions in enumerate(frames):
        for name, values in derive_fields(blank, md600, positions).items():
            assert np.array_equal(together[name][number], values), name


def test_without_fibre_density_there_is_no_volume_fraction():
    from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness

    steel = StVenantKirchhoff(isotropic_stiffness(2e11, 0.3), thickness=THICKNESS, density=7800.0)
    blank = sheet()
    fields = derive_fields(blank, steel, blank.node_positions)
    assert "fibre_volume_fraction" not in fields
    assert set(FIBRE_FREE) < set(fields)
