"""What is read of a formed part, and every reason why nothing could flow through it."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.cell_permeability import require_permeable
from lcmchain.coupling.infiltration.flow.preform import FlowMesh
from lcmchain.coupling.infiltration.formed_part import (
    read_formed_part,
    triangles_of_three,
    unformed_part,
    with_permeability,
)
from lcmchain.errors import InputError
from lcmchain.mapping import map_file
from lcmchain.scene.infiltration import OwnPermeability, Preform
from lcmchain.scene.infiltration.laws import GebartPermeability

from .conftest import PERMEABILITY, strip, write_forming

GEBART = GebartPermeability(law="gebart", fibre_radius=3.5e-6)
BAD = [4, 17]


def changed(value, good):
    """A field with another value in two cells."""
    values = np.full(36, good)
    values[BAD] = value
    return values


def test_the_faces_of_the_sheet(kit):
    part = read_formed_part(kit.forming(shear_angle=0.1))
    assert part.target.cell_count == 36 and part.mesh.name == "sheet"
    assert part.cell("permeability_1") == pytest.approx(PERMEABILITY, rel=1e-9, abs=0.0)
    assert part.cell("shear_angle") == pytest.approx(0.1)
    assert part.dataset.attrs["title"] == "strip"


def test_sets_and_parts_of_a_mapped_file(kit, tmp_path):
    """A Nastran deck whose SETs have names, as meshio drops them."""
    points, quads = strip(6, 2)
    grids = [f"GRID,{n + 1},,{x:.6f},{y:.6f},{z:.6f}" for n, (x, y, z) in enumerate(points)]
    shells = [
        f"CQUAD4,{c + 1},{1 + (c > 5)}," + ",".join(str(n + 1) for n in quad)
        for c, quad in enumerate(quads)
    ]
    deck = [
        "SOL 101", '$HMSET        7        1 "GATE left"', '$HMSET        8        2 "core"',
        "CEND", "SET 7 = 1,2,3", "SET 8 = 4 THRU 6", "DISPLACEMENT = 7", "STRESS = 8",
        "BEGIN BULK", *grids, *shells, "PSHELL,1,1,1.", "PSHELL,2,1,1.", "ENDDATA",
    ]  # fmt: skip
    mesh = tmp_path / "part.bdf"
    mesh.write_text("\n".join(deck) + "\n")
    mapped = tmp_path / "part.nc"
    map_file(kit.forming(), mesh, mapped, kind="infiltration", picture=False)
    part = read_formed_part(mapped)
    assert part.mesh.name == "target"
    assert part.target.node_sets["GATE left"].tolist() == [0, 1, 2]
    assert part.target.cell_sets["core"].tolist() == [3, 4, 5]
    assert [len(rows) for rows in part.target.parts.values()] == [6, 6]


def test_quadrilaterals_that_name_a_node_twice_are_triangles(kit, tmp_path):
    """As decks write triangles; in a mesh that was not formed, and in a mapped file."""
    corners = np.array([[0, 1, 4, 3], [1, 2, 2, 4], [2, 5, 4, 2], [7, 7, 8, 9], [6, 7, 8, -1]])
    expected = [[0, 1, 4, 3], [1, 2, 4, -1], [2, 5, 4, -1], [7, 8, 9, -1], [6, 7, 8, -1]]
    assert triangles_of_three(corners).tolist() == expected
    points, quads = strip(4, 2)
    nodes = [f"{n + 1}, {x:.6f}, {y:.6f}, {z:.6f}" for n, (x, y, z) in enumerate(points)]
    cells = [*quads[1:].tolist(), [*quads[0, :3], quads[0, 2]], [*quads[0, [0, 2, 3]], quads[0, 0]]]
    shells = [f"{c + 1}, " + ", ".join(str(n + 1) for n in cell) for c, cell in enumerate(cells)]
    mesh = tmp_path / "part.inp"
    mesh.write_text("\n".join(["*NODE", *nodes, "*ELEMENT, TYPE=S4, ELSET=ALL", *shells]) + "\n")
    map_file(kit.forming(), mesh, tmp_path / "part.nc", kind="infiltration", picture=False)
    own = OwnPermeability(k1=1e-10)
    preform = Preform(thickness=2e-3, fibre_volume_fraction=0.5, permeability=own)
    for part in (read_formed_part(tmp_path / "part.nc"), unformed_part(mesh, preform)):
        flow = FlowMesh.from_target(part.target)
        assert (flow.is_quadrilateral.sum(), flow.cell_count) == (7, 9)
        assert flow.areas.sum() == pytest.approx(0.3 * 0.06)
        assert np.all(flow.normals[:, 2] > 0.99) or np.all(flow.normals[:, 2] < -0.99)


def test_a_law_gives_what_the_forming_result_lacks(kit):
    without = dict.fromkeys(("permeability_1", "permeability_2", "permeability_3"))
    part = read_formed_part(kit.forming(**without))
    with pytest.raises(InputError, match=r"no permeability: form with a \[permeability\] law"):
        with_permeability(part, None)
    found = with_permeability(part, GEBART)
    along = 8.0 * 3.5e-6**2 / 57.0 * 0.5**3 / 0.5**2
    across = 16.0 / (9.0 * np.pi * np.sqrt(2.0)) * (np.sqrt(np.pi / 2.0) - 1.0) ** 2.5 * 3.5e-6**2
    # two families at a right angle: the mean of both in every direction
    assert found.cell("permeability_1") == pytest.approx(0.5 * (along + across), rel=1e-9, abs=0.0)
    assert found.cell("permeability_3") == pytest.approx(across, rel=1e-9, abs=0.0)
    require_permeable(found)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"permeability_2": changed(0.0, PERMEABILITY)},
            "2 of 36 cells have a permeability of zero",
        ),
        ({"fibre_volume_fraction": changed(1.02, 0.5)}, "fibre volume fraction of one or more"),
        ({"thickness": changed(0.0, 2e-3)}, "have a thickness that is not positive"),
    ],
)
def test_cells_that_nothing_flows_through_are_named(kit, fields, message):
    with pytest.raises(InputError, match=message) as caught:
        require_permeable(with_permeability(read_formed_part(kit.forming(**fields)), None))
    text = str(caught.value)
    assert "cell 5, 18" in text and "at (" in text and "forming.nc" in text


def test_cells_beyond_the_range_of_the_law_are_named(kit):
    part = read_formed_part(kit.forming(fibre_volume_fraction=changed(0.82, 0.5)))
    with pytest.raises(InputError, match="2 of 36 cells have no permeability") as caught:
        require_permeable(with_permeability(part, GEBART))
    assert "with fibre volume fraction 0.82" in str(caught.value)
    assert "hexagonal reaches 0.907" in str(caught.value)


def test_a_negative_permeability_is_refused_where_it_is_read(kit):
    with pytest.raises(InputError, match="a permeability of face 4 is negative"):
        read_formed_part(kit.forming(permeability_1=changed(-1e-12, PERMEABILITY)))


def test_an_unfinished_forming_run_is_refused_unless_allowed(kit):
    path = kit.forming(state="stopped: a tool stands still")
    with pytest.raises(InputError, match="unfinished run .state .stopped: a tool stands still"):
        read_formed_part(path)
    (warning,) = read_formed_part(path, allow_incomplete=True).warnings
    assert "unfinished run" in warning


def test_what_is_no_part_is_refused(kit, tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_formed_part(tmp_path / "nothing.nc")
    with pytest.raises(InputError, match="is a folder; name the forming.nc"):
        read_formed_part(tmp_path)
    mesh = tmp_path / "part.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"a mesh and no result of forming; .* give \[preform\]"):
        read_formed_part(mesh)
    mesh.with_suffix(".nc").write_text("neither")
    with pytest.raises(InputError, match="no netCDF result"):
        read_formed_part(mesh.with_suffix(".nc"))
    with pytest.raises(
        InputError, match='no thickness; form the sheet with element = "solid-shell"'
    ):
        read_formed_part(kit.forming(thickness=None))


def test_triangles_among_the_faces_are_sorted_with_their_fields(tmp_path):
    points, quads = strip(3, 1)
    faces = np.array([quads[0], [*quads[1][:3], -1], [quads[1][0], *quads[1][2:], -1], quads[2]])
    fraction = np.array([0.1, 0.2, 0.3, 0.4])
    part = read_formed_part(
        write_forming(tmp_path / "f.nc", points, faces, fibre_volume_fraction=fraction)
    )
    centroids = part.target.centroids[:, 0]
    assert part.cell("fibre_volume_fraction")[part.target.corners[:, 3] >= 0].tolist() == [0.1, 0.4]
    for cell, number in enumerate(part.target.cell_ids):
        own = faces[number - 1]
        assert centroids[cell] == pytest.approx(points[own[own >= 0], 0].mean())
        assert part.cell("fibre_volume_fraction")[cell] == fraction[number - 1]
