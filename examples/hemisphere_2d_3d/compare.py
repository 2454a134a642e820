r"""The hemisphere with the 3D solid-shell and with the 2D approach that the paper compares it with.

    python examples/hemisphere_2d_3d/compare.py [--out results/hemisphere_2d_3d] [--threads N]
    python examples/hemisphere_2d_3d/compare.py --scene hemisphere_holder \
        --set 'blank.edge_length="3.75 mm"'

Forms both hemisphere scenes with both elements, and with a solid-shell that is stiffened to what
the 2D approach assumes, all of them with the time of ``with_time.py``. Prints the differences, and
writes them as ``comparison.md`` beside one picture per scene (paper, Figs. 7c, 7d and 8d). With
``--from DIR`` the results of an earlier call are compared again without forming them anew.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcmchain import read_scene, run
from lcmchain.fields import read_forming, read_group
from lcmchain.fields.derived import face_area_vectors
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.report.pictures import draw_comparison
from lcmchain.report.style import SHOWN
from lcmchain.verification.hemisphere import (
    FLANGE_RADIUS,
    LOCAL_AREAS,
    area_mean_shear,
    contour_distances,
    draw_in,
    root_mean_square,
    symmetric_mean,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

if TYPE_CHECKING:
    import xarray as xr

EXAMPLES = Path(__file__).parents[1]
SCENES = {"with blank holder": "hemisphere_holder", "without blank holder": "hemisphere_free"}
ELEMENTS = {"3D solid-shell": "solid-shell", "2D membrane-shell": "membrane-shell"}
# What triangles cannot know: that a sheet shears over its thickness in tight bends, and bends more
# softly where it is thinner. A solid-shell without both assumes the same as they do.
STIFFENED = "3D stiffened"
AS_TRIANGLES = [
    f'material.{part}.{name}="5 MPa"' for part in ("membrane", "bending") for name in ("C13", "C23")
] + ['element.bending_thickness="reference"']
# The 2D approach has no fibre volume fraction, from which a permeability could follow. Meshes that
# the scene maps to are not compared; their flange lies on the die, from which that of 2D has risen.
OVERRIDES = ["permeability=none", "mapping=[]", "output.pictures=false", "output.vtu=false"]
FORMATS = {"": ",.0f", "deg": ".1f", "mm": ".1f", "N": ".1f", "J": ".3f", "%": ".3f", "s": ".0f"}
# Agreement that the paper reports: mean shear angles of areas within 3 degrees.
LARGEST_ANGLE, LARGEST_DISTANCE = 3.0, 3.0
HOLDER = "holder"
PUNCH_RADIUS = 0.076  # the punch touches nothing beyond it [m]
LIFTED = 0.02e-3  # below this a sheet lies flat between die and holder [m]


class Formed(NamedTuple):
    """What is compared of one run."""

    sheet: xr.Dataset
    history: xr.Dataset
    summary: dict


class Row(NamedTuple):
    """One line of the table: the values of all models, in the unit."""

    quantity: str
    values: list[float]
    unit: str
    format: str

    def __str__(self) -> str:
        values = (
            f"{value:{self.format}} {self.unit}".strip() if np.isfinite(value) else "-"
            for value in self.values
        )
        return f"| {self.quantity} | " + " | ".join(values) + " |"


def form(
    scene: str, element: str, folder: Path, threads: int | None, entries: Sequence[str] = ()
) -> Formed:
    """Form one of the example scenes with one kind of element and further entries."""
    path = EXAMPLES / scene / "scene.toml"
    overrides = [*entries_with_time(scene), f"element.type={element}", *entries, *OVERRIDES]
    result = run(read_scene(path, overrides), folder, threads=threads)
    return Formed(result.datasets["/"], result.datasets["/history"], result.summary)


def load(folder: Path) -> Formed:
    """Read an earlier run."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    path = folder / "forming.nc"
    return Formed(read_forming(path), read_group(path, "history"), summary)


def rows(runs: Sequence[Formed]) -> list[Row]:
    """Return what is compared."""
    shear = [area_mean_shear(formed.sheet) for formed in runs]
    table = [
        Row(
            f"mean shear angle, {name}",
            [float(np.degrees(symmetric_mean(areas, area))) for areas in shear],
            "deg",
            FORMATS["deg"],
        )
        for name, area in LOCAL_AREAS.items()
    ]

    def add(name: str, factor: float, unit: str, value, form: str | None = None) -> None:
        values = [factor * value(formed) for formed in runs]
        table.append(Row(name, values, unit, form or FORMATS[unit]))

    add("largest shear angle", 180.0 / np.pi, "deg", lambda r: r.summary["shear_angle_max_rad"])
    add("draw-in at the middle of a side", 1e3, "mm", lambda r: draw_in(r.sheet))
    add("punch force, largest", 1.0, "N", lambda r: r.summary["punch_force_max_N"])
    add("work of the punch", 1.0, "J", lambda r: r.summary["tool_loads"]["punch"]["work_J"])
    if HOLDER in runs[0].summary["tool_loads"]:
        add("holder raised", 1e3, "mm", holder_lift, ".2f")
        add("flange raised, mean", 1e3, "mm", flange_rise, ".2f")
        add("waves of the flange, mean height", 1e3, "mm", flange_waves, ".2f")
        add(
            f"force on the holder from nodes within {1e3 * FLANGE_RADIUS:.0f} mm of the axis",
            100.0,
            "%",
            part_on_ring,
            ".0f",
        )
    add("internal energy at the end", 1.0, "J", lambda r: _stored(r.summary["energy"]))
    add("friction", 1.0, "J", lambda r: r.summary["energy"]["friction"])
    add("energy balance error, largest", 100.0, "%", lambda r: r.summary["balance_error_max"])
    add("elements", 1.0, "", lambda r: r.summary["element_count"])
    add("steps", 1.0, "", lambda r: r.summary["step_count"])
    add("time in the loop", 1.0, "s", lambda r: r.summary["wall_s"])
    return table


def _stored(energy: dict[str, float]) -> float:
    return energy["internal"] + energy["hourglass"]


# --- holder ---------------------------------------------------------------------------------------


def holder_lift(formed: Formed) -> float:
    """Return how far the holder stands above its first place, one thickness above the die [m]."""
    tools = formed.history["tool"].values.tolist()
    return -float(formed.history["tool_travel"].values[-1, tools.index(HOLDER)])


def _radii(sheet: xr.Dataset) -> np.ndarray:
    return np.linalg.norm(sheet_positions(sheet)[:, :2], axis=1)


def flange_rise(formed: Formed) -> float:
    """Return how far the mid-surface of the flange stands above its first place, on average [m]."""
    rise = (sheet_positions(formed.sheet) - reference_positions(formed.sheet))[:, 2]
    return float(rise[_radii(formed.sheet) > FLANGE_RADIUS].mean())


def flange_waves(formed: Formed) -> float:
    """Return the root mean square of the heights of wrinkles in the flange [m]."""
    heights = formed.sheet["wrinkle_height"].values[-1]
    return root_mean_square(heights[_radii(formed.sheet) > FLANGE_RADIUS])


def part_on_ring(formed: Formed) -> float:
    """Return which part of the force on the holder nodes within ``FLANGE_RADIUS`` exert.

    Triangles save what presses on both faces in one; there a node belongs to the holder above the
    middle between holder and die. Not a number where they lie flat between them.
    """
    sheet, radius = formed.sheet, _radii(formed.sheet)
    if "tool_pressure_top" in sheet:
        pressure = sheet["tool_pressure_top"].values[-1]
    elif holder_lift(formed) < LIFTED:
        return np.nan
    else:
        first = float(reference_positions(sheet)[0, 2])
        above = sheet_positions(sheet)[:, 2] > first + 0.5 * holder_lift(formed)
        pressure = np.where(above, sheet["tool_pressure"].values[-1], 0.0)
    force = np.where(radius > PUNCH_RADIUS, pressure * _node_areas(sheet), 0.0)
    total = float(force.sum())
    return float(force[radius < FLANGE_RADIUS].sum()) / total if total > 0.0 else np.nan


def _node_areas(sheet: xr.Dataset) -> np.ndarray:
    """Return equal parts of the areas of the faces around each node [m2]."""
    positions, faces = sheet_positions(sheet), sheet_faces(sheet)
    areas = np.linalg.norm(face_area_vectors(positions[faces]), axis=-1)
    triangle = faces[:, 3] == faces[:, 2]  # which repeat their last node
    corners = np.where(triangle[:, None] & (np.arange(4) == 3), 0.0, 1.0)
    shares = areas[:, None] * corners / corners.sum(axis=1, keepdims=True)
    return np.bincount(faces.ravel(), shares.ravel(), len(positions))


# --- all together ---------------------------------------------------------------------------------


def as_text(name: str, runs: Mapping[str, Formed]) -> str:
    """Return the table of a scene in Markdown, and how well contours and areas agree."""
    lines = [f"## Hemisphere {name}", "", "| | " + " | ".join(runs) + " |"]
    lines.append("|---|" + len(runs) * "---:|")
    lines += map(str, rows(list(runs.values())))
    lines.append("")
    triangles = runs["2D membrane-shell"]
    for solid in ("3D solid-shell", STIFFENED):
        distance = 1e3 * contour_distances(runs[solid].sheet, triangles.sheet)
        angles = np.degrees(area_differences(runs[solid], triangles))
        lines.append(
            f"2D against {solid}: contours {distance.mean():.2f} mm apart on average, "
            f"{distance.max():.2f} mm at most. Mean shear angles of all {len(angles)} areas of "
            f"20 mm: root mean square difference {np.sqrt(np.mean(angles**2)):.1f} deg, "
            f"{np.sum(angles > LARGEST_ANGLE)} of them above {LARGEST_ANGLE:g} deg, "
            f"{angles.max():.1f} deg at most."
        )
    lines += [f"Threads: {triangles.summary['threads']}.", ""]
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
    parser.add_argument("--scene", choices=SCENES.values(), help="form this scene alone")
    parser.add_argument(
        "--set",
        dest="entries",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="replace an entry of the scenes, for all models; may be repeated",
    )
    parser.add_argument("--from", dest="source", type=Path, help="results of an earlier call")
    options = parser.parse_args()
    models = {model: (element, ()) for model, element in ELEMENTS.items()}
    models[STIFFENED] = ("solid-shell", AS_TRIANGLES)
    texts, found = [], []
    for name, scene in SCENES.items():
        if options.scene not in (None, scene):
            continue
        runs = {}
        for model, (element, entries) in models.items():
            folder = f"{scene}_{element}" + ("_stiffened" if entries else "")
            if options.source is None:
                wanted = [*entries, *options.entries]
                runs[model] = form(scene, element, options.out / folder, options.threads, wanted)
            else:
                runs[model] = load(options.source / folder)
        texts.append(as_text(name, runs))
        print(texts[-1], flush=True)
        found += disagreements(name, *(runs[model] for model in ELEMENTS))
        sheets = {model: runs[model].sheet for model in ELEMENTS}
        title = f"hemisphere {name}, MD600, {1e3 * sheets['3D solid-shell'].time[-1]:.0f} ms"
        draw_comparison(options.out / f"{scene}.png", sheets, SHOWN[0], title=title)
    (options.out / "comparison.md").write_text("\n".join(texts), encoding="utf-8")
    if found:
        raise SystemExit("beyond the agreement of the paper:\n  " + "\n  ".join(found))


if __name__ == "__main__":
    main()
