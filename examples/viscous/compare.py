"""What the speed does to the force of a hemisphere of wet fabric.

    python examples/viscous/compare.py [FOLDER] [--edge MM]

Forms the scene beside this file in 400 ms and in 100 ms, with its fabric that resists the rate of
its shear and with the same fabric dry. Writes ``table.md`` to the folder (``results/viscous``).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields import read_forming

HERE = Path(__file__).resolve().parent
TIMES = (400.0, 100.0)  # [ms]
HEAD = (
    "| fabric | time [ms] | punch [N] | shear | lost to the rate [J] | work of the punch [J] "
    "| steps |\n|---|---|---|---|---|---|---|"
)


def row(name: str, time: float, folder: Path, edge: float) -> str:
    """Form with or without what resists the rate; return the row of the table."""
    scene = read_scene(
        HERE / "scene.toml", [f"process.time={time} ms", f"blank.edge_length={edge} mm"]
    )
    if name == "dry":
        entries = {"material": scene.material.model_copy(update={"viscous": None})}
        scene = scene.model_copy(update=entries)
    own = folder / f"{name}_{time:g}"
    summary = run(scene, out=own).summary
    last = read_forming(own / "forming.nc").isel(time=-1)
    shear = np.degrees(np.abs(np.asarray(last["shear_angle"])))
    energy, steps = summary["energy"], summary["step_count"]
    return (
        f"| {name} | {time:g} | {summary['punch_force_quoted_N']:.1f} | up to {shear.max():.1f}° "
        f"| {energy.get('viscous', 0.0):.3f} | {energy['external']:.3f} | {steps:,} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/viscous"))
    parser.add_argument("--edge", type=float, default=10.0, help="edge length [mm]")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table = HEAD
    for name in ("wet", "dry"):
        for time in TIMES:
            table += "\n" + row(name, time, given.folder, given.edge)
            print(table, flush=True)
    (given.folder / "table.md").write_text(table + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
