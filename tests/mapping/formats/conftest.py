"""A sheared bowl mapped onto a mesh of both cell shapes with numbers and sets of its own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.mapping import compute_weights, read_sheet, read_target, transfer
from lcmchain.mapping.files import mapped_dataset
from lcmchain.mapping.report import mapping_report


def permeability(points, faces, make, anisotropy):
    """Principal values and axes on the faces, larger first; the larger axis turns over the part."""
    first, _ = make.families(points, faces)
    normal = make.area_vectors(points, faces)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    centre = points[faces].mean(axis=1)
    turn = 1.2 * np.sin(5.0 * centre[:, 0])
    axis = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(normal, first)
    larger = 1e-10 * (1.0 + 2.0 * centre[:, 1] ** 2)
    ratio = 1.0 + anisotropy * np.abs(centre[:, 0])
    return {
        "permeability_1": larger,
        "permeability_2": larger / ratio,
        "permeability_3": 0.1 * larger,
        "permeability_direction_1": axis,
        "permeability_direction_2": np.cross(normal, axis),
        "permeability_direction_3": normal,
    }


@pytest.fixture(scope="session")
def part(make, tmp_path_factory):
    """Map a sheared bowl: ``part(**changes)`` gives dataset, target, fields and report.

    Cells are numbered from 9001 downwards in steps, nodes from 501; cells 0 to 3 are the set
    "Inlet", the last two are "vent", node 7 is the set "corner".
    """
    folder = tmp_path_factory.mktemp("part")

    def build(*, shear=0.6, anisotropy=1.0, with_permeability=True, number_from=9001, low=-0.9):
        points2, faces = make.grid(16, 16, (-1.0, -1.0), (1.0, 1.0), jitter=0.1)
        points = make.bowl(points2)
        first, second = make.families(points, faces)
        # The shear varies and changes its sign; fibres have no head, so some point backwards.
        angle = shear * np.sin(3.0 * points[faces].mean(axis=1)[:, :1])
        signs = np.where(np.random.default_rng(1).random(len(faces)) < 0.5, -1.0, 1.0)[:, None]
        fields = {
            "thickness": lambda c: 1e-3 * (1.0 + 0.2 * c[:, 0]),
            "fibre_volume_fraction": lambda c: 0.5 + 0.05 * c[:, 1],
            "areal_fibre_mass": lambda c: 0.9 + 0.1 * c[:, 0],
            "shear_angle": angle[:, 0],
            "fibre_direction_1": signs * first,
            "fibre_direction_2": np.sin(angle) * first + np.cos(angle) * second,
        }
        if with_permeability:
            fields |= permeability(points, faces, make, anisotropy)
        formed = make.forming_result(points, faces, **fields)
        for number in (1, 2, 3) if with_permeability else ():
            formed[f"permeability_{number}"].attrs["units"] = "m2"
        sheet = read_sheet(formed)
        flat, quads = make.grid(9, 8, (low, -0.9), (0.9, 0.9), jitter=0.1, seed=5)
        cut = len(quads) // 2
        cells = [("quad", quads[:cut]), ("triangle", make.triangles_of(quads[cut:]))]
        meshio.Mesh(make.bowl(flat), cells).write(folder / "target.vtu")
        read = read_target(folder / "target.vtu", kind="infiltration")
        count, nodes = read.cell_count, len(read.points)
        target = replace(
            read,
            cell_ids=number_from - 3 * np.arange(count),
            node_ids=501 + 2 * np.arange(nodes),
            cell_sets={"Inlet": np.arange(4), "vent": np.array([count - 2, count - 1])},
            node_sets={"corner": np.array([7])},
        )
        weights = compute_weights(sheet, target, maximum_distance=0.05)
        fields_mapped = transfer(sheet, target, weights)
        report = mapping_report(
            sheet, target, weights, fields_mapped, name="bowl", kind="infiltration"
        )
        report.files = {"netcdf": "bowl.nc"}
        dataset = mapped_dataset(
            sheet, target, weights, fields_mapped, report, command="lcmchain map"
        )
        return SimpleNamespace(
            dataset=dataset, target=target, fields=fields_mapped, sheet=sheet, weights=weights
        )

    return build


@pytest.fixture(scope="session")
def bowl(part):
    """The part as it is."""
    return part()


@pytest.fixture
def flat_stack(make, tmp_path):
    """Write two flat plies of unlike shear; the upper one is short and thins along x.

    ``flat_stack(order)`` gives the file, what is the thickness [m] of a ply, 0 the lower one, at x
    [m], and the names of both, as the result has them in this order.
    """
    thick, middle = (1.2e-3, 0.8e-3), (-0.4e-3, 0.6e-3)

    def thickness(ply, x):
        return thick[ply] * (1.0 + 0.2 * ply * x)

    def build(order):
        meshes, families, thicknesses = [], [], []
        for ply in order:
            flat, faces = make.grid(18 - 9 * ply, 18, (-0.9, -0.9), (0.9 - 0.9 * ply, 0.9))
            points = make.lifted(flat) + [0.0, 0.0, middle[ply]]
            meshes.append((points, faces))
            families.append(make.families(points, faces, (0.3, -0.5)[ply]))
            thicknesses.append(lambda c, ply=ply: thickness(ply, c[:, 0]))
        stack = make.two_plies(
            *meshes,
            thickness=thicknesses,
            fibre_direction_1=[pair[0] for pair in families],
            fibre_direction_2=[pair[1] for pair in families],
        )
        write_netcdf(tmp_path / "forming.nc", {"/": stack})
        names = [("under", "over")[order.index(ply)] for ply in (0, 1)]
        return tmp_path / "forming.nc", thickness, names

    return build


@pytest.fixture
def vectors():
    """Read a vector field of a mapped dataset, shape (C, 3)."""
    return lambda dataset, name: np.stack([dataset[f"{name}_{a}"].values for a in "xyz"], axis=1)


@pytest.fixture
def numbered():
    """Give the cells of a mapped part other numbers, in the dataset and in the target."""

    def change(part, numbers):
        dataset = part.dataset.copy(deep=True)
        dataset["cell_id"] = (dataset["cell_id"].dims, numbers, dataset["cell_id"].attrs)
        return dataset, replace(part.target, cell_ids=numbers)

    return change
