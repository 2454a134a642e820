"""Gates, vents, race tracks and regions by the named sets of mesh files, filled end to end.

One strip in four formats, each with sets of nodes, of edges where the format has them, and of
cells: every filling has to be that of the same places by coordinates, to the bits.
"""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.infiltration.stage import FillOptions, map_and_fill

from .conftest import HEAD, LENGTH, WIDTH, strip

PLAIN = FillOptions(picture=False, vtu=False)
POINTS, QUADS = strip()
AT_LEFT = np.flatnonzero(POINTS[:, 0] == 0.0)
AT_RIGHT = np.flatnonzero(POINTS[:, 0] == LENGTH)
ALONG = np.flatnonzero(POINTS[:, 1] == 0.0)
ONE = np.flatnonzero(np.isclose(POINTS, [0.1, WIDTH, 0.0]).all(axis=1))
CENTRE = POINTS[QUADS].mean(axis=1)
CORE = np.flatnonzero((CENTRE[:, 0] > 0.1) & (CENTRE[:, 0] < 0.2))
NODE_SETS = {"IN": AT_LEFT, "OUT": AT_RIGHT, "GAP": ALONG, "PIN": ONE}

BY_SET = """
[[gates]]
name = "in"
set = "IN"
pressure = "1 bar"
[[gates]]
name = "pin"
set = "PIN"
pressure = "1.2 bar"
[[vents]]
name = "out"
set = "OUT"
[[race_tracks]]
name = "gap"
set = "GAP"
width = "0.5 mm"
[[regions]]
name = "core"
set = "CORE"
permeability_factor = 0.3
"""
PLACES = {
    "IN": 'box = ["-1 -1 -1 mm", "1 61 1 mm"]',
    "OUT": 'box = ["299 -1 -1 mm", "301 61 1 mm"]',
    "GAP": 'box = ["-1 -1 -1 mm", "301 1 1 mm"]',
    "PIN": 'point = "100 60 0 mm"',
    "CORE": 'box = ["100 -1 -1 mm", "200 61 1 mm"]',
}


def by_coordinates():
    text = BY_SET
    for name, place in PLACES.items():
        text = text.replace(f'set = "{name}"', place)
    return text


def pairs_of(nodes):
    """Edges along a row of nodes that follow each other."""
    order = nodes[np.lexsort(POINTS[nodes].T)]
    return np.stack([order[:-1], order[1:]], axis=1)


def nastran(path):
    """SET of the case control section, with the names that HyperMesh writes as comments."""
    sets = [*NODE_SETS.items(), ("CORE", CORE)]
    names = [
        f'$HMSET {number:8d} {1 + (name == "CORE"):8d} "{name}"'
        for number, (name, _) in enumerate(sets, start=7)
    ]
    rows = [
        f"SET {number} = " + ",".join(str(row + 1) for row in rows)
        for number, (_, rows) in enumerate(sets, start=7)
    ]
    grids = [f"GRID,{n + 1},,{x:.6f},{y:.6f},{z:.6f}" for n, (x, y, z) in enumerate(POINTS)]
    shells = [f"CQUAD4,{c + 1},1," + ",".join(str(n + 1) for n in q) for c, q in enumerate(QUADS)]
    deck = ["SOL 101", *names, "CEND", *rows, "BEGIN BULK", *grids, *shells, "PSHELL,1,1,1.",
            "ENDDATA"]  # fmt: skip
    path.write_text("\n".join(deck) + "\n")


def abaqus(path):
    lines = [
        "*NODE",
        *(f"{n + 1}, {x:.6f}, {y:.6f}, {z:.6f}" for n, (x, y, z) in enumerate(POINTS)),
    ]
    lines += ["*ELEMENT, TYPE=S4, ELSET=PART"]
    lines += [f"{c + 1}, " + ", ".join(str(n + 1) for n in q) for c, q in enumerate(QUADS)]
    for name, rows in NODE_SETS.items():
        lines += [f"*NSET, NSET={name}", *(f"{row + 1}," for row in rows)]
    lines += ["*ELSET, ELSET=CORE", *(f"{row + 1}," for row in CORE)]
    path.write_text("\n".join(lines) + "\n")


def gmsh(path):
    """Version 2.2: physical groups of points, of curves and of surfaces."""
    groups = {"PIN": (0, ONE[:, None]), "CORE": (2, QUADS[CORE]),
              "REST": (2, np.delete(QUADS, CORE, axis=0))}  # fmt: skip
    groups |= {name: (1, pairs_of(NODE_SETS[name])) for name in ("IN", "OUT", "GAP")}
    names = [f'{dim} {k} "{name}"' for k, (name, (dim, _)) in enumerate(groups.items(), start=1)]
    kinds = {0: 15, 1: 1, 2: 3}
    elements = [
        f"{kinds[dim]} 2 {k} {k} " + " ".join(str(n + 1) for n in nodes)
        for k, (dim, cells) in enumerate(groups.values(), start=1)
        for nodes in cells
    ]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names)), *names,
             "$EndPhysicalNames", "$Nodes", str(len(POINTS)),
             *(f"{n + 1} {x:.6f} {y:.6f} {z:.6f}" for n, (x, y, z) in enumerate(POINTS)),
             "$EndNodes", "$Elements", str(len(elements)),
             *(f"{k} {line}" for k, line in enumerate(elements, start=1)),
             "$EndElements"]  # fmt: skip
    path.write_text("\n".join(lines) + "\n")


def med(path):
    """Groups of nodes, of edges and of faces, by the MED library."""
    mc = pytest.importorskip("medcoupling")

    def level(kind, dimension, cells):
        mesh = mc.MEDCouplingUMesh("part", dimension)
        mesh.allocateCells(len(cells))
        for nodes in cells:
            mesh.insertNextCell(kind, [int(node) for node in nodes])
        mesh.setCoords(coordinates)
        mesh.finishInsertingCells()
        return mesh

    def group(name, rows):
        found = mc.DataArrayInt([int(row) for row in rows])
        found.setName(name)
        return found

    coordinates = mc.DataArrayDouble(np.ascontiguousarray(POINTS, dtype=float))
    edges = [pairs_of(NODE_SETS[name]) for name in ("IN", "OUT", "GAP")]
    ends = np.cumsum([0, *map(len, edges)])
    file = mc.MEDFileUMesh()
    file[0] = level(mc.NORM_QUAD4, 2, QUADS)
    file[-1] = level(mc.NORM_SEG2, 1, np.concatenate(edges))
    file.setGroupsAtLevel(0, [group("CORE", CORE)])
    file.setGroupsAtLevel(
        -1,
        [group(name, range(ends[k], ends[k + 1])) for k, name in enumerate(("IN", "OUT", "GAP"))],
    )
    file.setGroupsAtLevel(1, [group("PIN", ONE)])
    file.write(str(path), 2)


#: Fill times of the first format, in the order of places.
REFERENCE: dict[str, np.ndarray] = {}
FORMATS = {"bdf": nastran, "inp": abaqus, "msh": gmsh, "med": med}


@pytest.mark.parametrize("ending", FORMATS)
def test_sets_fill_as_the_same_places_by_coordinates(kit, tmp_path, ending):
    mesh = tmp_path / f"part.{ending}"
    FORMATS[ending](mesh)
    found = {}
    for name, places in (("sets", BY_SET), ("places", by_coordinates())):
        _, report = map_and_fill(
            kit.forming(), mesh, kit.case(HEAD, places), name=name, out_dir=tmp_path, options=PLAIN
        )
        assert report.outcome == "filled", report.message
        with xr.open_dataset(tmp_path / f"{name}_filling.nc") as filled:
            found[name] = filled.load()
    sets, places = found["sets"], found["places"]
    for field in ("fill_time", "resin_pressure", "resin_mass", "darcy_velocity_x"):
        np.testing.assert_array_equal(sets[field].values, places[field].values)
    for gate, rows in (("gate_in", AT_LEFT), ("gate_pin", ONE), ("vent_out", AT_RIGHT)):
        at = np.stack([sets[f"target_node_{axis}"].values for axis in "xyz"], axis=1)
        np.testing.assert_allclose(
            np.sort(at[sets[gate].values == 1], axis=0), np.sort(POINTS[rows], axis=0), atol=1e-9
        )
    # the same number in every format: that of the first one
    at = np.lexsort(np.round(np.stack([sets[f"target_node_{a}"].values for a in "xyz"]), 6))
    reference = REFERENCE.setdefault("fill_time", sets["fill_time"].values[at])
    np.testing.assert_allclose(sets["fill_time"].values[at], reference, rtol=1e-6)
