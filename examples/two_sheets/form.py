"""Two sheets of different laws in one model: pressed between the same plates, and released.

A scene file makes plies that lie on each other. In Python a model takes sheets of any place and
mesh; these two lie beside each other and share tools, time and files. Usage:
python examples/two_sheets/form.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from lcmchain.fields import FrameSeries, model_datasets, write_forming_netcdf
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import Scene, scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.table import build_tool_table

SCENE = """
title = "Two sheets between plates"
process = {{ time = "20 ms", frames = 11, mass_damping = "500 1/s" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }}
contact = {{ penalty = "1000 N/mm^3" }}

[material]
{material}

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 1.004 mm"
motion = {{ type = "table", direction = [0, 0, -1], times = "0 10 20 ms", travel = "0 0.3 0 mm" }}
"""
FABRIC = 'preset = "MD600"'
WITH_SET = 'law = "fabric-with-set"\npreset = "MD600"\ncompaction.permanent_set = 0.3'


def sheet(name: str, scene: Scene, shift: float) -> Sheet:
    """Return the blank of a scene, moved by ``shift`` [m] along x, with its material."""
    mesh = build_blank(scene.blank, scene.material.thickness)
    mesh = replace(mesh, node_positions=mesh.node_positions + [shift, 0.0, 0.0])
    return Sheet(name, mesh, scene.material.build(), scene.element)


def main(folder: Path) -> None:
    """Form both sheets, write ``forming.nc``, and print what remains of the compaction."""
    with_set = scene_from_text(SCENE.format(material=WITH_SET))
    fabric = scene_from_text(SCENE.format(material=FABRIC))
    model = assemble_bodies(
        [sheet("with_set", with_set, 0.0), sheet("fabric", fabric, 0.03)],
        tools=build_tool_table(fabric.tools, fabric.source.directory, fabric.process.time),
        tool_names=[tool.name for tool in fabric.tools],
        contact=fabric.contact,
        process=fabric.process,
    )
    simulation = Simulation(model)
    snapshots = [simulation.snapshot()]
    for time in np.linspace(0.0, fabric.process.time, fabric.process.frames)[1:]:
        simulation.advance_to(float(time))
        snapshots.append(simulation.snapshot())
    frames = FrameSeries.from_snapshots(snapshots, model.tool_names)
    datasets = model_datasets(fabric, model, frames, attributes={"state": "complete"})
    write_forming_netcdf(folder / "forming.nc", datasets)

    print("mean thickness [mm]   pressed   released")
    for body in model.bodies:
        field = datasets[f"/{body.name}"]["thickness"].mean(f"{body.name}_face")
        thickness = 1e3 * field.values
        print(f"{body.name:20s} {thickness.min():9.3f} {thickness[-1]:10.3f}")
    print(f"groups of {folder / 'forming.nc'}: {', '.join(datasets)}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/two_sheets"))
