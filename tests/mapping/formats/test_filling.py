"""RTMsim and LCMsim: the mesh is read by meshio, the rest as the programs' manuals describe it."""

import csv
import json
from dataclasses import replace

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping.formats import export


def tensors(values, axis, normal):
    """Tensors in the plane, larger principal value along the axis, shape (C, 3, 3)."""
    across = np.cross(normal, axis)
    return sum(
        value[:, None, None] * vector[:, :, None] * vector[:, None, :]
        for value, vector in zip(values.T, (axis, across), strict=True)
    )


def projected(direction, normal):
    flat = direction - np.einsum("ci,ci->c", direction, normal)[:, None] * normal
    return flat / np.linalg.norm(flat, axis=1)[:, None]


def read_sets(path):
    """Sets of a mesh file by RTMsim's rule: continued by lines of eight blanks."""
    sets, open_set = [], False
    for text in path.read_text().splitlines():
        if text.startswith("SET"):
            sets.append([])
            open_set = True
        elif not text.startswith(" " * 8):
            open_set = False
        if open_set:
            sets[-1] += [int(number) for number in text[8:].replace(" ", "").split(",") if number]
            assert text[8:].rstrip(",").count(",") < 6
    return sets


def read_input(path):
    """Entries of RTMsim's input file: separated by one blank, comments behind them."""
    return [
        [entry for entry in text.split(" ") if not entry.startswith("#")]
        for text in path.read_text().splitlines()
    ]


def owner_of(mesh, target):
    """Cell of the target that each triangle of the file lies in."""
    centre = mesh.points[mesh.cells_dict["triangle"]].mean(axis=1)
    distance = np.linalg.norm(centre[:, None] - target.centroids[None], axis=2)
    return np.argmin(distance, axis=1)


@pytest.fixture(scope="module")
def rtmsim(bowl, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rtmsim")
    report = export(bowl.dataset, bowl.target, "rtmsim", folder / "bowl.rtmsim.txt")
    return folder, report


def test_meshio_reads_the_mesh(bowl, rtmsim):
    folder, report = rtmsim
    mesh = meshio.read(folder / "bowl.rtmsim.bdf", file_format="nastran")
    assert report.files == ["bowl.rtmsim.txt", "bowl.rtmsim.bdf"]
    target = bowl.target
    assert len(mesh.cells_dict["triangle"]) == target.cell_count + 36
    assert np.abs(mesh.points - target.points).max() < 1e-6
    area = np.cross(*np.diff(mesh.points[mesh.cells_dict["triangle"]], axis=1).transpose(1, 0, 2))
    assert 0.5 * np.linalg.norm(area, axis=1).sum() == pytest.approx(
        np.linalg.norm(target.surface.area_vectors, axis=1).sum(), rel=2e-3
    )
    assert np.array_equal(np.bincount(owner_of(mesh, target)), 1 + target.surface.is_quadrilateral)


def test_the_input_file_has_the_entries_that_rtmsim_reads(rtmsim):
    folder, _ = rtmsim
    entries = read_input(folder / "bowl.rtmsim.txt")
    assert [len(row) for row in entries] == [1, 1, 1, 4, 2, 7, 7, 7, 7, 7, 4, 2, 2, 1]
    assert entries[1] == ["bowl.rtmsim.bdf"]
    for row in entries[5:10]:
        thickness, porosity, permeability, alpha, *direction = map(float, row)
        assert 0.0 < porosity < 1.0 and thickness > 0.0 and permeability > 0.0 and alpha > 0.0
        assert np.linalg.norm(direction) == pytest.approx(1.0, abs=1e-8)


def test_inlet_and_vent_of_the_target_are_sets_of_their_kind(bowl, rtmsim):
    folder, _ = rtmsim
    sets = read_sets(folder / "bowl.rtmsim.bdf")
    kinds = read_input(folder / "bowl.rtmsim.txt")[10]
    assert kinds == ["1", "2", "2", "3"]
    target = bowl.target
    assert set(target.cell_ids[:4].tolist()) <= set(sets[0])
    assert len(sets[0]) == 8  # four quadrilaterals
    assert sets[3] == target.cell_ids[-2:].tolist()
    assert read_input(folder / "bowl.rtmsim.txt")[12][0] == "0"


def rtmsim_properties(folder, mesh):
    """Thickness, porosity and permeability tensor of each triangle, as RTMsim assigns them."""
    entries = read_input(folder / "bowl.rtmsim.txt")
    ids = [
        int(text[8:16])
        for text in (folder / "bowl.rtmsim.bdf").read_text().splitlines()
        if text.startswith("CTRIA3")
    ]
    row = np.zeros(len(ids), dtype=int)
    sets = read_sets(folder / "bowl.rtmsim.bdf")
    for number, (kind, members) in enumerate(zip(entries[10], sets, strict=False), start=1):
        if kind == "2":
            row[np.isin(ids, members)] = number
    rows = np.array([[float(entry) for entry in line] for line in entries[5:10]])[row]
    corners = mesh.points[mesh.cells_dict["triangle"]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    axis = projected(rows[:, 4:7], normal)
    values = np.stack([rows[:, 2], rows[:, 2] * rows[:, 3]], axis=1)
    return row, rows[:, 0], rows[:, 1], tensors(values, axis, normal)


def test_the_errors_of_the_classes_are_those_of_the_file(bowl, rtmsim, vectors):
    """Properties as RTMsim would assign them, against the mapped fields of each cell."""
    folder, report = rtmsim
    mesh = meshio.read(folder / "bowl.rtmsim.bdf", file_format="nastran")
    row, thickness, porosity, tensor = rtmsim_properties(folder, mesh)
    # Triangles of the target itself: a half of a warped quadrilateral has another normal.
    cell = owner_of(mesh, bowl.target)
    # The main preform is property 1; set 1 is the inlet, so that sets 2 and 3 are the next ones.
    assert np.array_equal(mesh.cell_data["nastran:ref"][0], np.maximum(row, 1))
    dataset = bowl.dataset
    values = np.stack([dataset[f"permeability_{n}"].values for n in (1, 2)], axis=1)
    exact = tensors(
        values, vectors(dataset, "permeability_direction_1"), bowl.target.surface.normals
    )
    off = (
        np.linalg.norm(tensor - exact[cell], axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))[cell]
    )
    found = dict(zip(("permeability", "porosity", "thickness"), report.losses, strict=False))
    single = ~bowl.target.surface.is_quadrilateral
    own = np.isin(cell, np.flatnonzero(single))
    assert off[own].max() <= found["permeability"].error * (1.0 + 1e-4)
    assert off.max() == pytest.approx(found["permeability"].error, rel=0.1)
    worst_cell = np.flatnonzero(bowl.target.cell_ids == found["permeability"].cell)[0]
    assert off[cell == worst_cell].max() == pytest.approx(found["permeability"].error, rel=0.1)
    wrong = np.abs(porosity / (1.0 - dataset["fibre_volume_fraction"].values[cell]) - 1.0)
    assert wrong.max() == pytest.approx(found["porosity"].error, rel=1e-6)
    wrong = np.abs(thickness / dataset["thickness"].values[cell] - 1.0)
    assert wrong.max() == pytest.approx(found["thickness"].error, rel=1e-6)
    assert found["permeability"].error > 0.05  # it is a rough description, and says so
    assert any("permeability tensor in the plane: wrong by up to" in w for w in report.warnings)


def test_the_pore_volume_is_that_of_the_cells(bowl, rtmsim):
    _, report = rtmsim
    table = report.details["classes"]
    dataset, area = bowl.dataset, bowl.target.surface.areas
    volume = area * dataset["thickness"].values * (1.0 - dataset["fibre_volume_fraction"].values)
    told = sum(row["area_m2"] * row["thickness_m"] * row["porosity"] for row in table)
    assert told == pytest.approx(volume.sum(), rel=1e-12)
    assert json.dumps(report.as_dict(), allow_nan=False)


def test_uniform_properties_are_one_exact_class(part, tmp_path):
    uniform = part(anisotropy=0.0)
    dataset = uniform.dataset.copy(deep=True)
    for name, value in (
        ("thickness", 1e-3), ("fibre_volume_fraction", 0.5),
        ("permeability_1", 2e-10), ("permeability_2", 2e-10),
    ):  # fmt: skip
        dataset[name].values[:] = value
    report = export(dataset, uniform.target, "rtmsim", tmp_path / "one.txt")
    assert len(report.details["classes"]) == 1
    assert max(loss.error for loss in report.losses[:3]) < 1e-12
    entries = read_input(tmp_path / "one.txt")
    assert entries[10] == ["1", "3", "0", "0"]


def test_two_regions_are_two_exact_classes(bowl, tmp_path):
    """Isotropic permeability of two values: no direction, nothing to project."""
    dataset = bowl.dataset.copy(deep=True)
    right = bowl.target.centroids[:, 0] > 0.0
    dataset["thickness"].values[:] = np.where(right, 2e-3, 1e-3)
    dataset["fibre_volume_fraction"].values[:] = np.where(right, 0.6, 0.5)
    for name in ("permeability_1", "permeability_2"):
        dataset[name].values[:] = np.where(right, 1e-11, 3e-10)
    report = export(dataset, bowl.target, "rtmsim", tmp_path / "two.txt")
    assert [row["porosity"] for row in report.details["classes"]] == pytest.approx(
        [0.4, 0.5] if bowl.target.surface.areas[right].sum()
        > bowl.target.surface.areas[~right].sum() else [0.5, 0.4]
    )  # fmt: skip
    assert max(loss.error for loss in report.losses[:3]) < 1e-12


def test_more_classes_leave_smaller_errors(bowl, rtmsim, tmp_path):
    _, few = rtmsim
    many = export(bowl.dataset, bowl.target, "lcmsim", tmp_path / "bowl.csv")
    assert len(many.details["classes"]) == 32
    for rough, fine in zip(few.losses[:3], many.losses[:3], strict=True):
        assert fine.mean < 0.7 * rough.mean
    assert many.losses[0].mean < 0.4 * few.losses[0].mean
    assert many.losses[0].error < few.losses[0].error


def test_lcmsim_reads_parts_and_their_properties(bowl, tmp_path):
    report = export(bowl.dataset, bowl.target, "lcmsim", tmp_path / "bowl.lcmsim.csv")
    mesh = meshio.read(tmp_path / "bowl.lcmsim.bdf", file_format="nastran")
    part = mesh.cell_data["nastran:ref"][0]
    with (tmp_path / "bowl.lcmsim.csv").open(newline="") as file:
        rows = {int(row["part_id"]): row for row in csv.DictReader(file)}
    assert set(rows) == set(part.tolist()) and max(rows) <= 127
    types = [row["type"] for row in rows.values()]
    assert types.count("base") == 1 and set(types) == {"base", "patch", "inlet", "outlet"}
    assert len({row["name"] for row in rows.values()}) == len(rows)
    kind = np.array([rows[number]["type"] for number in part])
    cell = owner_of(mesh, bowl.target)
    assert set(cell[kind == "inlet"].tolist()) == {0, 1, 2, 3}
    count = bowl.target.cell_count
    assert set(cell[kind == "outlet"].tolist()) == {count - 2, count - 1}
    porosity = np.array([float(rows[number]["porosity"]) for number in part])
    wrong = np.abs(porosity / (1.0 - bowl.dataset["fibre_volume_fraction"].values[cell]) - 1.0)
    assert wrong.max() == pytest.approx(report.losses[1].error, rel=1e-6)
    assert all(row["porosity_1"] == row["porosity"] for row in rows.values())


def test_without_permeability_one_error_says_how_to_get_it(part, tmp_path):
    dry = part(with_permeability=False)
    with pytest.raises(InputError, match=r"needs the permeability.*\[permeability\] table"):
        export(dry.dataset, dry.target, "rtmsim", tmp_path / "dry.txt")
    assert list(tmp_path.iterdir()) == []


def test_cells_without_permeability_are_named(bowl, tmp_path):
    dataset = bowl.dataset.copy(deep=True)
    dataset["permeability_2"].values[[7, 9]] = np.nan
    first, second = bowl.target.cell_ids[[7, 9]]
    with pytest.raises(
        InputError, match=rf"2 cells have no permeability \(cell {first}, {second}\)"
    ):
        export(dataset, bowl.target, "lcmsim", tmp_path / "hole.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_blank_in_the_name_is_an_error(bowl, tmp_path):
    with pytest.raises(InputError, match="holds a blank"):
        export(bowl.dataset, bowl.target, "rtmsim", tmp_path / "my part.txt")


def test_without_an_inlet_the_user_is_told(bowl, tmp_path):
    target = replace(bowl.target, cell_sets={})
    report = export(bowl.dataset, target, "rtmsim", tmp_path / "bowl.txt")
    entries = read_input(tmp_path / "bowl.txt")
    assert entries[10] == ["2", "2", "2", "2"] and entries[12][0] == "2"
    assert len(report.details["classes"]) == 5
    assert any('no set with "inlet"' in sentence for sentence in report.warnings)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("pressureinlet", ["1", "2", "2", "2"]),
        ("Injection-Gate", ["1", "2", "2", "2"]),
        ("VENT_2", ["2", "2", "2", "3"]),
        ("prevention", ["2", "2", "2", "2"]),
        ("between inlet and outlet", ["1", "2", "2", "2"]),
    ],
)
def test_ports_are_known_by_their_names(bowl, tmp_path, name, kinds):
    target = replace(bowl.target, cell_sets={name: np.array([4, 5])})
    dataset = bowl.dataset.drop_vars([v for v in bowl.dataset if v.startswith("cell_set")])
    export(dataset, target, "rtmsim", tmp_path / "bowl.txt")
    assert read_input(tmp_path / "bowl.txt")[10] == kinds
