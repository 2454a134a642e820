"""Scenes without a time beside themselves four times as slow: force, shear angle, thickness.

    python examples/quasi_static/compare.py [--cases NAME ...] [--out DIR] [--table F.md]

Runs hemispheres with and without holder, other blanks, sizes and tools, and a closed mould with the
pace that the program finds, and with ``process.quasi_static`` = 4; both on one mesh, so that fields
are compared face by face. Writes a table: steps, the force to quote with what the run itself
says it is off by, how far force, shear angle and thickness are from those of the slow run, and the
verdicts that are not good. Results that lie in the folder already are taken from there.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from lcmchain import read_scene, run

EXAMPLES = Path(__file__).resolve().parents[1]
HOLDER = "hemisphere_holder/scene.toml"
PUNCH = 'tools.punch.shape={{ type = "sphere_capped_punch", radius = "{:g} mm" }}'
PLATE = (
    'tools.{}.shape={{ type = "plate_with_hole", hole_radius = "{:g} mm", '
    'fillet_radius = "{:g} mm", side = "{}" }}'
)


def scaled(factor: float, edge: float) -> tuple[str, ...]:
    """Return what makes the hemisphere so many times as large; the holder presses as much."""
    hole, fillet = 75.0 * factor + 2.0, 10.0 * factor
    return (
        f'blank.size=["{300 * factor:g} mm", "{300 * factor:g} mm"]',
        f"blank.edge_length={edge:g} mm",
        PUNCH.format(75.0 * factor),
        f"tools.punch.motion.distance={75 * factor:g} mm",
        PLATE.format("die", hole, fillet, "below"),
        PLATE.format("holder", hole, fillet, "above"),
        f"tools.holder.motion.mass={1.7 * factor**2:g} kg",
        f"tools.holder.motion.damping={100 * factor**2:g} N*s/m",
    )


#: Scene, or None where this program writes it (`WRITTEN`), and what differs from it.
CASES: dict[str, tuple[str | None, tuple[str, ...]]] = {
    "hemisphere with holder": (HOLDER, ()),
    "the fabric's own fibre modulus": (HOLDER, ("process.fibre_modulus_factor=1",)),
    "hemisphere without holder": ("hemisphere_free/scene.toml", ()),
    "dome from an STL file": ("stl_tool/scene.toml", ()),
    "closed mould": (None, ()),
    "box with corners": (None, ()),
    "cone": (
        HOLDER,
        (
            'tools.punch.shape={ type = "cone", half_angle = "35 deg", tip_radius = "20 mm" }',
            "tools.punch.motion.distance=50 mm",
        ),
    ),
    "fibres at 30 deg": (HOLDER, ("blank.fibre_angle=30 deg",)),
    "1 m blank": (HOLDER, scaled(10.0 / 3.0, 15.0)),
    "half size, 5 mm": (HOLDER, scaled(0.5, 5.0)),
    "half size, 2.5 mm": (HOLDER, scaled(0.5, 2.5)),
}
NO_FILES = ("output.pictures=false", "output.vtu=false")
#: What the holder's scene has besides.
NO_OTHER_STAGES = ("mapping=[]", "permeability=none")
COLUMNS = (
    "scene", "steps", "force to quote [N]", "off by",
    "shear angle, rms and most [°]",
    "thickness, rms and most [%]", "not good",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--slower", type=float, default=4.0)
    parser.add_argument("--out", type=Path, default=Path("results/quasi_static"))
    parser.add_argument("--table", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for case in arguments.cases:
        found, slow = (result(case, slower, arguments.out) for slower in (1.0, arguments.slower))
        lines.append("| " + " | ".join([case, *compared(found, slow)]) + " |")
        print(lines[-1], flush=True)
    text = "\n".join(lines) + "\n"
    print(text)
    if arguments.table is not None:
        arguments.table.write_text(text, encoding="utf-8")


def result(case: str, slower: float, out: Path) -> dict[str, Any]:
    """Run a case, or take it from its folder; return its summary, verdicts and last fields."""
    folder = out / f"{case.replace(' ', '_').replace(',', '')}_{slower:g}"
    kept = folder / "verdicts.json"
    if not kept.is_file():
        file, overrides = CASES[case]
        path = WRITTEN[case](out) if file is None else EXAMPLES / file
        only = NO_OTHER_STAGES if file == HOLDER else ()
        pace = f"process.quasi_static={slower:g}"
        scene = read_scene(path, (*NO_FILES, *only, *overrides, pace))
        done = run(scene, folder)
        kept.write_text(json.dumps(not_good(done, scene)), encoding="utf-8")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    with xr.open_dataset(folder / "forming.nc", engine="netcdf4") as sheet:
        last = sheet.isel(time=-1)
        fields = {name: last[name].values for name in ("shear_angle", "thickness")}
    return {"summary": summary, "not_good": json.loads(kept.read_text(encoding="utf-8")), **fields}


def not_good(done: Any, scene: Any) -> list[str]:
    """Return the verdicts of a run that are not good, in words."""
    from lcmchain.judgements.grades import GOOD
    from lcmchain.judgements.verdicts import verdicts

    found = verdicts(done.summary, scene, done.datasets)
    return [f"{verdict.check} ({verdict.grade})" for verdict in found if verdict.grade != GOOD]


def mould(out: Path) -> Path:
    """Write the two moulds of ``closed_mould`` and a scene without a time; return its file."""
    sys.path.insert(0, str(EXAMPLES / "closed_mould"))
    from compare import DOMES, write_moulds  # type: ignore[import-not-found]

    out.mkdir(parents=True, exist_ok=True)
    write_moulds(out)
    path = out / "mould.toml"
    path.write_text("process = { frames = 13 }\n" + DOMES, encoding="utf-8")
    return path


def box(out: Path) -> Path:
    """Write the punch and the scene of the box that requirements are judged on; return its file."""
    sys.path.insert(0, str(EXAMPLES / "accuracy"))
    from judge_targets import scene_of  # type: ignore[import-not-found]

    path = out / "box" / "scene.toml"
    path.write_text(scene_of("box with corners", path.parent).text, encoding="utf-8")
    return path


WRITTEN = {"closed mould": mould, "box with corners": box}


def compared(found: dict[str, Any], slow: dict[str, Any]) -> list[str]:
    """Return the cells of a row: what a run took, and how far it is from the slow one."""
    summary = found["summary"]
    force, of_slow = (run["summary"]["punch_force_quoted_N"] for run in (found, slow))
    loads = summary["tool_loads"][summary["punch"]]
    stated = loads.get("force_quoted_uncertainty_N")
    shear = np.degrees(np.abs(np.abs(found["shear_angle"]) - np.abs(slow["shear_angle"])))
    thickness = 100.0 * np.abs(found["thickness"] / slow["thickness"] - 1.0)
    return [
        f"{summary['step_count']:,}",
        f"{force:.4g}" + ("" if stated is None else f" ± {stated:.1g}"),
        f"{force / of_slow - 1.0:+.2%}",
        f"{np.sqrt(np.mean(shear**2)):.3f}, {shear.max():.2f}",
        f"{np.sqrt(np.mean(thickness**2)):.3f}, {thickness.max():.2f}",
        ", ".join(found["not_good"]) or "-",
    ]


if __name__ == "__main__":
    main()
