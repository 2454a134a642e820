"""Form a stack of two plies of unlike angle, and read each ply and what lies between them.

Usage: python examples/scripts/stack.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields.sheet import sheet_faces

SCENE = Path(__file__).with_name("dome.toml")
STACK = [
    'layup="[0/90, 45/-45]"',
    "interfaces=[{friction = 0.2}]",
    "tools.punch.position=0 0 2.008 mm",
    "tools.die.shape.hole_radius=28.004 mm",
]


def main(folder: Path) -> None:
    """Lay a second ply at 45° under the punch of the dome, and form both."""
    result = run(read_scene(SCENE, STACK), folder)
    sheared = []
    for name in ("ply_1", "ply_2"):
        ply = result.datasets[f"/{name}"].isel(time=-1)
        angle = np.abs(ply["shear_angle"].values)
        nodes = np.stack([ply[f"reference_position_{k}"].values for k in "xy"], axis=1)
        x, y = nodes[sheet_faces(ply)[angle.argmax()]].mean(axis=0)
        place = np.degrees(np.arctan2(min(abs(x), abs(y)), max(abs(x), abs(y))))
        sheared.append(place)
        slip = 1e3 * np.nanmax(ply[f"slip_path_{'top' if name == 'ply_1' else 'bottom'}"].values)
        print(f"{name}: sheared by {np.degrees(angle.max()):.1f} ° at most, {place:.0f} ° off an "
              f"axis of the blank; slid by {slip:.1f} mm on the other ply")  # fmt: skip
    stack = result.datasets["/"].isel(time=-1)
    print(f"stack: {1e3 * stack['stack_thickness'].max():.3f} mm thick at most")

    assert result.summary["balance_error_max"] < 0.005
    # each shears most between its own fibres
    assert sheared[0] > 30.0 and sheared[1] < 15.0


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/stack"))
