"""CalculiX on mapped decks, against plates with an exact solution (Navier's series)."""

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.mapping import map_file
from lcmchain.mapping.structure import SolverOptions, analyse
from lcmchain.scene import structure_from_text
from lcmchain.scene.structure import Fibre, Resin

from .conftest import (
    MATERIAL,
    SIDE,
    THICKNESS,
    V,
    condition,
    needs_calculix,
    plane,
    simply_supported,
)

pytestmark = needs_calculix

PRESSURE = 1000.0  # [Pa]
OPENING = np.radians(25.0)  # both families at this angle from x: 40 degrees from perpendicular


def plane_stiffness(v):
    """Reduced stiffness (3, 3) of a ply along x after Chamis, rows 11, 22, 12; written apart."""
    fibre, resin = Fibre(preset="T300"), Resin(preset="MY750")
    s = np.sqrt(v)
    E1, nu12 = v * fibre.E1 + (1 - v) * resin.E, v * fibre.nu12 + (1 - v) * resin.nu
    E2 = resin.E / (1 - s * (1 - resin.E / fibre.E2))
    G12 = resin.shear / (1 - s * (1 - resin.shear / fibre.G12))
    q = 1 - nu12**2 * E2 / E1
    return np.array([[E1, nu12 * E2, 0], [nu12 * E2, E2, 0], [0, 0, G12 * q]]) / q


def at_angle(Q, angle):
    """The same of a ply at an angle (Jones, eq. 2.80)."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s],
                  [-c * s, c * s, c * c - s * s]])  # fmt: skip
    R = np.diag([1.0, 1.0, 2.0])
    return np.linalg.inv(T) @ Q @ R @ T @ np.linalg.inv(R)


def density(v):
    return v * 1760.0 + (1 - v) * 1200.0


def navier(D, mass, side=SIDE):
    """Deflection of the middle under PRESSURE [m], and the lowest frequencies [Hz]."""
    m, n = (k.ravel() for k in np.meshgrid(np.arange(1, 40), np.arange(1, 40)))
    a, b = m * np.pi / side, n * np.pi / side
    stiffness = D[0, 0] * a**4 + 2 * (D[0, 1] + 2 * D[2, 2]) * (a * b) ** 2 + D[1, 1] * b**4
    load = np.where((m % 2) & (n % 2), 16 * PRESSURE / (np.pi**2 * m * n), 0.0)
    shape = np.sin(0.5 * np.pi * m) * np.sin(0.5 * np.pi * n)
    return (load * shape / stiffness).sum(), np.sort(np.sqrt(stiffness / mass))[:6] / (2 * np.pi)


def smeared(opening=OPENING):
    Q = plane_stiffness(V)
    return 0.5 * (at_angle(Q, opening) + at_angle(Q, -opening)) * THICKNESS**3 / 12


def loaded(elements, place=""):
    text = f'elements = "{elements}"\nfrequencies = 4\n' + simply_supported(not place)
    entries = {"pressure": f'"{PRESSURE} Pa"'} | ({"plane": place} if place else {})
    return text + condition("loads", "pressure", **entries)


def middle(tmp_path, name="plate_calculix.vtu"):
    """Deflection of the node next to the middle of the plate [m]."""
    mesh = meshio.read(tmp_path / name)
    away = np.linalg.norm(mesh.points - [0.5 * SIDE, 0.5 * SIDE, 0.0], axis=1)
    return mesh.point_data["structural_displacement"][np.argmin(away), 2]


@pytest.mark.parametrize(
    ("cells", "count", "elements", "kind"),
    [
        ("quad", 8, "quadratic", "S8R"),
        ("quad", 32, "as_mesh", "S4"),
        ("triangle", 10, "quadratic", "S6"),
        ("hexahedron", 8, "quadratic", "C3D20R"),
        ("hexahedron", 24, "as_mesh", "C3D8I"),
        ("wedge", 12, "quadratic", "C3D15"),
    ],
)
def test_plate_with_families_that_are_not_perpendicular(
    solve, tmp_path, cells, count, elements, kind
):
    """Static and the first three frequencies within 2 % of Navier's series."""
    place = "" if cells in ("quad", "triangle") else plane([0, 0, 1], -0.5 * THICKNESS)
    report = solve(cells, loaded(elements, place), angles=(OPENING, -OPENING), count=count)
    assert report.solved and report.elements == [kind]
    assert np.degrees(report.second_family_error_max) == pytest.approx(40.0, abs=1e-6)
    deflection, frequencies = navier(smeared(), density(V) * THICKNESS)
    assert middle(tmp_path) == pytest.approx(deflection, rel=0.02)
    np.testing.assert_allclose(report.eigenfrequencies[:3], frequencies[:3], rtol=0.02)
    # Told apart from the plate whose second family is taken as perpendicular.
    Q = plane_stiffness(V)
    square = 0.5 * (at_angle(Q, OPENING) + at_angle(Q, OPENING - np.pi / 2)) * THICKNESS**3 / 12
    others = navier(square, density(V) * THICKNESS)[1]
    assert np.abs(others[:3] / frequencies[:3] - 1.0).max() > 0.1


def test_layers_couple_bending_and_extension(solve, tmp_path):
    """Two perpendicular plies one above the other: Navier's series with B11 = -B22 (Reddy,

    Mechanics of Laminated Composite Plates and Shells, 2nd edition (2004), section 6.3).
    """
    case = loaded("quadratic") + ""
    report = solve("quad", 'lay_up = "stacked"\n' + case)
    Q = plane_stiffness(V)
    plies, t = (Q, at_angle(Q, np.pi / 2)), THICKNESS
    A = sum(plies) * t / 2
    B = (plies[1] - plies[0]) * t**2 / 8
    D = sum(plies) * t**3 / 24
    deflection = 0.0
    for m in range(1, 40, 2):
        for n in range(1, 40, 2):
            a, b = m * np.pi / SIDE, n * np.pi / SIDE
            shear = A[0, 1] + A[2, 2]
            stretch = np.array([[A[0, 0] * a * a + A[2, 2] * b * b, shear * a * b],
                                [shear * a * b, A[2, 2] * a * a + A[1, 1] * b * b]])  # fmt: skip
            mixed = np.array([-B[0, 0] * a**3, -B[1, 1] * b**3])
            bend = D[0, 0] * a**4 + 2 * (D[0, 1] + 2 * D[2, 2]) * (a * b) ** 2 + D[1, 1] * b**4
            stiffness = bend - mixed @ np.linalg.solve(stretch, mixed)
            sign = np.sin(0.5 * m * np.pi) * np.sin(0.5 * n * np.pi)
            deflection += 16 * PRESSURE / (np.pi**2 * m * n) * sign / stiffness
    uncoupled = navier(D, 1.0)[0]
    assert deflection > 1.3 * uncoupled
    assert middle(tmp_path) == pytest.approx(deflection, rel=0.02)
    assert any("rigid" in warning for warning in report.warnings)
    with xr.open_dataset(tmp_path / "plate_calculix.nc") as results:
        for name, expected in (("A", A), ("B", B), ("D", D)):
            for component, row, column in (("11", 0, 0), ("22", 1, 1), ("12", 0, 1), ("66", 2, 2)):
                found = results[f"laminate_{name}_{component}"].values
                scale = np.abs(expected).max()
                np.testing.assert_allclose(found, expected[row, column], atol=1e-9 * scale)


def test_millimetres_and_metres_give_the_same_part(solve, tmp_path):
    found = {}
    for units in ("m-kg-s", "mm-t-s"):
        report = solve("quad", f'units = "{units}"\n' + loaded("quadratic"), count=4)
        found[units] = middle(tmp_path), *report.eigenfrequencies[:3]
    np.testing.assert_allclose(found["mm-t-s"], found["m-kg-s"], rtol=2e-5)


def frequencies_of(kit, write_mesh, tmp_path, turned_over, signs):
    """Frequencies of a plate with families at 10 and 60 degrees, three sides free."""
    points, ((cells, nodes),) = kit.plate("quad", count=6)
    mesh = write_mesh(points, [(cells, nodes[:, ::-1] if turned_over else nodes)], "mesh.vtu")
    source = kit.formed(np.radians([10.0, 60.0]))
    for family, sign in zip((1, 2), signs):
        for axis in "xyz":
            source[f"fibre_direction_{family}_{axis}"] *= sign
    map_file(source, mesh, tmp_path / "plate.nc", picture=False)
    clamp = condition("supports", "clamp", plane=plane([1, 0, 0], 0.0),
                      fixed='["x", "y", "z", "rx", "ry", "rz"]')  # fmt: skip
    case = structure_from_text(MATERIAL + "frequencies = 4\n" + clamp)
    report = analyse(tmp_path / "plate.nc", mesh, case, name="p", out_dir=tmp_path,
                     options=SolverOptions(picture=False))  # fmt: skip
    return np.array(report.eigenfrequencies)


def test_neither_normals_nor_signs_of_fibres_mirror_the_material(kit, write_mesh, tmp_path):
    """A family on the wrong side of the first would change the coupling of bending and torsion."""
    expected = frequencies_of(kit, write_mesh, tmp_path, False, (1, 1))
    for turned_over in (False, True):
        for signs in ((1, -1), (-1, 1)):
            found = frequencies_of(kit, write_mesh, tmp_path, turned_over, signs)
            np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_weight_is_the_pressure_of_the_mass(solve, tmp_path):
    weight = density(V) * THICKNESS * 9.81
    held = simply_supported(shell=True)
    found = []
    for load in ({"acceleration": '"0 0 -9.81 m/s^2"'}, {"pressure": f'"{-weight} Pa"'}):
        solve("quad", held + condition("loads", "load", **load), count=4)
        found.append(middle(tmp_path))
    assert found[0] == pytest.approx(found[1], rel=1e-4) and found[0] < 0.0


def test_a_force_on_a_set_is_the_sum_over_its_corner_nodes(solve, tmp_path):
    held = condition("supports", "held", plane=plane([1, 0, 0], 0.0))
    push = condition("loads", "push", plane=plane([1, 0, 0], SIDE), force='"1 0 -3 N"')
    solve("quad", held + push, count=4, options=SolverOptions(run=False))
    lines = (tmp_path / "plate_calculix.inp").read_text().splitlines()
    start = lines.index("*CLOAD") + 1
    forces = [line.split(", ") for line in lines[start : lines.index("U", start) - 1]]
    total = {d: sum(float(f) for _, degree, f in forces if degree == d) for d in "123"}
    assert len(forces) == 10  # five corner nodes, without the nodes between them
    assert total == pytest.approx({"1": 1.0, "2": 0.0, "3": -3.0})
