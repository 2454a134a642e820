"""Map a formed sheet onto a mesh of triangles, and check that no fibre is lost.

Usage: python examples/scripts/map.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np
import xarray as xr

from lcmchain import read_scene, run
from lcmchain.mapping import MappingOptions, map_file

SCENE = Path(__file__).with_name("dome.toml")


def main(folder: Path) -> None:
    """Form the dome, mesh its mid-surface by triangles, and map thickness and fibres onto them."""
    result = run(read_scene(SCENE), folder)
    sheet = result.datasets["/"].isel(time=-1)
    points = np.column_stack(
        [(sheet[f"reference_position_{k}"] + sheet[f"displacement_{k}"]).values for k in "xyz"]
    )
    quads = sheet["sheet_face_nodes"].values.astype(int)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    target = folder / "triangles.vtu"
    meshio.write(target, meshio.Mesh(points, [("triangle", triangles)]))

    report = map_file(
        folder / "forming.nc", target, folder / "mapped.nc", MappingOptions(kind="infiltration")
    )
    print(report.summary())
    with xr.open_dataset(folder / "mapped.nc") as mapped:
        print(", ".join(mapped.data_vars))
        thickness = mapped["thickness"].values
    assert abs(report.conservation_error) < 1e-12
    assert abs(thickness.min() - sheet["thickness"].min().item()) < 1e-5


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/map"))
