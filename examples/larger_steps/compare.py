"""What larger steps cost in accuracy: added mass, a lower fibre modulus, a shorter process.

    python examples/larger_steps/compare.py [--edge 10] [--scene S.toml] [--out DIR] [--table F.md]

Runs ``examples/hemisphere_holder``, with the time of ``with_time.py``, as it is and with one option
of ``[process]`` changed at a time, on one mesh, so that fields are compared face by face without
mapping. Writes a table: steps, time step, and what each option changes in shear angle, thickness
and force against the first row. Ends with an error where an option does not do what it states: the
step, the added mass, or the fibre strain.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from lcmchain import read_scene, run

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

SCENE = Path(__file__).parents[1] / "hemisphere_holder" / "scene.toml"
FIRST = "as it is"
CASES: dict[str, tuple[str, ...]] = {
    FIRST: (),
    "mass x 4": ("process.mass_scaling.factor=4",),
    "mass x 4, damping / 2": ("process.mass_scaling.factor=4", 'process.mass_damping="100 1/s"'),
    "step of 12 us": ('process.mass_scaling.target_step="12 us"',),
    "fibre modulus / 4": ("process.fibre_modulus_factor=0.25",),
    "fibre modulus / 16": ("process.fibre_modulus_factor=0.0625",),
    "half the time": ('process.time="100 ms"',),
    "half the time, fibre modulus / 4": (
        'process.time="100 ms"',
        "process.fibre_modulus_factor=0.25",
    ),
}
COLUMNS = (
    "case", "steps", "mean step [us]", "added mass", "fibre strain [%]",
    "damping of the work", "shear angle, rms [°]", "thickness, rms [%]", "largest mean force [N]",
)  # fmt: skip


def results_of(scene_file: Path, overrides: tuple[str, ...], folder: Path) -> dict[str, Any]:
    """Run a case, or take it from its folder; return its summary and last fields."""
    if not (folder / "summary.json").is_file():
        first = entries_with_time(scene_file.resolve().parent.name)
        run(read_scene(scene_file, overrides=(*first, *overrides)), folder)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    with xr.open_dataset(folder / "forming.nc", engine="netcdf4") as sheet:
        last = sheet.isel(time=-1)
        fields = {name: last[name].values for name in ("shear_angle", "thickness")}
    return {"summary": summary, **fields}


def row_of(case: str, own: dict[str, Any], first: dict[str, Any]) -> list[str]:
    """Return a row of the table; differences are those from ``first``."""
    summary = own["summary"]
    shear = np.degrees(own["shear_angle"] - first["shear_angle"])
    thickness = 100.0 * (own["thickness"] / first["thickness"] - 1.0)
    return [
        case,
        f"{summary['step_count']:,}",
        f"{1e6 * summary['process_time_s'] / summary['step_count']:.2f}",
        f"{100 * summary['mass_added_total']:.0f} %",
        f"{100 * summary['fibre_strain_largest']:.2g}",
        f"{100 * summary['damping_to_external']:.1f} %",
        "" if own is first else f"{math.sqrt(float(np.mean(shear**2))):.2f}",
        "" if own is first else f"{math.sqrt(float(np.mean(thickness**2))):.2f}",
        f"{summary['punch_force_max_N']:.2f}",
    ]


def complaints(found: dict[str, dict[str, Any]]) -> list[str]:
    """Say where an option does not do what it states."""
    wrong = []
    first = found[FIRST]["summary"]

    def longer(case: str) -> float:
        """Step of a case over that of the first."""
        own = found[case]["summary"]
        steps = first["step_count"] / own["step_count"]
        return steps * own["process_time_s"] / first["process_time_s"]

    for case, expected in (("mass x 4", 2.0), ("fibre modulus / 4", 2.0)):
        if not 0.95 * expected < longer(case) < 1.05 * expected:
            wrong.append(f"{case}: the step is {longer(case):.2f} times as long, not {expected:g}")
    if abs(found["mass x 4"]["summary"]["mass_added_total"] - 3.0) > 1e-9:
        wrong.append("mass x 4: three times the mass is not what was added")
    strain = {case: own["summary"]["fibre_strain_largest"] for case, own in found.items()}
    if not strain["fibre modulus / 16"] > strain["fibre modulus / 4"] > strain[FIRST]:
        wrong.append("fibres with a lower modulus do not strain more")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scene", type=Path, default=SCENE)
    parser.add_argument("--edge", type=float, default=10.0, help="edge length [mm]")
    parser.add_argument("--out", type=Path, default=Path("larger_steps"))
    parser.add_argument("--table", type=Path, help="file of the table, besides the terminal")
    arguments = parser.parse_args()
    mesh = (
        f'blank.edge_length="{arguments.edge:g} mm"', "mapping=[]", "output.pictures=false",
        "output.vtu=false",
    )  # fmt: skip
    found = {}
    for case, overrides in CASES.items():
        folder = arguments.out / case.replace(" ", "_").replace("/", "by").replace(",", "")
        found[case] = results_of(arguments.scene, (*mesh, *overrides), folder)
        print(f"{case}: {found[case]['summary']['step_count']:,} steps", file=sys.stderr)
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for case, own in found.items():
        lines.append("| " + " | ".join(row_of(case, own, found[FIRST])) + " |")
    text = "\n".join(lines) + "\n"
    print(text)
    if arguments.table is not None:
        arguments.table.write_text(text, encoding="utf-8")
    wrong = complaints(found)
    for complaint in wrong:
        print(complaint, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
