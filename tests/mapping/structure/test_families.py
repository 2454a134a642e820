"""Fabrics of one and three families through mapping, picture, decks and draping tables."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import map_file, read_target
from lcmchain.mapping.formats import export
from lcmchain.mapping.structure.mapped_file import formed_cells, mapped_state, open_mapped
from lcmchain.mapping.structure.results import cell_values
from lcmchain.mapping.structure.sections import build_sections
from lcmchain.scene import structure_from_text

from .conftest import MATERIAL, THICKNESS, V, unit
from .test_calculix_plates import at_angle, plane_stiffness
from .test_stack import two_plies

CASE = (
    '[[supports]]\nname = "edge"\nfixed = ["x"]\nplane = { normal = [1, 0, 0], position = "0 m" }\n'
)
ANGLES = {1: (0.2,), 3: (0.2, 0.2 + np.pi / 3, 0.2 - np.pi / 3)}


@pytest.fixture
def mapped(kit, write_mesh, tmp_path):
    """Map a flat sheet of so many families onto a plate: the file and its target."""

    def run(count, cells="quad", picture=False):
        source = kit.formed()
        for number in (1, 2, 3):
            for axis in "xyz":
                name = f"fibre_direction_{number}_{axis}"
                if number <= count:
                    values = unit(ANGLES[count][number - 1])["xyz".index(axis)]
                    like = source["fibre_direction_1_x"]
                    source[name] = like.copy(data=np.full(like.shape, values))
                elif name in source:
                    source = source.drop_vars(name)
        mesh = write_mesh(*kit.plate(cells, count=4), "mesh.vtu")
        report = map_file(source, mesh, tmp_path / "plate.nc", picture=picture)
        assert report.second_family_error_max is None
        assert bool(list(tmp_path.glob("*.png"))) == picture
        return open_mapped(tmp_path / "plate.nc"), read_target(mesh)

    return run


def sections_of(dataset, target, text=""):
    structure = structure_from_text(text + MATERIAL + CASE)
    formed = formed_cells(mapped_state(dataset), target, "plate.nc")
    return build_sections(formed, target, structure)


@pytest.mark.parametrize("count", ANGLES)
def test_the_laminate_is_that_of_its_families(mapped, count):
    """A single family is a ply of its own; three equal ones at 60 degrees are isotropic."""
    dataset, target = mapped(count, picture=True)
    assert ("fibre_direction_3_x" in dataset) == (count == 3)
    found = sections_of(dataset, target)
    assert len(found.layers) == count
    # the axis 1 of the cell lies along the first family
    turns = [angle - ANGLES[count][0] for angle in ANGLES[count]]
    A = THICKNESS * np.mean([at_angle(plane_stiffness(V), turn) for turn in turns], axis=0)
    assert found.laminate is not None
    for own in found.laminate.A:
        np.testing.assert_allclose(own, A, rtol=2e-3, atol=2e-3 * abs(A).max())
    names = [name for name in cell_values(found, None) if name.startswith("family_angle")]
    assert names == {1: [], 3: ["family_angle", "family_angle_13"]}[count]


@pytest.mark.parametrize("count", ANGLES)
def test_families_over_each_other_are_layers(mapped, count):
    dataset, target = mapped(count)
    one = sections_of(dataset, target, 'lay_up = "stacked"\n').through
    assert one is not None
    np.testing.assert_allclose(one.share, 1.0 / count)
    assert one.kind[:, 0].tolist() == list(range(count))
    middle = sections_of(dataset, target, 'lay_up = "symmetric"\n').through
    assert middle is not None
    assert middle.kind[:, 0].tolist() == {1: [0], 3: [0, 1, 2, 1, 0]}[count]
    np.testing.assert_allclose(middle.share.sum(axis=0), 1.0)


def test_a_draping_table_is_written_for_every_family(mapped, tmp_path):
    for count, part in ((1, "no place in the table"), (3, "a third of the thickness")):
        dataset, target = mapped(count)
        report = export(dataset, target, "drape", tmp_path / "drape.fem")
        text = (tmp_path / "drape.fem").read_text()
        assert text.count("\nDRAPE") == count
        assert report.details["ply_thickness_m"] == pytest.approx(THICKNESS / count, rel=1e-6)
        assert any(part in str(loss) for loss in report.losses)
        export(dataset, target, "vmap", tmp_path / "plate.vmap")


def test_what_families_cannot_say_is_refused(mapped):
    with pytest.raises(InputError, match="solids, which take the normal of the sheet from two"):
        sections_of(*mapped(1, "hexahedron"))
    with pytest.raises(InputError, match="3 families, which have equal shares") as caught:
        sections_of(*mapped(3), "family_1_share = 0.4\n")
    assert caught.value.key == "family_1_share"


def test_plies_of_one_and_of_two_families_lie_over_each_other(make, write_mesh, tmp_path):
    """The upper ply has lost its second family: its half of the laminate is a single ply."""
    source = two_plies(make)
    upper = source["body"].values == 1
    for axis in "xyz":
        values = source[f"fibre_direction_2_{axis}"].values.copy()
        values[..., upper] = np.nan
        source[f"fibre_direction_2_{axis}"].values[:] = values
    points, quads = make.grid(6, 3, high=(0.2, 0.05))
    mesh = write_mesh(make.lifted(points), [("quad", quads)], "mesh.vtu")
    map_file(source, mesh, tmp_path / "plies.nc", picture=False)
    found = sections_of(open_mapped(tmp_path / "plies.nc"), read_target(mesh), 'lay_up = "plies"\n')
    Q = plane_stiffness(V)
    lower = 0.5 * (at_angle(Q, 0.0) + at_angle(Q, np.pi / 2))
    own = 1e-3 * lower + 0.8e-3 * at_angle(Q, np.pi / 4)
    assert len(found.layers) == 3 and found.laminate is not None
    np.testing.assert_allclose(found.laminate.A[4], own, rtol=5e-3, atol=5e-3 * abs(own).max())
