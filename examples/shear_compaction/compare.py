"""What the shear-compaction coupling does to a formed hemisphere, and to its filling.

    python examples/shear_compaction/compare.py [FOLDER] [--edge MM]

Forms the hemisphere of ``examples/hemisphere_holder`` with β = 0, 0.5 and 1, fills each from the
pole, and writes ``table.md`` to the folder (``results/shear_compaction``).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.stage import fill
from lcmchain.fields import read_forming
from lcmchain.scene import read_infiltration

EXAMPLES = Path(__file__).resolve().parents[1]
COUPLINGS = (0.0, 0.5, 1.0)
HEAD = (
    "| β | thickness [mm] | at 40° to 50° of shear | fibre volume fraction | punch [N] "
    "| shear | filled after [min] |\n|---|---|---|---|---|---|---|"
)


def row(coupling: float, folder: Path, edge: float) -> str:
    """Form and fill with one coupling; return its row of the table."""
    scene = read_scene(
        EXAMPLES / "hemisphere_holder" / "scene.toml",
        [f"material.compaction.shear_coupling={coupling}", f"blank.edge_length={edge} mm"],
    )
    own = folder / f"beta_{coupling:g}"
    summary = run(scene, out=own).summary
    last = read_forming(own / "forming.nc").isel(time=-1)
    thickness = 1e3 * np.asarray(last["thickness"])
    shear = np.degrees(np.abs(np.asarray(last["shear_angle"])))
    sheared = thickness[(shear > 40.0) & (shear < 50.0)]
    case = read_infiltration(EXAMPLES / "infiltration" / "pole.toml")
    filled = fill(read_formed_part(own / "forming.nc"), case)
    return (
        f"| {coupling:g} | {thickness.min():.3f} to {thickness.max():.3f} "
        f"| {sheared.mean():.3f} | up to {summary['fibre_volume_fraction_max']:.3f} "
        f"| {summary['punch_force_max_N']:.2f} | up to {shear.max():.1f}° "
        f"| {np.nanmax(filled.fill_time) / 60.0:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/shear_compaction"))
    parser.add_argument("--edge", type=float, default=5.0, help="edge length [mm]")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table = HEAD
    for coupling in COUPLINGS:
        table += "\n" + row(coupling, given.folder, given.edge)
        print(table, flush=True)
    (given.folder / "table.md").write_text(table + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
