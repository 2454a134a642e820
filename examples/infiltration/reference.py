"""The filling of the formed hemisphere beside a solver that shares neither method nor code with it.

    python examples/infiltration/reference.py results/infiltration/forming.nc

Fills the formed sheet from the round gate of ``pole.toml``, and solves the same with
``tests/coupling/reference/hele_shaw.py`` on the same mesh and material: linear elements, no front
and no time steps. The reference cuts every cell into ever smaller ones until the gate is round;
its limit is extrapolated. Prints the fill time and the filled share on the way.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.scene import read_infiltration

HERE = Path(__file__).resolve().parent
REFERENCE = HERE.parents[1] / "tests/coupling/reference/hele_shaw.py"
#: Shares of the fill time at which both fronts are compared.
SHARES = (0.1, 0.3, 0.6)


def reference_module() -> ModuleType:
    """The reference solver; it belongs to the tests, so that the package does not have it."""
    spec = importlib.util.spec_from_file_location("hele_shaw", REFERENCE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def references(filling: Filling, point: np.ndarray, levels: int) -> list:
    """Models of the reference on cells cut 0, 1, ... times."""
    solver = reference_module()
    preform, mesh = filling.medium.preform, filling.mesh
    (gate,) = filling.supply.gates
    viscosity = 1.0 / filling.liquid.fluidity(filling.medium, filling.state)[0]
    points, triangles, owner = solver.triangles_of(mesh.points, mesh.cells)
    models = []
    for _ in range(levels + 1):
        inside = np.linalg.norm(points - point, axis=1) <= gate.radius
        models.append(
            solver.HeleShaw(
                points, triangles, preform.thickness[owner], preform.porosity[owner],
                preform.permeability[owner], viscosity, gate.pressure, np.flatnonzero(inside),
            )
        )  # fmt: skip
        points, triangles, _ = solver.refined(points, triangles, np.empty(0, dtype=int))
        owner = np.tile(owner, 4)
    return models


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("forming", type=Path, help="forming.nc of scene.toml")
    parser.add_argument("--levels", type=int, default=2, help="how often cells are cut, 2 or more")
    arguments = parser.parse_args()
    case = read_infiltration(HERE / "pole.toml")
    filling = set_up(read_formed_part(arguments.forming), case).filling()
    point = np.array(case.gates[0].point)
    models = references(filling, point, max(arguments.levels, 2))
    times = np.array([model.nodal_fill_time for model in models])
    # Each cut leaves about the same share of the error of the one before.
    first, second = np.diff(times[-3:])
    ratio = min(abs(second / first), 0.9)
    limit = times[-1] + second * ratio / (1.0 - ratio)
    print("reference, cells cut 0, 1, ... times: " + ", ".join(f"{t:.0f} s" for t in times))
    print(f"reference, limit:                     {limit:.0f} s")
    pores = filling.pores.sum()
    for share in SHARES:
        filling.advance(share * limit)
        wet = models[1].wet_volume(share * models[1].fill_time)
        found = filling.filled_share
        print(
            f"filled at {share:.0%} of the time: {found:.1%}, reference {wet / pores:.1%} "
            f"({100.0 * (found - wet / pores):+.1f} % of the pores)"
        )
    filling.advance(10.0 * limit)
    print(
        f"filled: {filling.time:.0f} s, reference {limit:.0f} s ({filling.time / limit - 1:+.1%})"
    )


if __name__ == "__main__":
    main()
