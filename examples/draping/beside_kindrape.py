"""Lay the net of scene.toml with KinDrape too, and compare both with the exact net.

    python examples/draping/beside_kindrape.py KinDrape_eff_NR.py

KinDrape (Krogh, Bak, Lindgaard et al. 2021, "A simple MATLAB draping code for fiber-reinforced
composites", github.com/chrkrogh/KinDrape) is not part of this project: give the path of its Python
file. Its mould is a unit hemisphere, a surface interpolated through points, and its nodes lie on it
within 5e-6.
"""

from __future__ import annotations

import sys
import time
import types
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from lcmchain import read_scene
from lcmchain.draping import drape

BAR, CELLS = 0.075, 23
# Cells that reach farther down than this [m] are left out: there the other mould ends.
LOWEST = 0.16


def main() -> None:
    code = Path(sys.argv[1]).read_text(encoding="utf-8")
    scene = read_scene(Path(__file__).with_name("scene.toml"))
    net = drape(scene)
    own = min(drape(scene, tools=net.tools).wall_s for _ in range(5))
    nodes, shear, other = laid_by_kindrape(code)

    centres = net.mesh.node_positions[net.mesh.elements].mean(axis=1)[:, :2]
    column = np.rint(centres / BAR).astype(int) + CELLS // 2
    theirs = shear.reshape(CELLS, CELLS).T[column[:, 0], column[:, 1]]
    ours = np.degrees(np.abs(net.shear_angle))
    exact = np.degrees(exact_shear(np.abs(centres.prod(axis=1))))
    height = net.positions[:, 2] + 0.999498
    seen = (height[net.mesh.elements] > LOWEST).all(axis=1) & np.isfinite(theirs)
    print(f"{seen.sum()} cells; laid in {1e3 * own:.1f} ms, by KinDrape in {other:.2f} s")
    for name, a, b in (
        ("this net, from the exact", ours, exact),
        ("KinDrape, from the exact", theirs, exact),
        ("this net, from KinDrape", ours, theirs),
    ):
        error = np.abs(a - b)[seen]
        print(f"{name}: shear angle {error.max():.4f} deg at most, {np.mean(error):.4f} on average")
    index = np.rint(net.mesh.node_positions[:, :2] / BAR + 0.5 * CELLS).astype(int)
    apart = nodes[index[:, 0], index[:, 1]] - net.positions - [0.0, 0.0, 0.999498]
    distance = np.linalg.norm(apart, axis=1)[height > LOWEST]
    print(f"nodes: {np.nanmax(distance) / BAR:.4f} bars apart at most")


def laid_by_kindrape(code: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Return nodes [m], shear angles of the cells [deg], and the time it took [s]."""
    module = types.ModuleType("kindrape")
    code = code.replace("np.NaN", "np.nan")  # a name that NumPy 2 has dropped
    code = code.replace("return Node, CellShear, ax, fig", "return Node, CellShear, None, None")
    exec(compile(code, "KinDrape", "exec"), module.__dict__)
    start = time.process_time()
    origin, first = [-0.5 * BAR, -0.5 * BAR], [CELLS // 2, CELLS // 2]
    found = module.KinDrape_eff_NR(BAR, [CELLS + 1, CELLS + 1], origin, 0, first, 0.0, False)
    return found[0], found[1], time.process_time() - start


def exact_shear(s: np.ndarray) -> np.ndarray:
    """Return the shear angle of the exact net of the unit sphere at s = u v (manual: draping)."""
    first = 1e-4
    found = solve_ivp(
        lambda s, y: [y[1], (-np.sin(y[0]) - y[1]) / s],
        (first, 4.0),
        [np.pi / 2 - first, -1.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        dense_output=True,
    )
    return np.where(s < first, s, np.pi / 2 - found.sol(np.maximum(s, first))[0])


if __name__ == "__main__":
    main()
