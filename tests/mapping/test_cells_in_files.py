"""Every cell that a reader yields is written by every writer, or refused with nothing written.

The table of the page "Exports for other programs" is what happens here. After a change of readers
or writers, ``LCMCHAIN_WRITE_TABLES=1 pytest tests/mapping/test_cells_in_files.py`` writes it anew.
"""

import os
import re

import h5py
import meshio
import numpy as np
import pytest
from meshio._common import num_nodes_per_cell
from meshio._mesh import topological_dimension

from lcmchain.errors import InputError
from lcmchain.manual.contents import FOLDER
from lcmchain.mapping import map_file, read_target
from lcmchain.mapping.formats.export import prepare_export
from lcmchain.mapping.structure import SolverOptions, map_and_analyse
from lcmchain.mapping.structure.mapped_file import open_mapped
from lcmchain.mesh_files.readers import cgns, exodus, gmsh, med, netgen
from lcmchain.mesh_files.readers.decks import abaqus_scope, lsdyna, nastran, universal
from lcmchain.mesh_files.shapes import (
    ADDED,
    SOLID_CORNERS,
    SOLID_EDGES,
    SURFACE_CORNERS,
    base_type,
    corner_count,
    is_known_to_vtk,
)
from lcmchain.scene import structure_from_text

PAGE = FOLDER / "formats.md"
BEGIN, END = "<!-- cells of readers and writers: begin -->", "<!-- end -->"
WRITERS = {
    "netCDF": "netcdf", "VTU": "vtu", "CalculiX": "calculix", "VMAP": "vmap", "DRAPE": "drape",
    "OpenRadioss": "openradioss", "RTMsim": "rtmsim", "LCMsim": "lcmsim",
}  # fmt: skip
WHOLE, CORNERS, VALUES, REFUSED = "all nodes", "corners", "values", "refused"

ABOUT_CELLS = re.compile("CalculiX has no element|VMAP has no element type|has solid cells")

# Corners of a cell over the bowl; the tip of a pyramid stands above its middle.
SQUARE = np.array([[0.1, 0.1], [0.3, 0.1], [0.3, 0.3], [0.1, 0.3]])
PLANS = {
    "triangle": [0, 1, 2], "quad": [0, 1, 2, 3], "tetra": [0, 1, 2, 0], "pyramid": [0, 1, 2, 3, 0],
    "wedge": [0, 1, 2, 0, 1, 2], "hexahedron": [0, 1, 2, 3, 0, 1, 2, 3],
}  # fmt: skip


def is_cell(name):
    return base_type(name) in SURFACE_CORNERS | SOLID_CORNERS


def of_meshio():
    """Types that meshio yields: all that VTK has, and the lowest above the second order."""
    second = ("triangle7", "quad9", "tetra10", "pyramid14", "wedge18", "hexahedron27")
    most = {base_type(name): num_nodes_per_cell[name] for name in second}
    known = [name for name in topological_dimension if is_cell(name) and name in num_nodes_per_cell]
    beyond = {
        shape: min(
            (name for name in known
             if base_type(name) == shape and num_nodes_per_cell[name] > most[shape]),
            key=num_nodes_per_cell.get, default=None,
        )
        for shape in most
    }  # fmt: skip
    low = {name for name in known if num_nodes_per_cell[name] <= most[base_type(name)]}
    return low | {name for name in beyond.values() if name}


def types_of_readers():
    """Cell types by reader, from the readers' own tables."""
    found = {
        "Abaqus": {
            *abaqus_scope._SHELL_SHAPES.values(), *abaqus_scope._SOLID_SHAPES.values(),
            *abaqus_scope._STRI.values(), *abaqus_scope._CONTINUUM_SHELL.values(),
        },
        "Nastran": {
            name
            for element in nastran._ELEMENTS.values()
            for name in (element.shape, f"{element.shape}{element.full or ''}")
        },
        "LS-DYNA": {
            *[shape for shape, _, _ in lsdyna._SQUEEZED],
            *["triangle", "triangle6", "quad", "quad8", "tetra10", "hexahedron"],
        },
        "Universal": {
            name for table in (universal._SHELLS, universal._SOLIDS) for name, _ in table.values()
        },
        "NETGEN": {
            *netgen.netgen2d_to_meshio_type.values(), *netgen.netgen3d_to_meshio_type.values(),
        },
        "Gmsh": {kind.name for kind in gmsh.KINDS.values()},
        "MED": set(med._TYPES.values()),
        "CGNS": {name for name, _ in cgns._TYPES.values()},
        "Exodus": {name for shapes in exodus._SHAPES.values() for name in shapes.values()},
        "meshio": of_meshio(),
    }  # fmt: skip
    return {reader: {name for name in names if is_cell(name)} for reader, names in found.items()}


READERS = types_of_readers()
TYPES = sorted(
    set().union(*READERS.values()),
    key=lambda name: (list(PLANS).index(base_type(name)), num_nodes_per_cell[name]),
)


def one_cell(name, make):
    """Points and cells of one cell over the bowl; nodes that are no corners lie on their edges."""
    shape, count = base_type(name), corner_count(name)
    corners = make.bowl(SQUARE[PLANS[shape]])
    if shape == "pyramid":
        corners[4] = make.bowl(SQUARE.mean(axis=0)[None])[0] + [0.0, 0.0, 0.002]
    elif shape in SOLID_CORNERS:
        corners[count // 2 if shape != "tetra" else 3 :, 2] += 0.002
    ring = [(k, (k + 1) % count) for k in range(count)]
    edges = SOLID_EDGES.get(shape, ring)
    middles = [corners[list(edge)].mean(axis=0) for edge in edges]
    further = num_nodes_per_cell[name] - count
    inner = [corners.mean(axis=0)] * max(0, further - len(middles))
    points = np.array([*corners, *middles[:further], *inner])
    return points, np.arange(num_nodes_per_cell[name])[None]


@pytest.fixture(scope="module")
def formed(make):
    """A formed bowl with everything that any writer needs."""
    points2, faces = make.grid(8, 8, (-1.0, -1.0), (1.0, 1.0))
    points = make.bowl(points2)
    first, second = make.families(points, faces)
    fields = {"thickness": 1e-3, "fibre_volume_fraction": 0.5, "areal_fibre_mass": 0.88,
              "shear_angle": 0.0, "fibre_direction_1": first, "fibre_direction_2": second,
              "permeability_1": 2e-10, "permeability_2": 1e-10, "permeability_3": 1e-11,
              "permeability_direction_1": first, "permeability_direction_2": second,
              "permeability_direction_3": np.cross(first, second)}  # fmt: skip
    formed = make.forming_result(points, faces, **fields)
    for number in (1, 2, 3):
        formed[f"permeability_{number}"].attrs["units"] = "m2"
    return formed


CASE = structure_from_text(
    'fibre = { preset = "T300", density = "1760 kg/m^3" }\nresin = { preset = "MY750" }\n'
    'elements = "as_mesh"\n'
)


OPTIONS = {"picture": False, "maximum_distance": 0.5, "thickness_limit": 1e9,
           "allow_ambiguous": True}  # fmt: skip


class _Writers:
    """Writes one mesh with every writer, and tells what became of its one cell."""

    def __init__(self, source, mesh, folder):
        self.source, self.mesh, self.folder = source, mesh, folder
        self.target = read_target(mesh)
        self.name, self.nodes = self.target.blocks[0]
        self.report = map_file(source, mesh, folder / "m.nc", **OPTIONS)
        self.mapped = open_mapped(folder / "m.nc")
        (folder / "out").mkdir()

    def write(self, writer):
        """What one writer does: one of the words of the table."""
        try:
            return getattr(self, f"_{writer}", lambda: self._export(writer))()
        except InputError as error:
            assert ABOUT_CELLS.search(str(error)), error
            assert list((self.folder / "out").iterdir()) == []
            return REFUSED

    def _netcdf(self):
        shape = "volume" if self.target.is_solid else "face"
        found = self.mapped[f"target_{shape}_nodes"].values
        corners = self.target.points[self.nodes[0, : corner_count(self.name)]]
        assert (found >= 0).sum() == len(corners)
        return WHOLE if len(corners) == self.nodes.shape[1] else CORNERS

    def _vtu(self):
        told = any("VTK has no type" in warning for warning in self.report.warnings)
        return self._read_back(self.folder / "m.vtu", told)

    def _read_back(self, path, told=False):
        """Compare with what any reader of the file finds."""
        read = read_target(path)
        name, nodes = read.blocks[0]
        places = read.points[nodes[0]]
        expected = self.target.points[self.nodes[0]][: len(places)]
        assert np.allclose(places, expected, atol=1e-12)
        assert told == (len(places) < self.nodes.shape[1] and path.name == "m.vtu")
        if name == self.name:
            return WHOLE
        assert base_type(name) == base_type(self.name)
        return CORNERS if len(places) == corner_count(name) else "without centres"

    def _calculix(self):
        out = self.folder / "out"
        try:
            map_and_analyse(
                self.folder / "m.nc", self.mesh, CASE, name="p", out_dir=out,
                options=SolverOptions(run=False),
            )  # fmt: skip
        except InputError:  # from a forming result, too, before the mapping writes its files
            map_and_analyse(self.source, self.mesh, CASE, name="p", out_dir=out)
        both = [self._read_back(out / f"p_calculix{end}") for end in ("_mesh.inp", ".vtu")]
        assert both[0] == both[1]
        for path in out.iterdir():
            path.unlink()
        return both[0]

    def _export(self, format):
        save = prepare_export(self.mapped, self.target, format, self.folder / "out" / "m.other")
        assert list((self.folder / "out").iterdir()) == []
        if format == "vmap":
            save()
            with h5py.File(self.folder / "out" / "m.other") as file:
                nodes = file["VMAP/GEOMETRY/1/ELEMENTS/MYELEMENTS"]["myConnectivity"][0, 0]
            assert np.array_equal(nodes, self.target.node_ids[self.nodes[0]])
        else:
            assert save().cells == 1
        for path in (self.folder / "out").iterdir():
            path.unlink()
        if format == "openradioss":
            return WHOLE if self.nodes.shape[1] == corner_count(self.name) else CORNERS
        return WHOLE if format == "vmap" else VALUES


@pytest.fixture(scope="module")
def outcomes(formed, make, tmp_path_factory):
    """What every writer does with every type: by type and writer."""
    found = {}
    formed.to_netcdf(source := tmp_path_factory.mktemp("formed") / "forming.nc")
    for name in TYPES:
        folder = tmp_path_factory.mktemp(name)
        points, cells = one_cell(name, make)
        mesh = meshio.Mesh(points, [(name, cells)])
        if is_known_to_vtk(name):
            mesh.write(path := folder / "cell.vtu")
        else:  # version 4.0 of Gmsh's files holds what VTK does not, and is read by meshio
            meshio.gmsh.write(path := folder / "cell.msh", mesh, fmt_version="4.0")
        writers = _Writers(source, path, folder)
        assert writers.name == name
        found[name] = {title: writers.write(writer) for title, writer in WRITERS.items()}
    return found


def table(outcomes):
    """The table of the page, in Markdown."""
    lines = ["| cell | from | " + " | ".join(WRITERS) + " |", "|---" * (len(WRITERS) + 2) + "|"]
    for name, words in outcomes.items():
        readers = ", ".join(reader for reader, names in READERS.items() if name in names)
        lines.append(f"| `{name}` | {readers} | " + " | ".join(words.values()) + " |")
    return "\n".join(lines)


def test_every_cell_of_every_reader_is_written_by_every_writer_or_refused_first(outcomes):
    assert len(outcomes) == len(TYPES) > 20
    text = PAGE.read_text(encoding="utf-8")
    fresh = f"{BEGIN}\n{table(outcomes)}\n{END}"
    if os.environ.get("LCMCHAIN_WRITE_TABLES"):
        text = re.sub(f"{BEGIN}.*?{END}", lambda _: fresh, text, flags=re.DOTALL)
        PAGE.write_text(text, encoding="utf-8")
    kept = re.search(f"{BEGIN}.*?{END}", text, flags=re.DOTALL)
    assert kept is not None and kept[0] == fresh, "see the head of this file"


@pytest.mark.parametrize("name", sorted(ADDED))
def test_vtu_keeps_cells_that_meshio_alone_cannot_build(outcomes, name):
    assert outcomes[name]["VTU"] == WHOLE


def test_one_file_of_all_shells_and_one_of_all_solids_are_mapped_with_their_picture(
    formed, make, tmp_path
):
    """Blocks of unlike types stand in one file, and in one picture."""
    for of_solids in (False, True):
        points, blocks = np.empty((0, 3)), []
        for name in TYPES:
            if is_known_to_vtk(name) and (base_type(name) in SOLID_CORNERS) == of_solids:
                own, cells = one_cell(name, make)
                blocks.append((name, cells + len(points)))
                points = np.concatenate([points, own + [0.0, 0.0, 1e-4 * len(blocks)]])
        path = tmp_path / f"all{of_solids}.vtu"
        meshio.Mesh(points, blocks).write(path)
        out = tmp_path / f"mapped{of_solids}.nc"
        report = map_file(formed, path, out, **{**OPTIONS, "picture": True})
        assert out.with_suffix(".png").is_file()
        read = read_target(out.with_suffix(".vtu"))
        assert [name for name, _ in read.blocks] == [name for name, _ in blocks]
        assert all(np.array_equal(a, b) for (_, a), (_, b) in zip(read.blocks, blocks))
        assert not any("VTK has no type" in warning for warning in report.warnings)


def test_map_refuses_an_export_before_its_first_file(formed, make, tmp_path):
    points, cells = one_cell("pyramid13", make)
    meshio.Mesh(points, [("pyramid13", cells)]).write(tmp_path / "cell.vtu")
    with pytest.raises(InputError, match="VMAP has no element type"):
        map_file(formed, tmp_path / "cell.vtu", tmp_path / "m.nc", **OPTIONS, exports=("vmap",))
    assert [path.name for path in tmp_path.iterdir()] == ["cell.vtu"]
