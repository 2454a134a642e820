"""Form one scene on every rung of the model ladder; time and shear angles beside the solid-shell.

    python examples/draping/ladder.py [SCENE] [--out DIR] [--threads N]

Writes a table: computing time of each rung (without compiling), largest shear angle, and how far
the shear angles of the flat blank's places lie from those of the solid-shell. Results that lie in
the folder already are taken from there.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lcmchain import read_scene, run
from lcmchain.fields import read_forming
from lcmchain.fields.sheet import face_centres
from lcmchain.scene import RUNGS, on_rung

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

SCENE = Path(__file__).parents[1] / "hemisphere_holder" / "scene.toml"
PLAIN = ("output.pictures=false", "output.report=false", "output.vtu=false", "mapping=[]")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path, nargs="?", default=SCENE)
    parser.add_argument("--out", type=Path, default=Path("results/ladder"))
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    first = entries_with_time(arguments.scene.resolve().parent.name)
    scene = read_scene(arguments.scene, (*first, *PLAIN))
    for model in RUNGS:
        if not (arguments.out / model / "forming.nc").exists():
            run(on_rung(scene, model), arguments.out / model, threads=arguments.threads)
    print(table(arguments.out))


def table(folder: Path) -> str:
    """Return the table of the runs in a folder, in Markdown."""
    finest = list(RUNGS)[-1]
    reference = read_forming(folder / finest / "forming.nc")
    places = face_centres(reference, formed=False)
    exact = np.degrees(reference["shear_angle"].values[-1])
    lines = ["| model | time | largest shear angle | from the solid-shell: rms | at most |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    for model in RUNGS:
        sheet = read_forming(folder / model / "forming.nc")
        summary = json.loads((folder / model / "summary.json").read_text(encoding="utf-8"))
        shear = np.degrees(sheet["shear_angle"].values[-1])
        face = cKDTree(places).query(face_centres(sheet, formed=False))[1]
        count = np.bincount(face, minlength=len(places))
        error = np.bincount(face, weights=shear, minlength=len(places)) / count - exact
        lines.append(
            f"| {model} | {summary['wall_s']:.3g} s | {np.abs(shear).max():.1f}° "
            f"| {np.sqrt(np.mean(error**2)):.2f}° | {np.abs(error).max():.1f}° |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
