"""Build a co-simulation unit of a scene, and run it in a master: fmpy.

Usage: python examples/scripts/unit.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy

from lcmchain import read_scene, run
from lcmchain.fmu.build import build_fmu

SCENE = Path(__file__).with_name("dome.toml")
OUTPUTS = ["punch.travel", "punch.force", "thickness_min", "shear_angle_max"]


def main(folder: Path) -> None:
    """Run the unit and the process itself with the same steps of communication."""
    process = run(read_scene(SCENE), folder / "process")
    unit = build_fmu(SCENE, folder / "dome.fmu")
    found = fmpy.simulate_fmu(str(unit), stop_time=0.1, output_interval=0.02, output=OUTPUTS)
    for row in found:
        print("  ".join(f"{name} {row[name]:.4g}" for name in found.dtype.names))
    # the unit stopped where the process saved its states: every bit is the same
    sheet = process.datasets["/"]
    assert (found["thickness_min"] == sheet["thickness"].min("sheet_face").values).all()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/unit"))
