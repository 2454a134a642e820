"""What the forming stage changes for the structure: stiffness and frequencies of the hemisphere.

    python examples/structure/study.py [forming.nc] [--out results/structure_study] [--threads N]

Maps the formed hemisphere (of ``examples/hemisphere_holder``, formed first where no result is
given) onto its shell mesh and analyses it with CalculiX: with all that forming predicts, and with
one part of it after the other left out. Writes ``table.md`` and ``structure.png``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
import xarray as xr

from lcmchain import read_scene, run
from lcmchain.mapping import TargetMesh, map_file, read_target
from lcmchain.mapping.structure import SolverOptions, analyse
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.scene import structure_from_text

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

HERE = Path(__file__).resolve().parent
HOLDER = HERE.parent / "hemisphere_holder"
PUSH = 10.0  # [N]

#: The same part held in two ways, and pushed where it is soft.
CASES = {"rim held, pole pushed": "rim.toml", "one side held, corner pushed": "side.toml"}


class Found(NamedTuple):
    """Stiffness [N/m], frequencies [Hz] and mass [kg] of one analysis."""

    stiffness: float
    frequencies: np.ndarray
    mass: float


# --- what may be left out -------------------------------------------------------------------------


def nominal_thickness(mapped: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """The textile as it is before forming: one thickness, one fibre volume fraction."""
    thickness = 1.004e-3  # of MD600 without pressure
    density, areal_mass = (mapped.attrs[k] for k in ("fibre_density_kg_m3", "areal_mass_kg_m2"))
    changed = mapped.copy(deep=True)
    changed["thickness"].values[:] = thickness
    changed["fibre_volume_fraction"].values[:] = areal_mass / density / thickness
    return changed


def projected_directions(mapped: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """Both families turned together, until the first is the x axis laid onto the part."""
    first, second, normals = *_families(mapped), target.surface.normals
    along = np.array([1.0, 0.0, 0.0]) - normals[:, :1] * normals
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normals, first)
    angle = np.arctan2(_dot(second, across), _dot(second, first))[:, None]
    turned = np.cos(angle) * along + np.sin(angle) * np.cross(normals, along)
    return _with_families(mapped, along, turned)


def perpendicular_family(mapped: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """The second family perpendicular to the first, as formats with one direction take it."""
    first, _ = _families(mapped)
    return _with_families(mapped, first, np.cross(target.surface.normals, first))


def nothing_of_forming(mapped: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """All three left out: what is known without a forming simulation."""
    for change in (nominal_thickness, projected_directions, perpendicular_family):
        mapped = change(mapped, target)
    return mapped


SIMPLIFICATIONS: dict[str, Callable[[xr.Dataset, TargetMesh], xr.Dataset]] = {
    "thickness not mapped": nominal_thickness,
    "directions not mapped": projected_directions,
    "second family perpendicular": perpendicular_family,
    "no forming at all": nothing_of_forming,
}


def _families(mapped: xr.Dataset) -> list[np.ndarray]:
    return [
        np.stack([mapped[f"fibre_direction_{k}_{axis}"].values for axis in "xyz"], axis=1)
        for k in (1, 2)
    ]


def _with_families(mapped: xr.Dataset, *families: np.ndarray) -> xr.Dataset:
    changed = mapped.copy(deep=True)
    for number, family in enumerate(families, start=1):
        for axis, values in zip("xyz", family.T, strict=True):
            changed[f"fibre_direction_{number}_{axis}"].values[:] = values
    return changed


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ci,ci->c", a, b)


# --- the study ------------------------------------------------------------------------------------


def study(forming: Path, mesh: Path, out: Path, threads: int | None) -> dict[str, dict[str, Found]]:
    """Analyse every case with everything mapped, and with each simplification."""
    map_file(forming, mesh, out / "hemisphere.nc")
    target = read_target(mesh)
    with xr.open_dataset(out / "hemisphere.nc", mask_and_scale=False) as opened:
        mapped = opened.load()
    variants = {"everything mapped": mapped} | {
        name: change(mapped, target) for name, change in SIMPLIFICATIONS.items()
    }
    found: dict[str, dict[str, Found]] = {}
    for case, file in CASES.items():
        structure = structure_from_text((HERE / file).read_text(encoding="utf-8"), HERE / file)
        found[case] = {}
        for number, (variant, fields) in enumerate(variants.items()):
            report = analyse(
                fields, target, structure, name=f"{Path(file).stem}_{number}", out_dir=out,
                options=SolverOptions(threads=threads, picture=number == 0),
            )  # fmt: skip
            if not report.solved:
                raise SystemExit("this study needs CalculiX: apt install calculix-ccx")
            found[case][variant] = Found(
                PUSH / report.displacement_max, np.array(report.eigenfrequencies), report.mass
            )
    return found


def table(found: dict[str, dict[str, Found]]) -> str:
    """Stiffness and frequencies of every variant, and their change, as Markdown."""
    lines = []
    for case, variants in found.items():
        reference = variants["everything mapped"]
        lines += [f"**{case}**", "", "| | mass | stiffness | f1 | f2 | f3 |", "|---|" + "---|" * 5]
        for variant, one in variants.items():
            cells = [f"{1e3 * one.mass:.1f} g", f"{1e-3 * one.stiffness:.3g} N/mm"]
            cells += [f"{frequency:.4g} Hz" for frequency in one.frequencies]
            if one is not reference:
                changes = _changes(one, reference)
                mass = one.mass / reference.mass - 1.0
                cells = [
                    f"{c} ({round(x, 3) + 0.0:+.1%})"
                    for c, x in zip(cells, [mass, *changes], strict=True)
                ]
            lines.append(f"| {variant} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def _changes(one: Found, reference: Found) -> np.ndarray:
    return np.concatenate([
        [one.stiffness / reference.stiffness], one.frequencies / reference.frequencies,
    ]) - 1.0  # fmt: skip


def draw(path: Path, found: dict[str, dict[str, Found]]) -> None:
    """Draw the changes as bars, one panel for each way to hold the part (PNG)."""
    quantities = ["stiffness", "f1", "f2", "f3"]
    with matplotlib.rc_context(RC):
        figure = new_figure(9.6, 3.9)
        axes = [figure.add_axes((0.075 + 0.475 * k, 0.2, 0.42, 0.55)) for k in range(2)]
        for axis, (case, variants) in zip(axes, found.items(), strict=True):
            reference = variants["everything mapped"]
            for number, name in enumerate(SIMPLIFICATIONS):
                places = np.arange(4) + 0.2 * (number - 1.5)
                changes = 100.0 * _changes(variants[name], reference)
                axis.bar(places, changes, 0.18, color=SERIES[number], label=name)
                for x, y in zip(places, changes, strict=True):
                    va, shift = ("bottom", 2) if y >= 0 else ("top", -2)
                    text = f"{round(y, 1) + 0.0:+.1f}".replace("-", "\N{MINUS SIGN}")
                    axis.annotate(text, (x, y), (0, shift), textcoords="offset points",
                                  ha="center", va=va, fontsize=5.8, color=INK)  # fmt: skip
            axis.axhline(0.0, color=INK, lw=0.8)
            axis.margins(y=0.15)
            axis.set_xticks(range(4), quantities)
            axis.set_title(case, color=FAINT, loc="left")
            axis.spines[["top", "right"]].set_visible(False)
        axes[0].set_ylabel("change against everything mapped [%]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False)
        headline(
            figure,
            "What forming changes for the structure",
            "formed hemisphere of MD600 and epoxy, shell model in CalculiX; each bar leaves out "
            "one thing that forming predicts",
        )
        save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("forming", nargs="?", type=Path, help="forming.nc of hemisphere_holder")
    parser.add_argument("--mesh", type=Path, default=HOLDER / "structure.vtu")
    parser.add_argument("--out", type=Path, default=Path("results/structure_study"))
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    forming = arguments.forming
    if forming is None:
        scene = read_scene(HOLDER / "scene.toml", entries_with_time(HOLDER.name))
        run(scene, out / "forming", threads=arguments.threads)
        forming = out / "forming" / "forming.nc"
    found = study(forming, arguments.mesh, out, arguments.threads)
    text = table(found)
    (out / "table.md").write_text(text, encoding="utf-8")
    draw(out / "structure.png", found)
    print(text)


if __name__ == "__main__":
    main()
