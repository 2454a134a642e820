"""CalculiX on mapped blocks under uniform stress: every constant and every axis in its place."""

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.mapping.structure import SolverOptions, analyse
from lcmchain.mapping.structure.stiffness import chamis, homogenised, ply_stiffness, turned
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene import structure_from_text
from lcmchain.scene.structure import Fibre, Resin

from .conftest import MATERIAL, condition, needs_calculix, plane

pytestmark = needs_calculix

V, STRESS = 0.45, 1e6
PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def block(cells, warp):
    """A box of 3 x 2 x 2 cells, inner nodes moved by ``warp``: points, cells."""
    x, y, z = np.linspace(0, 3, 4), np.linspace(0, 2, 3), np.linspace(0, 2, 3)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, z, indexing="ij")], axis=1)
    inner = ((points > 0) & (points < [3, 2, 2])).all(axis=1)
    points[inner] += warp * np.random.default_rng(1).uniform(-1, 1, (inner.sum(), 3))
    n = np.arange(36).reshape(4, 3, 3)
    starts = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ]
    c = [n[i : i + 3, j : j + 2, k : k + 2].ravel() for i, j, k in starts]
    hexahedra = np.stack(c, axis=1)
    if cells == "hexahedron":
        return points, hexahedra
    if cells == "wedge":
        return points, np.concatenate([hexahedra[:, [0, 1, 2, 4, 5, 6]],
                                       hexahedra[:, [0, 2, 3, 4, 6, 7]]])  # fmt: skip
    split = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return points, np.concatenate([hexahedra[:, list(s)] for s in split])


def mapped(points, count, first, second):
    """Dataset of a mapping with one state in every cell."""
    data = xr.Dataset()
    data["target"] = (
        (),
        np.int32(0),
        {
            "cf_role": "mesh_topology",
            "node_coordinates": "target_node_x target_node_y target_node_z",
        },
    )
    for axis, values in zip("xyz", points.T):
        data[f"target_node_{axis}"] = ("target_node", values, {"axis": axis.upper()})
    data["thickness"] = ("target_volume", np.full(count, 1e-3))
    data["fibre_volume_fraction"] = ("target_volume", np.full(count, V))
    for name, vector in (("1", first), ("2", second)):
        for axis, value in zip("xyz", vector):
            data[f"fibre_direction_{name}_{axis}"] = ("target_volume", np.full(count, value))
    return data


def compliance_in_space(first, second):
    """Full stiffness in global axes, from the plies' tensors turned in space; as compliance."""
    ply = ply_stiffness(chamis(Fibre(preset="T300"), Resin(preset="MY750"), np.array([V])))
    third = np.cross(first, second)
    third /= np.linalg.norm(third)
    across = np.cross(third, first)
    angle = np.array([np.arctan2(second @ across, second @ first)])
    C = homogenised([ply, turned(ply, angle)], [0.5, 0.5])[0]
    axes = np.stack([first, across, third])
    full = np.zeros((3, 3, 3, 3))
    for row, (i, j) in enumerate(PAIRS):
        for column, (k, m) in enumerate(PAIRS):
            for a, b in {(i, j), (j, i)}:
                for c, d in {(k, m), (m, k)}:
                    full[a, b, c, d] = C[row, column]
    full = np.einsum("ai,bj,ck,dl,abcd->ijkl", axes, axes, axes, axes, full)
    return np.linalg.inv([[full[*a, *b] for b in PAIRS] for a in PAIRS]), axes


@pytest.mark.parametrize(
    ("cells", "elements", "kind", "warp"),
    [
        ("hexahedron", "as_mesh", "C3D8I", 0.0),  # fails the patch test where it is warped
        ("hexahedron", "quadratic", "C3D20R", 0.15),
        ("wedge", "as_mesh", "C3D6", 0.15),
        ("wedge", "quadratic", "C3D15", 0.15),
        ("tetra", "as_mesh", "C3D4", 0.15),
        ("tetra", "quadratic", "C3D10", 0.15),
    ],
)
def test_uniform_stress_in_a_block_of_any_orientation(tmp_path, cells, elements, kind, warp):
    """All 21 constants: tension along x, with families at 55 degrees in a plane anywhere."""
    points, nodes = block(cells, warp)
    turn = rotation(5)
    first = turn[:, 0]
    second = np.cos(np.radians(55)) * turn[:, 0] + np.sin(np.radians(55)) * turn[:, 1]
    ids = 100 + 3 * np.arange(len(nodes))
    target = TargetMesh(
        points, ((cells, nodes),), {}, cell_ids=ids, node_ids=np.arange(36)[::-1] + 7
    )
    case = MATERIAL + f'elements = "{elements}"\n'
    for name, point, fixed in (("a", "0 0 0 m", '["x","y","z"]'), ("b", "3 0 0 m", '["y","z"]'),
                               ("c", "0 2 0 m", '["z"]')):  # fmt: skip
        case += condition("supports", name, point=f'"{point}"', fixed=fixed)
    for name, end in (("left", 0.0), ("right", 3.0)):
        case += condition("loads", name, pressure=f'"{-STRESS} Pa"', plane=plane([1, 0, 0], end))
    report = analyse(
        mapped(points, len(nodes), first, second), target, structure_from_text(case), name="block",
        out_dir=tmp_path, options=SolverOptions(picture=False),
    )  # fmt: skip
    assert report.elements == [kind]
    S, axes = compliance_in_space(first, second)
    e = STRESS * S[:, 0]
    # Supports hold the x axis on itself, and the y axis in the plane z = 0.
    gradient = np.array([[e[0], e[3], e[4]], [0.0, e[1], e[5]], [0.0, 0.0, e[2]]])
    result = meshio.read(tmp_path / "block_calculix.vtu")
    found = result.point_data["structural_displacement"]
    expected = result.points @ gradient.T
    np.testing.assert_allclose(found, expected, atol=2e-5 * np.abs(expected).max())
    np.testing.assert_array_equal(result.cell_data["cell_id"][0], ids)

    stress = axes @ np.diag([STRESS, 0.0, 0.0]) @ axes.T
    strain = axes @ np.array([[e[0], e[3] / 2, e[4] / 2], [e[3] / 2, e[1], e[5] / 2],
                              [e[4] / 2, e[5] / 2, e[2]]]) @ axes.T  # fmt: skip
    for name, (i, j) in zip(("11", "22", "33", "12", "13", "23"), PAIRS):
        of_cells = result.cell_data[f"stress_{name}"][0]
        np.testing.assert_allclose(of_cells, stress[i, j], atol=1e-4 * STRESS)
        factor = 1.0 if i == j else 2.0
        np.testing.assert_allclose(
            result.cell_data[f"strain_{name}"][0],
            factor * strain[i, j],
            atol=1e-4 * np.abs(e).max(),
        )
    along_second = second @ axes.T @ strain @ axes @ second
    np.testing.assert_allclose(
        result.cell_data["elastic_fibre_strain_2"][0], along_second, rtol=1e-4
    )
