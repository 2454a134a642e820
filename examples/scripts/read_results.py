"""Read a result with xarray: fields over time, histories, and the fibres of the sheet.

Usage: python examples/scripts/read_results.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain import read_scene, run

SCENE = Path(__file__).with_name("dome.toml")


def main(folder: Path) -> None:
    """Form the dome; open its file as anybody would."""
    run(read_scene(SCENE), folder)
    with xr.open_datatree(folder / "forming.nc") as tree:
        sheet, history = tree["/"].load(), tree["/history"].load()
    for time, thickness in zip(sheet["time"].values, sheet["thickness"].values, strict=True):
        print(f"{1e3 * time:5.0f} ms  thinnest {1e3 * thickness.min():.3f} mm")
    print("units:", {name: sheet[name].attrs["units"] for name in ("thickness", "shear_angle")})

    last = sheet.isel(time=-1)
    first = np.stack([last[f"fibre_direction_1_{k}"].values for k in "xyz"], axis=-1)
    second = np.stack([last[f"fibre_direction_2_{k}"].values for k in "xyz"], axis=-1)
    between = np.arccos(np.clip((first * second).sum(axis=-1), -1.0, 1.0))
    # the fibres of a fabric are at right angles less the shear angle
    assert np.allclose(0.5 * np.pi - between, last["shear_angle"].values, atol=1e-6)
    energy = history["energy_external"].values
    assert np.isclose(energy[-1], np.max(energy), rtol=0.01)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/read_results"))
