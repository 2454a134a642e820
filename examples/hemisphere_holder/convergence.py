"""How far the result depends on process time, edge length and mass damping.

    python examples/hemisphere_holder/convergence.py [--out results/convergence]

Runs the scene as it is and with one entry changed at a time, and prints the differences. Takes
some minutes on two cores; the fine mesh needs eight times the work of the scene.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields.measures import LOCAL_AREAS, area_mean_shear, draw_in, field_differences

SCENE = Path(__file__).with_name("scene.toml")
VARIANTS = {
    "as it is": [],
    "process time x 2": ['process.time="400 ms"'],
    "damping / 2": ['process.mass_damping="100 1/s"'],
    "edge length / 2": ['blank.edge_length="2.5 mm"'],
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/convergence"))
    out = parser.parse_args().out
    sheets = {}
    for name, overrides in VARIANTS.items():
        folder = out / name.replace(" ", "_").replace("/", "over")
        result = run(read_scene(SCENE, ["output.pictures=false", *overrides]), folder)
        sheets[name] = result.datasets["/"]
        print(f"{name}: {result.summary['wall_s']:.0f} s, draw-in "
              f"{1e3 * draw_in(sheets[name]):.2f} mm, balance error "
              f"{result.summary['balance_error_max']:.2%}", flush=True)  # fmt: skip

    base = sheets["as it is"]
    print("\nroot mean square over the sheet, against the scene as it is")
    for name in ("process time x 2", "damping / 2"):
        difference = field_differences(sheets[name], base)
        print(f"  {name}: position {1e3 * difference['position']:.3f} mm, shear angle "
              f"{np.degrees(difference['shear_angle']):.2f} deg, thickness "
              f"{100 * difference['thickness']:.2f} %")  # fmt: skip

    coarse, fine = area_mean_shear(base), area_mean_shear(sheets["edge length / 2"])
    change = {area: abs(np.degrees(fine[area] - coarse[area])) for area in coarse}
    values = np.array(list(change.values()))
    print("\nshear angles averaged over squares of 20 mm, edge length halved")
    for name, area in LOCAL_AREAS.items():
        angle = np.degrees(abs(coarse[area]))
        print(f"  {name}: {angle:.1f} deg, changes by {change[area]:.2f} deg")
    print(f"  all {len(values)}: root mean square {np.sqrt(np.mean(values**2)):.2f} deg, largest "
          f"{values.max():.1f} deg, {np.sum(values < 1.5)} below 1.5 deg")  # fmt: skip


if __name__ == "__main__":
    main()
