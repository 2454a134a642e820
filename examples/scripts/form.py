"""Form a sheet, and see what the run says of its own accuracy.

Usage: python examples/scripts/form.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run

SCENE = Path(__file__).with_name("dome.toml")


def main(folder: Path) -> None:
    """Form the dome, print its results, and check that it is right."""
    result = run(read_scene(SCENE), folder)
    summary, sheet = result.summary, result.datasets["/"]
    last = sheet.isel(time=-1)
    print(f"shear angle     {np.degrees(summary['shear_angle_max_rad']):6.1f} ° at most")
    print(f"thickness       {1e3 * summary['thickness_min_m']:6.3f} mm at least")
    print(f"force           {summary['punch_force_max_N']:6.2f} N at most")
    print(f"energy balance  {summary['balance_error_max']:6.1e} of the work of the tools")
    for warning in summary["warnings"]:
        print("told:", warning)

    assert summary["state"] == "complete"
    assert summary["balance_error_max"] < 0.005
    # a fabric of 0°/90° on a dome: the quadrants mirror each other
    angle = np.abs(last["shear_angle"].values)
    side = round(len(angle) ** 0.5)
    quadrants = angle.reshape(side, side)
    assert np.abs(quadrants - quadrants[::-1]).max() < 0.05 * angle.max()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/form"))
