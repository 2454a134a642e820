"""Plies of a stack as layers of shells, or as cells of solids: CalculiX against laminate theory."""

import json

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import map_file
from lcmchain.mapping.structure import SolverOptions, analyse
from lcmchain.scene import structure_from_text

from .conftest import FIBRE_DENSITY, MATERIAL, V, condition, needs_calculix, plane, unit
from .test_calculix_plates import at_angle, plane_stiffness

LENGTH, WIDTH = 0.2, 0.05
LOWER, UPPER = 1e-3, 0.8e-3  # thicknesses of the plies [m]
TOTAL = LOWER + UPPER
FORCE = 500.0  # [N], over the width
# the lower ply has its families at 0 and 90 degrees, the upper one at 45 and -45
ANGLES = (0.0, np.pi / 4)


def two_plies(make, *, length=1.1 * LENGTH, uneven=0.0):
    """The plies one on the other around z = 0; the upper one ends at ``length``.

    uneven : part of the mean by which thickness and fibre mass grow over the length of a ply.
    """
    low, high = (-0.1 * LENGTH, -0.1 * WIDTH), (1.1 * LENGTH, 1.1 * WIDTH)
    meshes = []
    for nx, end, z in ((12, high[0], -0.5 * UPPER), (10, length, 0.5 * LOWER)):
        points, quads = make.grid(nx, 6, low, (end, high[1]))
        meshes.append((make.lifted(points) + [0.0, 0.0, z], quads))
    # also across, by a third, so that no two elements of a target are equal
    along = [(centres_of(mesh)[:, :2] / (LENGTH, WIDTH) - 0.5) @ (1.0, 1 / 3) for mesh in meshes]
    thickness = tuple(t * (1.0 + uneven * x) for t, x in zip((LOWER, UPPER), along))
    families = [
        [np.tile(unit(angle + turn), (len(quads), 1)) for turn in (0.0, np.pi / 2)]
        for angle, (_, quads) in zip(ANGLES, meshes)
    ]
    result = make.two_plies(
        *meshes,
        thickness=thickness,
        areal_fibre_mass=tuple(t * V * FIBRE_DENSITY for t in thickness),
        fibre_volume_fraction=(V, V),
        shear_angle=(0.0, 0.0),
        fibre_direction_1=tuple(pair[0] for pair in families),
        fibre_direction_2=tuple(pair[1] for pair in families),
    )
    result.attrs["fibre_density_kg_m3"] = FIBRE_DENSITY
    return result


def with_single_family_above(make, **arguments):
    """The same plies, of which the upper one has its first family alone, and is the thicker one."""
    result = two_plies(make, **arguments)
    upper = result["body"].values == 1
    for axis in "xyz":
        result[f"fibre_direction_2_{axis}"].values[:, upper] = np.nan
    result["thickness"].values[:, upper] *= 1.5
    result["areal_fibre_mass"].values[:, upper] *= 1.5
    return result


def centres_of(mesh):
    """Centres of the faces of a mesh."""
    points, quads = mesh
    return points[quads].mean(axis=1)


def of_laminate(plies=((LOWER, ANGLES[0]), (UPPER, ANGLES[1]))):
    """A, B and D about the middle of plies from below, each with both families mixed."""
    total = sum(thickness for thickness, _ in plies)
    Q, low = plane_stiffness(V), -0.5 * total
    A, B, D = np.zeros((3, 3, 3))
    for thickness, angle in plies:
        own = 0.5 * (at_angle(Q, angle) + at_angle(Q, angle + np.pi / 2))
        high = low + thickness
        A, B, D = A + own * thickness, B + own * (high**2 - low**2) / 2, D + own * (
            high**3 - low**3) / 3  # fmt: skip
        low = high
    return A, B, D


def case(lay_up, *, flat=False):
    """Tension along x of a strip that is free but for its motion as a whole."""
    text = f'lay_up = "{lay_up}"\nelements = "quadratic"\n'
    text += condition("supports", "a", point='"0 0 0 m"', fixed='["x", "y", "z"]')
    text += condition("supports", "b", point=f'"0 {WIDTH} 0 m"', fixed='["x", "z"]')
    text += condition("supports", "c", point=f'"{LENGTH} 0 0 m"', fixed='["z"]')
    if flat:
        fixed = '["z", "rx", "ry"]'
        text += condition("supports", "flat", plane=plane([0, 0, 1], 0.0), fixed=fixed)
    for name, end, sign in (("left", 0.0, -1.0), ("right", LENGTH, 1.0)):
        force = f'"{sign * FORCE} 0 0 N"'
        text += condition("loads", name, plane=plane([1, 0, 0], end), force=force)
    return structure_from_text(MATERIAL + text)


@pytest.fixture
def strip(make, write_mesh, tmp_path):
    """Map the stack onto a strip of shells and analyse it; returns report, cells and points."""

    def run(structure, *, turned=False, source=None, options=None, name="strip"):
        points, quads = make.grid(24, 6, high=(LENGTH, WIDTH))
        quads = quads[:, ::-1] if turned else quads
        mesh = write_mesh(make.lifted(points), [("quad", quads)], "mesh.vtu")
        mapped = tmp_path / f"{name}.nc"
        map_file(two_plies(make) if source is None else source, mesh, mapped, picture=False)
        report = analyse(
            mapped, mesh, structure, name=name, out_dir=tmp_path,
            options=options or SolverOptions(picture=False),
        )  # fmt: skip
        with xr.open_dataset(tmp_path / f"{name}_calculix.nc") as opened:
            cells = opened.load()
        return report, cells, meshio.read(tmp_path / f"{name}_calculix.vtu")

    return run


def middle_of(make, cells, kind, half_width=0.009):
    """Mean strain or stress (3,) in the middle of the strip, away from where the forces act."""
    points, quads = make.grid(24, 6, high=(LENGTH, WIDTH))
    away = np.abs(points[quads].mean(axis=1) - [0.5 * LENGTH, 0.5 * WIDTH])
    inside = (away < [0.02, half_width]).all(axis=1)
    return np.array([cells[f"{kind}_{c}"].values[inside].mean() for c in ("11", "22", "12")])


def curvature(result):
    """Curvature -d²w/dx² of the middle of the strip, the mean over its width."""
    w = result.point_data["structural_displacement"][:, 2]
    x, y = result.points[:, 0] - 0.5 * LENGTH, result.points[:, 1]
    inside = np.abs(x) < 0.03
    x, y = x[inside], y[inside]
    columns = np.stack([x * x, x, y, y * y, x * y, np.ones_like(x)], axis=1)
    return -2.0 * np.linalg.lstsq(columns, w[inside])[0][0]


@needs_calculix
@pytest.mark.parametrize("lay_up", ["plies", "interleaved"])
def test_in_tension_the_membrane_stiffness_is_the_sum_of_the_plies(make, strip, lay_up):
    """The plate held flat: N = A e with A = sum of Q_i t_i, whatever lies above the other."""
    report, cells, _ = strip(case(lay_up, flat=True))
    assert report.solved and report.elements == ["S8R"]
    A, _, _ = of_laminate()
    expected = np.linalg.solve(A, [FORCE / WIDTH, 0.0, 0.0])
    found = middle_of(make, cells, "strain")
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())
    for component, row, column in (("11", 0, 0), ("22", 1, 1), ("12", 0, 1), ("66", 2, 2)):
        of_cells = cells[f"laminate_A_{component}"].values
        np.testing.assert_allclose(of_cells, A[row, column], rtol=1e-6)


@needs_calculix
@pytest.mark.parametrize("turned", [False, True])
def test_free_in_tension_the_stack_bends_as_laminate_theory_says(make, strip, turned):
    """Strain and curvature of [A B; B D]; the same whichever way the normals of the cells look."""
    report, cells, result = strip(case("plies"), turned=turned)
    A, B, D = of_laminate()
    load = np.array([FORCE / WIDTH, 0.0, 0.0, 0.0, 0.0, 0.0])
    strain = np.linalg.solve(np.block([[A, B], [B, D]]), load)
    np.testing.assert_allclose(
        middle_of(make, cells, "strain"), strain[:3], atol=3e-3 * np.abs(strain[:3]).max()
    )
    # the whole section bears the force: both plies, each with its own thickness
    stress = middle_of(make, cells, "stress", half_width=WIDTH)
    assert stress[0] == pytest.approx(FORCE / (WIDTH * TOTAL), rel=1e-3)
    assert curvature(result) == pytest.approx(strain[3], rel=0.005)
    assert abs(strain[3]) * TOTAL > 0.05 * strain[0], "the stack must bend"
    of_cells = cells["laminate_B_11"].values
    np.testing.assert_allclose(of_cells, (-1.0 if turned else 1.0) * B[0, 0], rtol=1e-6)
    np.testing.assert_allclose(cells["laminate_D_11"].values, D[0, 0], rtol=1e-6)
    assert not any("mixed over the thickness" in warning for warning in report.warnings)


@needs_calculix
def test_layers_of_solids_are_the_plies(make, write_mesh, tmp_path):
    """One layer of cells for each ply: the same strip, free in tension."""
    points, quads = make.grid(24, 6, high=(LENGTH, WIDTH))
    heights = np.array([-0.5 * TOTAL, -0.5 * TOTAL + LOWER, 0.5 * TOTAL])
    nodes, cells = make.bricks(points, quads, heights, lambda p, z: make.lifted(p) + [0, 0, z])
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    map_file(two_plies(make), mesh, tmp_path / "solid.nc", picture=False)
    text = 'elements = "quadratic"\n'
    low = f"{heights[0]} m"
    for name, place, fixed in (("a", f"0 0 {low}", '["x", "y", "z"]'),
                               ("b", f"0 {WIDTH} {low}", '["x", "z"]'),
                               ("c", f"{LENGTH} 0 {low}", '["z"]')):  # fmt: skip
        text += condition("supports", name, point=f'"{place}"', fixed=fixed)
    pressure = f'"{-FORCE / (WIDTH * TOTAL)} Pa"'
    for name, end in (("left", 0.0), ("right", LENGTH)):
        text += condition("loads", name, plane=plane([1, 0, 0], end), pressure=pressure)
    analyse(
        tmp_path / "solid.nc", mesh, structure_from_text(MATERIAL + text), name="solid",
        out_dir=tmp_path, options=SolverOptions(picture=False),
    )  # fmt: skip
    A, B, D = of_laminate()
    load = np.array([FORCE / WIDTH, 0.0, 0.0, 0.0, 0.0, 0.0])
    strain = np.linalg.solve(np.block([[A, B], [B, D]]), load)
    result = meshio.read(tmp_path / "solid_calculix.vtu")
    x, y, z = result.points.T
    displacement = result.point_data["structural_displacement"]
    line = (np.abs(y - 0.5 * WIDTH) < 1e-9) & (np.abs(x - 0.5 * LENGTH) < 0.05)
    upper = line & (np.abs(z - heights[2]) < 1e-9)
    lower = line & (np.abs(z - heights[0]) < 1e-9)
    along = [np.polyfit(x[on], displacement[on, 0], 1)[0] for on in (lower, upper)]
    assert np.mean(along) == pytest.approx(strain[0], rel=0.01)
    assert along[1] - along[0] == pytest.approx(strain[3] * TOTAL, rel=0.03)


def layers_in_deck(folder, name="strip"):
    """Thickness of every layer of each element, from the lowest to the highest."""
    found, cell = {}, 0
    for line in (folder / f"{name}_calculix_sections.inp").read_text().splitlines():
        if line.startswith("*SHELL SECTION"):
            assert line.endswith("COMPOSITE")
            cell = int(line.split("LCM_E")[1].split(",")[0])
            found[cell] = []
        elif line.startswith("*"):
            cell = 0
        elif cell:
            thickness, _, material, _ = (word.strip() for word in line.split(","))
            found[cell].append((float(thickness), int(material.rpartition("_")[2])))
    return found


@needs_calculix
def test_where_a_ply_ends_the_elements_have_the_layers_that_are_left(make, strip, tmp_path):
    report, _, _ = strip(case("plies"), source=two_plies(make, length=0.5 * LENGTH))
    assert report.solved
    layers = layers_in_deck(tmp_path)
    counts = np.array([len(layers[number]) for number in sorted(layers)])
    points, quads = make.grid(24, 6, high=(LENGTH, WIDTH))
    x = points[quads].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(counts, np.where(x < 0.5 * LENGTH, 2, 1))
    thickness = np.array([sum(t for t, _ in layers[number]) for number in sorted(layers)])
    away = np.abs(x - 0.5 * LENGTH) > 0.01  # the thickness is the mean at the nodes
    expected = np.where(x < 0.5 * LENGTH, TOTAL, LOWER)
    np.testing.assert_allclose(thickness[away], expected[away], rtol=1e-6)


@needs_calculix
@pytest.mark.parametrize("length", [1.1 * LENGTH, 0.5 * LENGTH])
def test_calculix_has_room_for_layers_where_no_element_is_as_thick_as_its_neighbour(
    make, strip, length
):
    """Six layers, or three beside six: the mean strain along the strip is that of its sections."""
    source = two_plies(make, length=length, uneven=0.1)
    report, cells, _ = strip(case("symmetric", flat=True), source=source)
    assert report.solved
    assert len(np.unique(cells["deck_thickness"].values.round(9))) > 20
    points, quads = make.grid(24, 6, high=(LENGTH, WIDTH))
    x = points[quads].mean(axis=1)[:, 0]
    around = np.abs(x - 0.3 * LENGTH) < 0.02
    force = (cells["stress_11"].values * cells["deck_thickness"].values)[around].mean() * WIDTH
    assert force == pytest.approx(FORCE, rel=2e-3)
    A, _, _ = of_laminate()
    thinner = 1.0 + 0.1 * (0.3 - 0.5)
    expected = np.linalg.solve(A, [FORCE / WIDTH, 0.0, 0.0])[0] / thinner
    assert cells["strain_11"].values[around].mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("lay_up", "expected"),
    [
        ("plies", [(LOWER, 1), (UPPER, 2)]),
        ("stacked", [(0.6 * LOWER, 1), (0.4 * LOWER, 2), (0.6 * UPPER, 3), (0.4 * UPPER, 4)]),
        ("symmetric", [(0.3 * LOWER, 1), (0.4 * LOWER, 2), (0.3 * LOWER, 1),
                       (0.3 * UPPER, 3), (0.4 * UPPER, 4), (0.3 * UPPER, 3)]),
    ],
)  # fmt: skip
def test_layers_follow_the_order_of_the_plies(make, strip, tmp_path, lay_up, expected, turned):
    """From below along the normal of the cell, which may look either way."""
    structure = structure_from_text(MATERIAL + f'family_1_share = 0.6\nlay_up = "{lay_up}"\n')
    strip(structure, turned=turned, options=SolverOptions(run=False))
    expected = expected[::-1] if turned else expected
    layers = layers_in_deck(tmp_path)
    assert len(layers) == 144
    for found in layers.values():
        assert [kind for _, kind in found] == [kind for _, kind in expected]
        np.testing.assert_allclose([t for t, _ in found], [t for t, _ in expected], rtol=1e-6)


@pytest.mark.parametrize("turned", [False, True])
def test_families_of_a_ply_left_alone_follow_the_order_of_the_stack(make, strip, tmp_path, turned):
    """Beyond the end of the upper ply, too, the first family lies below the second."""
    structure = structure_from_text(MATERIAL + 'family_1_share = 0.6\nlay_up = "stacked"\n')
    strip(
        structure, turned=turned, source=two_plies(make, length=0.5 * LENGTH),
        options=SolverOptions(run=False),
    )  # fmt: skip
    alone = [[kind for _, kind in found] for found in layers_in_deck(tmp_path).values()][-12:]
    assert alone == [[2, 1] if turned else [1, 2]] * 12


def test_an_order_that_the_file_does_not_tell_is_asked_for(make, write_mesh, tmp_path):
    points, quads = make.grid(4, 2, high=(LENGTH, WIDTH))
    mesh = write_mesh(make.lifted(points), [("quad", quads)])
    map_file(two_plies(make), mesh, tmp_path / "m.nc", picture=False)
    with xr.open_dataset(tmp_path / "m.nc", mask_and_scale=False) as opened:
        mapped = opened.load()
    np.testing.assert_allclose(mapped["ply_height_under"], -0.5 * UPPER, rtol=1e-9)
    np.testing.assert_allclose(mapped["ply_height_over"], 0.5 * LOWER, rtol=1e-9)
    assert mapped["ply_height_over"].attrs["units"] == "m"
    without = mapped.drop_vars("ply_height_under")
    structure = structure_from_text(MATERIAL + 'lay_up = "plies"\n')
    with pytest.raises(InputError, match="lay_up: needs the order of the plies in every cell"):
        analyse(without, mesh, structure, name="m", out_dir=tmp_path)


@needs_calculix
def test_a_part_where_the_leading_ply_has_fewer_families_than_others_has_its_largest_strain(
    make, strip, tmp_path
):
    """The upper ply leads where it lies: it has no second family, the lower one has."""
    source = with_single_family_above(make, length=0.5 * LENGTH)
    report, cells, _ = strip(case("plies", flat=True), source=source)
    second = cells["elastic_fibre_strain_2"].values
    assert np.isnan(second).any() and np.isfinite(second).any()
    first = cells["elastic_fibre_strain_1"].values
    assert report.fibre_strain_max == np.nanmax(np.abs([first, second]))
    told = json.loads((tmp_path / "strip_calculix.json").read_text())
    assert told["fibre_strain_max"] == report.fibre_strain_max


def test_solids_of_a_ply_with_one_family_are_refused_by_their_numbers(make, write_mesh, tmp_path):
    points, quads = make.grid(4, 2, high=(LENGTH, WIDTH))
    heights = np.array(
        [-0.5 * LOWER - 0.75 * UPPER, 0.5 * LOWER - 0.75 * UPPER, 0.5 * LOWER + 0.75 * UPPER]
    )
    nodes, cells = make.bricks(points, quads, heights, lambda p, z: make.lifted(p) + [0, 0, z])
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    map_file(with_single_family_above(make), mesh, tmp_path / "m.nc", picture=False)
    structure = structure_from_text(MATERIAL)
    with pytest.raises(InputError, match=r"largest share has one in 8 cells \(cell 9, 10, 11"):
        analyse(tmp_path / "m.nc", mesh, structure, name="m", out_dir=tmp_path)
