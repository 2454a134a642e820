"""The hemisphere with the 3D solid-shell and with the 2D approach that the paper compares it with.

    python examples/hemisphere_2d_3d/compare.py [--out results/hemisphere_2d_3d] [--threads N]

Forms both hemisphere scenes with both elements, prints the differences, and writes them as
``comparison.md`` beside one picture per scene (paper, Figs. 7c, 7d and 8d). With ``--from DIR`` the
results of an earlier call are compared again without forming them anew.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields import read_forming
from lcmchain.fields.measures import (
    LOCAL_AREAS,
    area_mean_shear,
    contour_distances,
    draw_in,
    symmetric_mean,
)
from lcmchain.report.comparison import draw_comparison
from lcmchain.report.shown import SHOWN

if TYPE_CHECKING:
    import xarray as xr

EXAMPLES = Path(__file__).parents[1]
SCENES = {"with blank holder": "hemisphere_holder", "without blank holder": "hemisphere_free"}
ELEMENTS = {"3D solid-shell": "solid-shell", "2D membrane-shell": "membrane-shell"}
# The 2D approach has no fibre volume fraction, from which a permeability could follow.
OVERRIDES = ["permeability=none", "output.pictures=false", "output.vtu=false"]
FORMATS = {"": ",.0f", "deg": ".1f", "mm": ".1f", "N": ".1f", "J": ".3f", "%": ".3f", "s": ".0f"}
# Agreement that the paper reports: mean shear angles of areas within 3 degrees.
LARGEST_ANGLE, LARGEST_DISTANCE = 3.0, 3.0


class Formed(NamedTuple):
    """What is compared of one run."""

    sheet: xr.Dataset
    summary: dict


def form(scene: str, element: str, folder: Path, threads: int | None) -> Formed:
    """Form one of the example scenes with one kind of element."""
    path = EXAMPLES / scene / "scene.toml"
    result = run(read_scene(path, [f"element={element}", *OVERRIDES]), folder, threads=threads)
    return Formed(result.datasets["/"], result.summary)


def load(folder: Path) -> Formed:
    """Read an earlier run."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return Formed(read_forming(folder / "forming.nc"), summary)


def rows(solid: Formed, triangles: Formed) -> list[tuple[str, float, float, str]]:
    """Return quantity, value of the 3D and of the 2D approach, and unit."""
    shear = [area_mean_shear(run.sheet) for run in (solid, triangles)]
    table = [
        (f"mean shear angle, {name}", *(np.degrees(symmetric_mean(s, area)) for s in shear), "deg")
        for name, area in LOCAL_AREAS.items()
    ]

    def add(name: str, factor: float, unit: str, value) -> None:
        table.append((name, factor * value(solid), factor * value(triangles), unit))

    add("largest shear angle", 180.0 / np.pi, "deg", lambda r: r.summary["shear_angle_max_rad"])
    add("draw-in at the middle of a side", 1e3, "mm", lambda r: draw_in(r.sheet))
    add("punch force, largest", 1.0, "N", lambda r: r.summary["punch_force_max_N"])
    add("internal energy at the end", 1.0, "J", lambda r: _stored(r.summary["energy"]))
    add("friction", 1.0, "J", lambda r: r.summary["energy"]["friction"])
    add("energy balance error, largest", 100.0, "%", lambda r: r.summary["balance_error_max"])
    add("elements", 1.0, "", lambda r: r.summary["element_count"])
    add("steps", 1.0, "", lambda r: r.summary["step_count"])
    add("time in the loop", 1.0, "s", lambda r: r.summary["wall_s"])
    return table


def _stored(energy: dict[str, float]) -> float:
    return energy["internal"] + energy["hourglass"]


def as_text(name: str, solid: Formed, triangles: Formed) -> str:
    """Return the table of a scene in Markdown, and how well contours and areas agree."""
    lines = [f"## Hemisphere {name}", "", "| | " + " | ".join(ELEMENTS) + " |", "|---|---:|---:|"]
    for quantity, one, two, unit in rows(solid, triangles):
        values = (f"{value:{FORMATS[unit]}} {unit}".strip() for value in (one, two))
        lines.append(f"| {quantity} | " + " | ".join(values) + " |")
    distance = 1e3 * contour_distances(solid.sheet, triangles.sheet)
    angles = np.degrees(area_differences(solid, triangles))
    lines += [
        "",
        f"Contours: {distance.mean():.2f} mm apart on average, {distance.max():.2f} mm at most. "
        f"Mean shear angles of all {len(angles)} areas of 20 mm: root mean square difference "
        f"{np.sqrt(np.mean(angles**2)):.1f} deg, {np.sum(angles > LARGEST_ANGLE)} of them above "
        f"{LARGEST_ANGLE:g} deg, {angles.max():.1f} deg at most.",
        f"Threads: {solid.summary['threads']}.",
        "",
    ]
    return "\n".join(lines)


def area_differences(solid: Formed, triangles: Formed) -> np.ndarray:
    """Return the differences of the sizes of all areas' mean shear angles [rad]."""
    one, two = area_mean_shear(solid.sheet), area_mean_shear(triangles.sheet)
    return np.array([abs(abs(one[area]) - abs(two[area])) for area in one])


def disagreements(name: str, solid: Formed, triangles: Formed) -> list[str]:
    """Say where the two approaches differ by more than the paper's agreement."""
    found = []
    shear = [area_mean_shear(run.sheet) for run in (solid, triangles)]
    for area_name, area in LOCAL_AREAS.items():
        one, two = (np.degrees(symmetric_mean(s, area)) for s in shear)
        if abs(one - two) > LARGEST_ANGLE:
            found.append(f"{name}: {area_name} differs by {abs(one - two):.1f} deg")
    distance = 1e3 * contour_distances(solid.sheet, triangles.sheet).max()
    if distance > LARGEST_DISTANCE:
        found.append(f"{name}: the contours are up to {distance:.1f} mm apart")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/hemisphere_2d_3d"))
    parser.add_argument("--threads", type=int)
    parser.add_argument("--from", dest="source", type=Path, help="results of an earlier call")
    options = parser.parse_args()
    texts, found = [], []
    for name, scene in SCENES.items():
        folders = {element: f"{scene}_{element}" for element in ELEMENTS.values()}
        if options.source is None:
            runs = [
                form(scene, element, options.out / folder, options.threads)
                for element, folder in folders.items()
            ]
        else:
            runs = [load(options.source / folder) for folder in folders.values()]
        texts.append(as_text(name, *runs))
        print(texts[-1], flush=True)
        found += disagreements(name, *runs)
        sheets = dict(zip(ELEMENTS, (formed.sheet for formed in runs), strict=True))
        title = f"hemisphere {name}, MD600, {1e3 * sheets['3D solid-shell'].time[-1]:.0f} ms"
        draw_comparison(options.out / f"{scene}.png", sheets, SHOWN[0], title=title)
    (options.out / "comparison.md").write_text("\n".join(texts), encoding="utf-8")
    if found:
        raise SystemExit("beyond the agreement of the paper:\n  " + "\n  ".join(found))


if __name__ == "__main__":
    main()
