"""What the two regularisations of the fibres within the plane do to coupons and hemispheres.

    python examples/regularisation/study.py [--out DIR] [--table FILE.md] [--edge MM]
        [--only {coupons,holder,free} ...]

``element.fibre_hourglass`` and ``material.bending.in_plane`` stand for no measured property
(departures.md). The study runs the bias-extension test, the picture frame, the compaction and the
cantilever, and both hemispheres, with both as by default, with one or the other changed, and with
both as in the paper. It writes one table: what an engineer reads from each test, by
setting. Results that lie in the folder already are taken from there.

The width of a band of shear is read from the bias-extension test, between its fully and its
half-sheared zone: a net of fibres without bending jumps there.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from lcmchain import read_scene, run
from lcmchain.commands.coupon import COUPON_SCENE
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.coupons.cantilever import cantilever
from lcmchain.coupons.compaction import compaction
from lcmchain.coupons.picture_frame import picture_frame
from lcmchain.coupons.result import CouponResult
from lcmchain.fields.sheet import face_centres
from lcmchain.scene import scene_from_text

EXAMPLES = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(EXAMPLES / "hemisphere_holder"))
from convergence import MEASURES, measures  # noqa: E402

#: Finds texts by quantity for entries of a scene, an edge length [mm] and a folder of its own.
Study = Callable[[tuple[str, ...], float, Path], dict[str, str]]
#: Entries of a scene by the name of the setting.
SETTINGS: dict[str, tuple[str, ...]] = {
    "default": (),
    "in_plane = 0": ("material.bending.in_plane=0",),
    "in_plane = 1": ("material.bending.in_plane=1",),
    "fibre_hourglass = 1": ("element.fibre_hourglass=1",),
    "both as published": ("material.bending.in_plane=0", "element.fibre_hourglass=1"),
}
STRIP = (0.32, 0.16)  # length and width of the bias-extension test [m]
PULLED_BY = 0.03  # travel at which the bias-extension test is read [m]
SHEARED_TO = 45.0  # angle at which the picture frame is read [°]
PRESSURE = 0.5e6  # at which the compaction is read [Pa]
BEYOND = 1.1  # how far the tests go beyond where they are read
HEAD = """# Regularisation table

Written by `python examples/regularisation/study.py --table FILE.md`. Columns are settings of the
two entries that keep fibres from bending within the plane, `element.fibre_hourglass` and
`material.bending.in_plane`: neither is a measured property
([Fibres within the plane](departures.md#fibres-within-the-plane)). MD600, elements of {edge:g} mm
where nothing else is said, those of the picture frame twice as long. A band of shear lies between
fully and half sheared fabric; no mesh shows one narrower than its elements. The strip, 320 mm x
160 mm, is read at a travel of {travel:g} mm, its bands at the end.

"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/regularisation"))
    parser.add_argument("--table", type=Path, help="Markdown file to write")
    parser.add_argument("--edge", type=float, default=5.0, help="edge length [mm]")
    parser.add_argument("--only", nargs="+", choices=STUDIES, default=list(STUDIES))
    given = parser.parse_args()
    text = HEAD.format(edge=given.edge, travel=1e3 * PULLED_BY)
    for name in given.only:
        title, study = STUDIES[name]
        columns = {}
        for number, (setting, entries) in enumerate(SETTINGS.items()):
            folder = given.out / f"{name}_{number}_{given.edge:g}mm"
            columns[setting] = kept(folder, study, entries, given.edge)
        text += table(title, columns) + "\n"
        print(table(title, columns), flush=True)
    if given.table is not None:
        given.table.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def kept(folder: Path, study: Study, entries: tuple[str, ...], edge: float) -> dict[str, str]:
    """Return what a study finds, or found before: its folder holds it then."""
    file = folder / "found.json"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        values = study(entries, edge, folder)
        file.write_text(json.dumps(values, ensure_ascii=False), encoding="utf-8")
    return json.loads(file.read_text(encoding="utf-8"))


def coupons(entries: tuple[str, ...], edge: float, folder: Path) -> dict[str, str]:
    """Return what the four coupon tests give with these entries of a scene, by quantity."""
    ply = scene_from_text(COUPON_SCENE, overrides=entries).only_ply("a coupon")
    given, size = (ply.material, ply.element), 1e-3 * edge
    found = {}
    for length in (size, 0.5 * size):
        pulled = bias_extension(
            *given,
            length=STRIP[0],
            width=STRIP[1],
            displacement=BEYOND * PULLED_BY,
            edge_length=length,
        )
        at, mesh = ("displacement [mm]", 1e3 * PULLED_BY), f"elements of {1e3 * length:g} mm"
        found |= {
            f"bias extension, {mesh}: force [N]": read(pulled, "force [N]", *at, 2),
            f"{mesh}: shear angle at the centre [°]": read(pulled, "shear angle [deg]", *at, 2),
            f"{mesh}: width of bands of shear [mm]": f"{1e3 * band_width(pulled):.1f}",
        }
    sheared = picture_frame(
        *given, shear_angle=math.radians(BEYOND * SHEARED_TO), edge_length=2.0 * size
    )
    pressed = compaction(*given, pressure=BEYOND * PRESSURE, edge_length=size)
    bent = cantilever(*given, edge_length=size)
    return found | {
        f"picture frame, force along a side at {SHEARED_TO:g}° [N]": read(
            sheared, "edge shear force [N]", "analytic shear angle [deg]", SHEARED_TO, 3
        ),
        f"compaction, thickness at {1e-6 * PRESSURE:g} MPa [mm]": read(
            pressed, "thickness [mm]", "pressure [MPa]", 1e-6 * PRESSURE, 4
        ),
        **{
            f"cantilever at {angle}°, overhang [mm]": f"{1e3 * bent.figures[name]:.1f}"
            for angle in (0, 45, 90)
            for name in (f"overhang_{angle}_m",)
        },
    }


def read(result: CouponResult, curve: str, over: str, at: float, digits: int) -> str:
    """Return as text the value of a curve where another one, rising, has the value ``at``."""
    return f"{np.interp(at, result.curves[over], result.curves[curve]):.{digits}f}"


def band_width(result: CouponResult) -> float:
    """Return the width of the band between fully and half sheared fabric of a pulled strip [m].

    Across it the shear falls from one value to the other; the line through the steepest place does
    so over this width. The least that a mesh can show is its edge length.
    """
    sheet = result.datasets["/"]
    x, y = np.abs(face_centres(sheet, formed=False)[:, :2]).T
    across, along = (x + y) / math.sqrt(2.0), (x - y) / math.sqrt(2.0)
    border = 0.5 * (STRIP[0] - STRIP[1]) / math.sqrt(2.0)
    near = (np.abs(along) < 0.3 * border) & (np.abs(across - border) < 0.45 * border)
    # rows of elements along the border have one mean each
    rows, row = np.unique(np.round(across[near], 7), return_inverse=True)
    shear = np.bincount(row, np.abs(sheet["shear_angle"].values[-1][near])) / np.bincount(row)
    return float((shear[0] - shear[-1]) / (np.abs(np.diff(shear)) / np.diff(rows)).max())


def hemisphere(example: str, entries: tuple[str, ...], edge: float, folder: Path) -> dict[str, str]:
    """Return what a hemisphere gives with these entries of its scene, by quantity."""
    own = ("output.pictures=false", "mapping=[]", f"blank.edge_length={edge:g} mm")
    scene = read_scene(EXAMPLES / example / "scene.toml", [*own, *entries])
    found = measures(run(scene, folder))
    return {name: form.format(found[name]) for name, form in MEASURES.items() if name in found}


def table(title: str, columns: dict[str, dict[str, str]]) -> str:
    """Return a table in Markdown: a row for every quantity, a column for every setting."""
    lines = [
        f"## {title}",
        "",
        f"| | {' | '.join(columns)} |",
        "|---" + "|---:" * len(columns) + "|",
    ]
    for quantity in next(iter(columns.values())):
        cells = (values[quantity] for values in columns.values())
        lines.append(f"| {quantity} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


#: Title of a study's table, and what gives the texts of one column.
STUDIES: dict[str, tuple[str, Study]] = {
    "coupons": ("Coupons", coupons),
    "holder": ("Hemisphere with blank holder", partial(hemisphere, "hemisphere_holder")),
    "free": ("Hemisphere without blank holder", partial(hemisphere, "hemisphere_free")),
}

if __name__ == "__main__":
    main()
