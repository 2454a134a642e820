"""What unlike orientations of plies do: like and unlike plies, little and much friction.

    python examples/hemisphere_stack/compare.py [--edge-length "7.5 mm"] [--out DIR] [--table F.md]

Forms two plies over the hemisphere, with holder and without, eight runs in all, and draws the upper
ply of each with the height of its wrinkles. The table has the largest mean force of the punch, the
height of the wrinkles, what sliding between the plies and on the tools takes of the external work,
and the energy balance. Results that lie in the folder already are taken from there.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.collections import PolyCollection

from lcmchain import read_scene, run

SCENE = Path(__file__).with_name("scene.toml")
LIKE, UNLIKE = "[0/90]2", "[0/90, 45/-45]"
LITTLE, MUCH = 0.1, 0.6
MOST_HEIGHT = 5.0  # in the colours [mm]
COLUMNS = (
    "plies", "friction between them", "holder", "force [N]", "wrinkles [mm]",
    "lost by friction [%]", "balance [%]",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--edge-length", default="7.5 mm")
    parser.add_argument("--out", type=Path, default=Path("results/orientations"))
    parser.add_argument("--table", type=Path, help="write the table here")
    options = parser.parse_args()
    rows = []
    figure, axes = plt.subplots(2, 4, figsize=(16, 8.6), constrained_layout=True)
    for row, held in enumerate((True, False)):
        for column, (layup, friction) in enumerate(
            (layup, friction) for layup in (LIKE, UNLIKE) for friction in (LITTLE, MUCH)
        ):
            folder = options.out / f"{'held' if held else 'free'}_{column}"
            formed = formed_stack(folder, layup, friction, held, options.edge_length)
            rows.append((layup, f"{friction:g}", "yes" if held else "no", *figures(formed)))
            draw(axes[row, column], folder, rows[-1])
    figure.colorbar(axes[0, 0].collections[0], ax=axes, label="height of wrinkles [mm]", shrink=0.6)
    figure.savefig(options.out / "orientations.png", dpi=70)
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    print(table)
    if options.table:
        options.table.write_text(table + "\n", encoding="utf-8")


def formed_stack(folder: Path, layup: str, friction: float, held: bool, edge: str) -> Any:
    """Return the summary of a run, from the folder if it is there."""
    file = folder / "summary.json"
    if not file.exists():
        overrides = [
            f'layup="{layup}"',
            f"interfaces[0].friction={friction}",
            f"blank.edge_length={edge}",
            "output.pictures=false",
            "output.vtu=false",
        ]
        scene = read_scene(SCENE, overrides)
        if not held:
            tools = tuple(tool for tool in scene.tools if tool.name != "holder")
            scene = scene.model_copy(update={"tools": tools})
        run(scene, folder)
    return json.loads(file.read_text(encoding="utf-8"))


def figures(formed: dict[str, Any]) -> tuple[str, ...]:
    """Return force, wrinkles, share of friction and balance as texts."""
    energy = formed["energy"]
    wrinkles = max(1e3 * ply["wrinkle_height_max_m"] for ply in formed["plies"].values())
    return (
        f"{formed['punch_force_max_N']:.1f}",
        f"{wrinkles:.1f}",
        f"{100 * energy['friction'] / energy['external']:.1f}",
        f"{100 * formed['balance_error_max']:.3f}",
    )


def draw(axis: Any, folder: Path, row: tuple[str, ...]) -> None:
    """Draw the upper ply from above."""
    ply = xr.open_dataset(folder / "forming.nc", group="ply_2").isel(time=-1)
    # triangles leave their last place empty
    faces = [face[face >= 0].astype(int) for face in ply["ply_2_face_nodes"].values]
    x, y = (1e3 * ply[f"ply_2_node_{axis_name}"].values for axis_name in "xy")
    corner = [np.column_stack([x[face], y[face]]) for face in faces]
    at_nodes = 1e3 * ply["wrinkle_height"].values
    height = np.array([at_nodes[face].mean() for face in faces])
    drawn = PolyCollection(
        corner, array=height, cmap="PuOr_r", edgecolor="0.7", linewidth=0.2, antialiased=False
    )
    drawn.set_clim(-MOST_HEIGHT, MOST_HEIGHT)
    axis.add_collection(drawn)
    axis.set_aspect("equal")
    axis.set_xlim(-155, 155)
    axis.set_ylim(-155, 155)
    axis.set_xticks([])
    axis.set_yticks([])
    holder = "with holder" if row[2] == "yes" else "without holder"
    axis.set_title(f"{row[0]}, friction {row[1]}, {holder}\n{row[3]} N, up to {row[4]} mm")


if __name__ == "__main__":
    main()
