"""Draw a formed sheet with matplotlib, coloured by its shear angle.

``lcmchain`` writes its own pictures (`lcmchain report`); this is how to draw one's own.
Usage: python examples/scripts/plot.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from lcmchain import read_scene, run
from lcmchain.fields.sheet import sheet_faces

SCENE = Path(__file__).with_name("dome.toml")


def main(folder: Path) -> None:
    """Form the dome and draw its last state."""
    last = run(read_scene(SCENE), folder).datasets["/"].isel(time=-1)
    places = np.stack(
        [(last[f"reference_position_{k}"] + last[f"displacement_{k}"]).values for k in "xyz"],
        axis=1,
    )
    angle = np.degrees(last["shear_angle"].values)
    faces = Poly3DCollection(1e3 * places[sheet_faces(last)], edgecolor="white", linewidth=0.3)
    faces.set_array(angle)
    faces.set(cmap="RdBu_r", clim=(-np.abs(angle).max(), np.abs(angle).max()))

    figure = plt.figure(figsize=(7.0, 5.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    axes.add_collection3d(faces)
    axes.set(xlim=(-50, 50), ylim=(-50, 50), zlim=(-25, 5), xlabel="x [mm]", ylabel="y [mm]")
    axes.set_box_aspect((100, 100, 30))
    figure.colorbar(faces, label="shear angle [°]", shrink=0.7)
    figure.savefig(folder / "dome.png", dpi=150)
    plt.close(figure)
    print(f"picture: {folder / 'dome.png'}")
    assert (folder / "dome.png").stat().st_size > 20_000


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/plot"))
