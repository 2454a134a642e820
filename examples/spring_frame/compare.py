"""A hemisphere under a blank holder, a frame of springs, and neither: shear, draw-in, wrinkles.

    python examples/spring_frame/compare.py [FOLDER] [--edge MM]

Writes ``table.md`` to the folder (``results/spring_frame``). Results that lie there already are
taken from there. It takes about two minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields import read_forming

EXAMPLES = Path(__file__).resolve().parents[1]
HOLDER = EXAMPLES / "hemisphere_holder" / "scene.toml"
FRAME = EXAMPLES / "spring_frame" / "scene.toml"
#: Scene and what differs from it, by name.
CASES = {
    "blank holder of 1.7 kg": (HOLDER, ()),
    "frame, 1 N and 0.02 N/mm": (FRAME, ()),
    "frame, 4 N and 0.08 N/mm": (
        FRAME, ("grippers.frame.force=4 N", "grippers.frame.stiffness=0.08 N/mm"),
    ),
    "neither": (FRAME, ("grippers=[]",)),
}  # fmt: skip
HEAD = (
    "| the sheet is held by | punch [N] | shear | middle of a side drawn in [mm] | thickness [mm] "
    "| largest wrinkle [mm] | rim rises by [mm] |\n|---|---|---|---|---|---|---|"
)


def row(name: str, folder: Path, edge: float) -> str:
    """Form the sheet, or read what has been formed; return its row of the table."""
    own = folder / name.replace(" ", "_").replace("/", "_per_").replace(",", "")
    if not (own / "summary.json").is_file():
        file, overrides = CASES[name]
        run(read_scene(file, (f"blank.edge_length={edge:g} mm", *overrides)), out=own)
    summary = json.loads((own / "summary.json").read_text(encoding="utf-8"))
    last = read_forming(own / "forming.nc").isel(time=-1)
    start = 1e3 * np.stack([last[f"reference_position_{axis}"] for axis in "xyz"])
    moved = 1e3 * np.stack([last[f"displacement_{axis}"] for axis in "xyz"])
    middle = np.argmin(np.hypot(start[0] - 150.0, start[1]))
    load = summary["tool_loads"]["punch"]
    shear = np.degrees(summary["shear_angle_max_rad"])
    return (
        f"| {name} | {load['force_quoted_N']:.1f} ± {load['force_quoted_uncertainty_N']:.1g} "
        f"| up to {shear:.1f}° | {-moved[0, middle]:.1f} "
        f"| {1e3 * summary['thickness_min_m']:.3f} to {1e3 * summary['thickness_max_m']:.3f} "
        f"| {1e3 * summary['wrinkle_height_max_m']:.1f} | {moved[2].max():.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/spring_frame"))
    parser.add_argument("--edge", type=float, default=5.0, help="edge length [mm]")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table = HEAD
    for name in CASES:
        table += "\n" + row(name, given.folder, given.edge)
        print(table, flush=True)
    (given.folder / "table.md").write_text(table + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
