"""What forming changes for the filling: fill time and front of the hemisphere.

    python examples/infiltration/compare.py [forming.nc] [--out results/infiltration_compare]

Fills the formed hemisphere (of ``scene.toml``, formed first where no result is given) from the
pole: with all that forming predicts, and with one part of it after the other left out. Writes
``table.md`` and ``comparison.png``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

from lcmchain import read_scene, run
from lcmchain.coupling.infiltration.formed_part import FormedPart, read_formed_part
from lcmchain.coupling.infiltration.picture import (
    contours,
    nice_levels,
    paint_contours,
    triangles_around_centres,
)
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.coupling.infiltration.stage import fill
from lcmchain.report.renderer import axes_at, draw_segments, fit_axis, label_axes
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.report.view import FROM_ABOVE, boundary_edges
from lcmchain.scene import read_infiltration

HERE = Path(__file__).resolve().parent
FORMED, UNDEFORMED = "everything that forming predicts", "undeformed fabric"
FAMILIES = ("fibre_direction_1", "fibre_direction_2")

#: Thickness of MD600 without pressure [m].
NOMINAL_THICKNESS = 1.004e-3


# --- what may be left out -------------------------------------------------------------------------


def nominal_content(part: FormedPart) -> FormedPart:
    """One thickness and one fibre volume fraction, as before forming."""
    density, areal_mass = (
        part.dataset.attrs[name] for name in ("fibre_density_kg_m3", "areal_mass_kg_m2")
    )
    return _with(
        part,
        thickness=np.full(part.target.cell_count, NOMINAL_THICKNESS),
        fibre_volume_fraction=np.full(
            part.target.cell_count, areal_mass / density / NOMINAL_THICKNESS
        ),
    )


def without_shear(part: FormedPart) -> FormedPart:
    """Both families at a right angle, about the bisector that they have."""
    first, second = (
        np.stack([part.cell(f"{family}_{axis}") for axis in "xyz"], axis=1) for family in FAMILIES
    )
    sum_, difference = (v / np.linalg.norm(v, axis=1)[:, None] for v in (first + second,
                                                                       first - second))  # fmt: skip
    fields = {}
    for family, sign in zip(FAMILIES, (1.0, -1.0), strict=True):
        direction = (sum_ + sign * difference) / np.sqrt(2.0)
        fields |= {f"{family}_{axis}": v for axis, v in zip("xyz", direction.T, strict=True)}
    return _with(part, **fields)


def undeformed(part: FormedPart) -> FormedPart:
    """Both left out: the fabric as it comes from the roll, laid onto the part."""
    return without_shear(nominal_content(part))


VARIANTS: dict[str, Callable[[FormedPart], FormedPart]] = {
    FORMED: lambda part: part,
    "without thickness and fibre content": nominal_content,
    "without shear of the fibres": without_shear,
    UNDEFORMED: undeformed,
}


def _with(part: FormedPart, **fields: np.ndarray) -> FormedPart:
    dataset = part.dataset.copy()
    for name, values in fields.items():
        dataset[name] = dataset[name].copy(data=np.ascontiguousarray(values))
    return replace(part, dataset=dataset)


# --- the comparison -------------------------------------------------------------------------------


def table(found: dict[str, FilledPart]) -> str:
    """Fill times and resin of every variant, as Markdown."""
    lines = ["| | filled | half filled | resin |", "|---|---|---|---|"]
    reference = found[FORMED]
    for name, one in found.items():
        cells = []
        for share in (1.0, 0.5):
            time, exact = _time_of(one, share), _time_of(reference, share)
            change = "" if one is reference else f" ({time / exact - 1.0:+.0%})"
            cells.append(f"{time / 60.0:.1f} min{change}")
        mass = one.setup.resin_density * one.history.stored[-1]
        exact = one.setup.resin_density * reference.history.stored[-1]
        change = "" if one is reference else f" ({mass / exact - 1.0:+.1%})"
        lines.append(f"| {name} | {' | '.join(cells)} | {1e3 * mass:.1f} g{change} |")
    return "\n".join(lines) + "\n"


def _time_of(filled: FilledPart, share: float) -> float:
    """When so much of the pores was filled [s]."""
    if share >= 1.0:
        return float(np.nanmax(filled.fill_time))
    return float(np.interp(share, filled.history.filled_share, filled.history.time))


def draw(path: Path, found: dict[str, FilledPart]) -> None:
    """Draw the fill time with and without forming, and both fronts at the same times (PNG)."""
    formed, flat = found[FORMED], found[UNDEFORMED]
    target = formed.setup.part.target
    points, cells = 1e3 * target.points, target.corners
    rim = boundary_edges(np.where(cells < 0, cells[:, 2:3], cells))
    both = np.concatenate([formed.fill_time, flat.fill_time]) / 60.0
    levels = nice_levels(both, 0.0)
    with matplotlib.rc_context(RC):
        figure = new_figure(12.8, 4.8)
        axes = [axes_at(figure, 0.6 + 3.85 * k, 0.5, 3.5, 3.5) for k in range(3)]
        titles = ("formed: thickness, fibre content and shear", "undeformed fabric")
        for axis, one, title in zip(axes, (formed, flat), titles):
            values = one.fill_time / 60.0
            paint_contours(axis, points, cells, values, levels, "viridis_r", FROM_ABOVE, rim, False)
            axis.set_title(f"{title}: {np.nanmax(values):.0f} min", color=FAINT, loc="left")
        axes[2].set_title("front at the same times", color=FAINT, loc="left")
        draw_segments(axes[2], points[rim], FROM_ABOVE, INK, 0.9)
        times = np.array([0.1, 0.25, 0.5, 0.75]) * np.nanmax(formed.fill_time)
        for one, colour in ((formed, SERIES[1]), (flat, SERIES[0])):
            corners, at, _ = triangles_around_centres(points, cells, one.fill_time)
            lines = contours(corners, at, np.concatenate([[0.0], times, [2.0 * times[-1]]])).lines
            draw_segments(axes[2], lines, FROM_ABOVE, colour, 1.5)
            label = "formed" if one is formed else "undeformed"
            axes[2].plot([], [], color=colour, label=label)
        axes[2].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.15)
        for axis in axes:
            fit_axis(axis, points[:, :2], 0.04)
            label_axes(axis, "x [mm]", "y [mm]" if axis is axes[0] else "")
        _bar(figure, axes_at(figure, 12.05, 0.85, 0.14, 2.8), levels)
        told = ", ".join(f"{time / 60.0:.0f}" for time in times)
        headline(
            figure,
            "What forming changes for the filling",
            "formed hemisphere of MD600, from a gate at the pole at 3 bar, 0.1 Pa s; "
            f"fronts after {told} min",
        )
        save(figure, path)
    _pack(path)


def _pack(path: Path) -> None:
    """Make the file a fifth of its size: bands have few colours."""
    from PIL import Image

    with Image.open(path) as picture:
        packed = picture.convert("RGB").quantize(128)
    packed.save(path, optimize=True)


def _bar(figure, axis, levels: np.ndarray) -> None:
    from lcmchain.coupling.infiltration.picture import draw_level_bar

    draw_level_bar(figure, axis, levels, "viridis_r", "fill time [min]", False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("forming", nargs="?", type=Path, help="forming.nc of scene.toml")
    parser.add_argument("--out", type=Path, default=Path("results/infiltration_compare"))
    arguments = parser.parse_args()
    forming = arguments.forming
    if forming is None:
        scene = read_scene(HERE / "scene.toml", ["infiltration=none"])
        run(scene, arguments.out / "forming")
        forming = arguments.out / "forming" / "forming.nc"
    case = read_infiltration(HERE / "pole.toml")
    part = read_formed_part(forming)
    found = {name: fill(change(part), case) for name, change in VARIANTS.items()}
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "table.md").write_text(table(found), encoding="utf-8")
    draw(arguments.out / "comparison.png", found)
    print(table(found))


if __name__ == "__main__":
    main()
