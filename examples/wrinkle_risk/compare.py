"""What a coarse run forecasts of a fine one's wrinkles: the hemisphere without and with holder.

    python examples/wrinkle_risk/compare.py [FOLDER] [--coarse MM] [--fine MM]

Forms both with coarse elements and ``output.wrinkle_risk``, and with fine ones. An element of the
coarse sheet is wrinkled where the fine one stands off by more than a thickness, and marked where
its risk is at least 1. Writes ``table.md`` to the folder (``results/wrinkle_risk``). Results that
lie there already are taken from there.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from lcmchain import read_scene, run
from lcmchain.fields import read_forming
from lcmchain.fields.sheet import edge_length, face_centres, reference_positions, sheet_areas

if TYPE_CHECKING:
    import xarray as xr

EXAMPLES = Path(__file__).resolve().parents[1]
#: Scenes by name; a given time keeps the pace the same on both meshes.
CASES = {
    "without a holder": EXAMPLES / "hemisphere_free" / "scene.toml",
    "with a holder": EXAMPLES / "hemisphere_holder" / "scene.toml",
}
SETTINGS = ("process.time=400 ms", "output.wrinkle_risk=true", "output.report=false", "mapping=[]")
PARTS = ("", "_compression", "_waves")
HEAD = (
    "| hemisphere | part of the risk | wrinkled | marked | of the wrinkled, marked "
    "| of the smooth, marked | of the marked, wrinkled |\n|---|---|---|---|---|---|---|"
)


def formed(case: str, edge: float, folder: Path) -> xr.Dataset:
    """Form the sheet, or read what has been formed."""
    own = folder / f"{case.replace(' ', '_')}_{edge:g}"
    if not (own / "summary.json").is_file():
        run(read_scene(CASES[case], (f"blank.edge_length={edge:g} mm", *SETTINGS)), out=own)
    return read_forming(own / "forming.nc")


def wrinkled(coarse: xr.Dataset, fine: xr.Dataset, height: float) -> np.ndarray:
    """Return on which faces of the coarse sheet (F,) the fine one stands off by more than a height.

    Of the fine sheet count the nodes within three quarters of a coarse edge of the face's centre.
    """
    heights = np.abs(fine["wrinkle_height"].values[-1])
    nodes = cKDTree(reference_positions(fine))
    near = nodes.query_ball_point(face_centres(coarse, formed=False), 0.75 * edge_length(coarse))
    return np.array([heights[found].max() for found in near]) > height


def agreement(there: np.ndarray, marked: np.ndarray, areas: np.ndarray) -> dict[str, float]:
    """Return parts of the area: wrinkled, marked, hits, false alarms and the precision."""

    def part(of: np.ndarray, within: np.ndarray) -> float:
        whole = areas[within].sum()
        return float(areas[of & within].sum() / whole) if whole > 0.0 else np.nan

    everything = np.ones_like(there)
    return {
        "wrinkled": part(there, everything),
        "marked": part(marked, everything),
        "hits": part(marked, there),
        "false alarms": part(marked, ~there),
        "precision": part(there, marked),
    }


def compared(case: str, coarse_edge: float, fine_edge: float, folder: Path) -> dict[str, dict]:
    """Return :func:`agreement` for the risk and each of its parts, by the ending of its name."""
    coarse, fine = (formed(case, edge, folder) for edge in (coarse_edge, fine_edge))
    there = wrinkled(coarse, fine, 1.004e-3)
    areas = sheet_areas(coarse, 0)
    return {
        part: agreement(there, coarse[f"wrinkle_risk{part}"].values[-1] >= 1.0, areas)
        for part in PARTS
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/wrinkle_risk"))
    parser.add_argument("--coarse", type=float, default=10.0, help="edge length [mm]")
    parser.add_argument("--fine", type=float, default=3.0, help="edge length [mm]")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table = HEAD
    for case in CASES:
        for part, found in compared(case, given.coarse, given.fine, given.folder).items():
            texts = ["none" if np.isnan(x) else f"{100.0 * x:.0f} %" for x in found.values()]
            name = part.removeprefix("_") or "all"
            table += f"\n| {case} | {name} | {' | '.join(texts)} |"
    print(table)
    (given.folder / "table.md").write_text(table + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
