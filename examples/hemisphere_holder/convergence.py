"""How far the results depend on edge length, pace, damping and contact stiffness.

    python examples/hemisphere_holder/convergence.py [--cases NAME ...] [--out DIR]
        [--table F.md] [--quick]

Runs both hemispheres as they are shipped, with the pace that the program finds, and the one with a
holder at half its size; on several meshes, and with one entry changed at a time. Writes tables:
punch force and what the run says it may be off by, work, draw-in, shear angles, least thickness,
largest fibre volume fraction, hourglass energy; for the edge lengths with the order observed over
the three finest meshes and the value that they lead to (Richardson). Results that lie in the folder
already are taken from there: a study can go on after an interruption. The 2.5 mm mesh needs eight
times the work of the scene; ``--quick`` leaves out all but the edge lengths.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from lcmchain import read_scene, run
from lcmchain.errors import SimulationError
from lcmchain.fields.sheet import reference_positions
from lcmchain.model import build_model
from lcmchain.verification.hemisphere import LOCAL_AREAS, area_mean_shear, draw_in

EXAMPLES = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(EXAMPLES / "quasi_static"))
from compare import scaled  # noqa: E402


class Case(NamedTuple):
    """A scene, its size in parts of that of the scene, and its edge lengths [mm].

    ``own`` is the edge length with which single entries are changed, ``changed`` which: all of
    ``OTHERS`` by default.
    """

    title: str
    scene: str
    size: float
    edges: tuple[float, ...]
    own: float
    changed: tuple[str, ...] = ()

    def overrides(self, edge: float) -> tuple[str, ...]:
        if self.size == 1.0:
            return (f"blank.edge_length={edge:g} mm",)
        return scaled(self.size, edge)


SLOWER, OWN_MODULUS = "twice as slow", "fibre modulus of the fabric"
CASES = {
    "holder": Case(
        "Hemisphere with blank holder", "hemisphere_holder", 1.0, (10.0, 7.5, 5.0, 3.75, 2.5), 5.0
    ),
    "free": Case(
        "Hemisphere without blank holder", "hemisphere_free", 1.0, (10.0, 7.5, 5.0, 3.75, 2.5), 5.0
    ),
    "half": Case(
        "Hemisphere with blank holder, half size",
        "hemisphere_holder",
        0.5,
        (5.0, 3.75, 2.5),
        2.5,
        (SLOWER,),
    ),
}
HEAD = """# Convergence table

Written by `python examples/hemisphere_holder/convergence.py --table FILE.md`. Columns are runs:
edge lengths, then one entry changed, on elements of 5 mm, those of half size on 2.5 mm. The program
finds the pace of all of them. The last column is the order observed over the three finest meshes
and the value that they lead to; where their values follow no order, how far they lie apart. The
force to quote is the largest mean over a twentieth of the process, or its smooth course where the
mesh's ripple is large (`force_quoted_N`), with `force_quoted_uncertainty_N` below it; the peak is
that of a single step.

"""
#: Entries whose value is twice what the program finds.
TWICE_THE_DAMPING, TWICE_THE_PENALTY = "process.mass_damping=", "contact.penalty="
OTHERS = {
    SLOWER: ("process.quasi_static=2",),
    "damping x 2": (TWICE_THE_DAMPING,),
    OWN_MODULUS: ("process.fibre_modulus_factor=1",),
    "contact stiffness x 2": (TWICE_THE_PENALTY,),
    "fibres bend twice as hard in the plane": ("material.bending.in_plane=0.2",),
    "fibres in the plane as published": (
        "element.fibre_hourglass=1",
        "material.bending.in_plane=0",
    ),
    "2D approach": ("element=membrane-shell", "permeability=none"),
}
LEAST_ORDER, LARGEST_ORDER = 0.5, 8.0
MAY_BE_OFF = "may be off by [N]"
MEASURES = {
    "force to quote [N]": "{:.2f}",
    MAY_BE_OFF: "{:.2f}",
    "largest mean force [N]": "{:.2f}",
    "its smooth course there [N]": "{:.2f}",
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
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--out", type=Path, default=Path("results/convergence"))
    parser.add_argument("--table", type=Path, help="Markdown file to write")
    parser.add_argument("--quick", action="store_true", help="edge lengths only")
    arguments = parser.parse_args()
    tables = [study(arguments, name) for name in arguments.cases]
    text = HEAD + "\n".join(tables)
    print(text)
    if arguments.table is not None:
        arguments.table.write_text(text, encoding="utf-8")


def study(arguments: argparse.Namespace, name: str) -> str:
    """Run all variants of a case, and return their table."""
    case, found = CASES[name], {}
    for edge in case.edges:
        entries = case.overrides(edge)
        found[f"{edge:g} mm"] = measured(arguments.out / name, case, f"{edge:g} mm", entries)
    factor = read_scene(EXAMPLES / case.scene / "scene.toml").process.fibre_modulus_factor
    for variant, changed in {} if arguments.quick else OTHERS.items():
        left_out = case.changed and variant not in case.changed
        if left_out or (variant == OWN_MODULUS and factor == 1.0):
            continue
        entries = (*case.overrides(case.own), *changed)
        found[variant] = measured(arguments.out / name, case, variant, entries)
    return table(case, found)


def measured(
    out: Path, case: Case, name: str, overrides: tuple[str, ...]
) -> dict[str, float] | str:
    """Return the measures of a variant, or in words why there are none."""
    folder = out / name.replace(" ", "_")
    kept = folder / "measures.json"
    if kept.exists():
        return json.loads(kept.read_text(encoding="utf-8"))
    path = EXAMPLES / case.scene / "scene.toml"
    unchanged = read_scene(path, case.overrides(case.own))
    twice = {
        TWICE_THE_DAMPING: f"{2.0 * unchanged.process.mass_damping:.6g} 1/s",
        TWICE_THE_PENALTY: f"{2e-9 * build_model(unchanged).environment.penalty:.6g} N/mm^3",
    }
    overrides = tuple(entry + twice.get(entry, "") for entry in overrides)
    try:
        result = run(read_scene(path, ["output.pictures=false", "mapping=[]", *overrides]), folder)
    except SimulationError as error:  # a guard that stops a coarse mesh is a result too
        return str(error).split(". Likely")[0]
    values = measures(result)
    kept.write_text(json.dumps(values), encoding="utf-8")
    print(f"{name}: {values}", flush=True)
    return values


def measures(result) -> dict[str, float]:
    """Return the measures of a run."""
    sheet, summary = result.datasets["/"], result.summary
    # the squares of the local areas are a fifteenth of the blank, whatever its size
    shear = area_mean_shear(sheet, np.ptp(reference_positions(sheet)[:, 0]) / 15.0)
    energy, loads = summary["energy"], summary["tool_loads"][summary["punch"]]
    last = {name: sheet[name].values[-1] for name in sheet.data_vars if "time" in sheet[name].dims}
    area = last["areal_fibre_mass"] ** -1  # present area of equal parts of the sheet
    values = {
        "force to quote [N]": summary["punch_force_quoted_N"],
        MAY_BE_OFF: loads.get("force_quoted_uncertainty_N", np.nan),
        "largest mean force [N]": summary["punch_force_max_N"],
        "its smooth course there [N]": loads.get("force_smooth_N", np.nan),
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
    """Return order p and limit of f = f0 + C h^p through three values, else None.

    Values that are not monotone have none, nor has what hardly becomes less from mesh to mesh: an
    order below ``LEAST_ORDER`` leads to a limit far from all values.
    """
    (h1, h2, h3), (f1, f2, f3) = edges, values
    if (f1 - f2) * (f2 - f3) <= 0.0:
        return None
    ratio = (f1 - f2) / (f2 - f3)

    def excess(p):
        return (h1**p - h2**p) / (h2**p - h3**p) - ratio

    if excess(LEAST_ORDER) * excess(LARGEST_ORDER) > 0.0:
        return None
    p = brentq(excess, LEAST_ORDER, LARGEST_ORDER)
    return p, f3 - (f2 - f3) * h3**p / (h2**p - h3**p)


def table(case: Case, found: dict[str, dict[str, float] | str]) -> str:
    """Return the table in Markdown; a column for every run."""
    runs = {name: values for name, values in found.items() if not isinstance(values, str)}
    finest = sorted(case.edges)[:3][::-1]
    meshes = [runs[name] for name in (f"{edge:g} mm" for edge in finest) if name in runs]
    complete = len(meshes) == 3
    lines = [f"## {case.title}", "", f"| | {' | '.join(runs)} | order, limit |"]
    lines.append("|---" + "|---:" * (len(runs) + 1) + "|")
    for name, form in MEASURES.items():
        cells = [
            "" if np.isnan(values[name]) else form.format(values[name]) for values in runs.values()
        ]
        richardson = "not enough meshes"
        if name == MAY_BE_OFF:
            richardson = ""
        elif complete:
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
