"""How far the results depend on edge length, process time, damping and contact stiffness.

    python examples/hemisphere_holder/convergence.py [--scenes A.toml B.toml] [--out DIR]
        [--table F.md] [--edges 10 7.5 5 3.75 2.5] [--quick]

Runs both hemispheres, with the time of ``with_time.py``, and with one entry changed at a time;
writes tables: punch force, work, draw-in, shear angles, least thickness, largest fibre volume
fraction, hourglass energy; for the edge lengths with the order observed over the three finest
meshes and the value that they lead to (Richardson). Results that lie in the folder already are
taken from there: a study can go on after an interruption. The 2.5 mm mesh needs eight times the
work of the scene; ``--quick`` leaves out all but the edge lengths.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from lcmchain import read_scene, run
from lcmchain.errors import SimulationError
from lcmchain.fields.measures import LOCAL_AREAS, area_mean_shear, draw_in
from lcmchain.model import build_model

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

HERE = Path(__file__).parent
SCENES = [HERE / "scene.toml", HERE.with_name("hemisphere_free") / "scene.toml"]
HEAD = """# Convergence table

Written by `python examples/hemisphere_holder/convergence.py --table FILE.md`. Columns are runs:
edge lengths, then the scene with one entry changed. All of them take 200 ms, with a damping of 200
1/s and the fibre modulus of the fabric (`examples/with_time.py`). The last column is the order
observed over the three finest meshes and the value that they lead to; where their values follow no
order, how far they lie apart. The punch force is the largest mean over a twentieth of the process,
the peak that of a single step.

"""
EDGE = 'blank.edge_length="{:g} mm"'
OTHERS = {
    "process time x 2": ('process.time="400 ms"',),
    "damping / 2": ('process.mass_damping="100 1/s"',),
    "damping / 4": ('process.mass_damping="50 1/s"',),
    "contact stiffness x 2": ("contact.penalty={penalty}",),
    "fibres bend twice as hard in the plane": ("material.bending.in_plane=0.2",),
    "fibres in the plane as published": (
        "element.fibre_hourglass=1",
        "material.bending.in_plane=0",
    ),
    "2D approach": ("element=membrane-shell", "permeability=none"),
}
MEASURES = {
    "punch force [N]": "{:.2f}",
    "peak of a step [N]": "{:.2f}",
    "work [mJ]": "{:.1f}",
    "draw-in [mm]": "{:.2f}",
    "mean shear by present area [°]": "{:.2f}",
    **{f"{name} [°]": "{:.1f}" for name in LOCAL_AREAS},
    "least thickness [mm]": "{:.4f}",
    "largest v_f": "{:.3f}",
    "hourglass / internal [%]": "{:.2f}",
    "balance error [%]": "{:.3f}",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=Path, nargs="+", default=SCENES)
    parser.add_argument("--out", type=Path, default=Path("results/convergence"))
    parser.add_argument("--table", type=Path, help="Markdown file to write")
    parser.add_argument("--edges", type=float, nargs="+", default=[10.0, 7.5, 5.0, 3.75, 2.5])
    parser.add_argument("--quick", action="store_true", help="edge lengths only")
    arguments = parser.parse_args()
    text = HEAD + "\n".join(study(arguments, scene) for scene in arguments.scenes)
    print(text)
    if arguments.table is not None:
        arguments.table.write_text(text, encoding="utf-8")


def study(arguments, scene: Path) -> str:
    """Run all variants of a scene, and return their table."""
    found = {}
    for edge in sorted(arguments.edges, reverse=True):
        found[f"{edge:g} mm"] = measured(arguments, scene, f"{edge:g} mm", (EDGE.format(edge),))
    for name, overrides in {} if arguments.quick else OTHERS.items():
        found[name] = measured(arguments, scene, name, overrides)
    return table(arguments, scene, found)


def measured(
    arguments, path: Path, name: str, overrides: tuple[str, ...]
) -> dict[str, float] | str:
    """Return the measures of a variant, or in words why there are none."""
    folder = arguments.out / path.parent.name / name.replace(" ", "_").replace("/", "over")
    kept = folder / "measures.json"
    if kept.exists():
        return json.loads(kept.read_text())
    first = entries_with_time(path.resolve().parent.name)
    penalty = build_model(read_scene(path, first)).environment.penalty
    twice = f'"{2e-9 * penalty:.6g} N/mm^3"'  # from N/m³
    overrides = tuple(entry.format(penalty=twice) for entry in overrides)
    try:
        result = run(read_scene(path, ["output.pictures=false", *first, *overrides]), folder)
    except SimulationError as error:  # a guard that stops a coarse mesh is a result too
        return str(error).split(". Likely")[0]
    values = measures(result)
    kept.write_text(json.dumps(values))
    print(f"{name}: {values}", flush=True)
    return values


def measures(result) -> dict[str, float]:
    """Return the measures of a run."""
    sheet, summary = result.datasets["/"], result.summary
    energy, shear = summary["energy"], area_mean_shear(sheet)
    last = {name: sheet[name].values[-1] for name in sheet.data_vars if "time" in sheet[name].dims}
    area = last["areal_fibre_mass"] ** -1  # present area of equal parts of the sheet
    values = {
        "punch force [N]": summary["punch_force_max_N"],
        "peak of a step [N]": summary.get("punch_force_peak_N", np.nan),
        "work [mJ]": 1e3 * energy["external"],
        "draw-in [mm]": 1e3 * draw_in(sheet),
        # By present area, in which sheared elements count less; by material it is larger.
        "mean shear by present area [°]": np.degrees(
            np.average(np.abs(last["shear_angle"]), weights=area)
        ),
        **{f"{name} [°]": abs(np.degrees(shear[a])) for name, a in LOCAL_AREAS.items()},
        "least thickness [mm]": 1e3 * last["thickness"].min() if "thickness" in last else np.nan,
        "largest v_f": last.get("fibre_volume_fraction", np.array([np.nan])).max(),
        "hourglass / internal [%]": 100.0 * energy["hourglass"] / energy["internal"],
        "balance error [%]": 100.0 * summary["balance_error_max"],
    }
    return {name: float(value) for name, value in values.items()}


def order_and_limit(edges, values) -> tuple[float, float] | None:
    """Return order p and limit of f = f0 + C h^p through three values; None if not monotone."""
    (h1, h2, h3), (f1, f2, f3) = edges, values
    if (f1 - f2) * (f2 - f3) <= 0.0:
        return None
    ratio = (f1 - f2) / (f2 - f3)

    def excess(p):
        return (h1**p - h2**p) / (h2**p - h3**p) - ratio

    if excess(0.1) * excess(8.0) > 0.0:
        return None
    p = brentq(excess, 0.1, 8.0)
    return p, f3 - (f2 - f3) * h3**p / (h2**p - h3**p)


def table(arguments, scene: Path, found) -> str:
    """Return the table in Markdown; a column for every run."""
    title = read_scene(scene).title
    runs = {name: values for name, values in found.items() if not isinstance(values, str)}
    finest = sorted(arguments.edges)[:3][::-1]
    meshes = [runs.get(f"{edge:g} mm") for edge in finest]
    complete = len(finest) == 3 and None not in meshes
    lines = [f"## {title}", "", f"| | {' | '.join(runs)} | order, limit |"]
    lines.append("|---" + "|---:" * (len(runs) + 1) + "|")
    for name, form in MEASURES.items():
        cells = [
            "" if np.isnan(values[name]) else form.format(values[name]) for values in runs.values()
        ]
        richardson = "not enough meshes"
        if complete:
            order = order_and_limit(finest, [values[name] for values in meshes])
            spread = np.ptp([values[name] for values in meshes])
            richardson = f"none, within {form.format(spread)}"
            if order is not None:
                richardson = f"{order[0]:.1f}, {form.format(order[1])}"
        lines.append(f"| {name} | {' | '.join(cells)} | {richardson} |")
    lines += ["", *(f"- {name}: {why}" for name, why in found.items() if isinstance(why, str)), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
