"""Flat forming results with known fields, as files, and cases to fill them with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.scene import infiltration_from_text

LENGTH, WIDTH = 0.3, 0.06
PERMEABILITY, POROSITY, VISCOSITY, PRESSURE = 1e-10, 0.5, 0.1, 1e5
#: Fill time of the strip from its end, values.md 4.3 case 1 [s].
FILL_TIME = POROSITY * VISCOSITY * LENGTH**2 / (2.0 * PERMEABILITY * PRESSURE)

HEAD = """
time = "500 s"
frames = 6
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
"""
GATE = """
[[gates]]
name = "left"
box = ["0 -1 -1 mm", "0 61 1 mm"]
pressure = "1 bar"
"""
VENT = """
[[vents]]
name = "right"
box = ["300 -1 -1 mm", "300 61 1 mm"]
"""


def strip(columns=12, rows=3, length=LENGTH, width=WIDTH):
    """Points (N, 3) and quadrilaterals of a flat strip along x."""
    x, y = np.linspace(0.0, length, columns + 1), np.linspace(0.0, width, rows + 1)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, indexing="ij")], axis=1)
    points = np.hstack([points, np.zeros((len(points), 1))])
    node = np.arange(len(points)).reshape(columns + 1, rows + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return points, np.stack([c.ravel() for c in corners], axis=1)


def write_forming(path, points, quads, *, state="complete", **fields):
    """Write a forming result with one saved state: isotropic permeability, fibres along x and y."""
    count = len(quads)
    values = {
        "thickness": 2e-3,
        "fibre_volume_fraction": 1.0 - POROSITY,
        "areal_fibre_mass": 1.8,
        "shear_angle": 0.0,
        "permeability_1": PERMEABILITY,
        "permeability_2": PERMEABILITY,
        "permeability_3": 0.1 * PERMEABILITY,
    }
    for stem in ("fibre_direction", "permeability_direction"):
        for number in (1, 2, 3) if stem.startswith("perm") else (1, 2):
            for axis, name in enumerate("xyz"):
                values[f"{stem}_{number}_{name}"] = float(axis == number - 1)
    units = {"thickness": "m", "areal_fibre_mass": "kg m-2", "shear_angle": "rad"}
    units |= {f"permeability_{number}": "m2" for number in (1, 2, 3)}
    mesh = UgridMesh("sheet")
    variables = {**mesh.topology(quads, long_name="sheet"), **mesh.node_positions(points)}
    for name, value in (values | fields).items():
        if value is None:
            continue
        own = np.broadcast_to(np.asarray(value, dtype=float), count).copy()
        about = {"units": units.get(name, "1"), "long_name": name}
        variables[name] = mesh.on_cells(own, about)
    attributes = {"Conventions": "CF-1.11 UGRID-1.0", "title": "strip", "state": state}
    write_netcdf(path, {"/": mesh.dataset(variables, attributes)})
    return path


@pytest.fixture
def kit(tmp_path):
    """Makers: ``forming(**fields)`` writes a strip, ``case(text, ...)`` reads a case."""

    def forming(columns=12, rows=3, name="forming.nc", **fields):
        return write_forming(tmp_path / name, *strip(columns, rows), **fields)

    def case(*texts, overrides=()):
        return infiltration_from_text("\n".join(texts or (HEAD, GATE, VENT)), overrides=overrides)

    return SimpleNamespace(forming=forming, case=case, folder=tmp_path)
