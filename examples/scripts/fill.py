"""Fill a formed sheet with resin from its pole, and check that no resin is lost.

Usage: python examples/scripts/fill.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from lcmchain import read_scene, run
from lcmchain.coupling.infiltration.stage import map_and_fill
from lcmchain.scene import read_infiltration

SCENE = Path(__file__).with_name("dome.toml")
CASE = """
time = "1 h"
resin = { law = "constant", viscosity = "0.1 Pa*s" }
gates = [{ name = "pole", point = "0 0 -20 mm", radius = "10 mm", pressure = "2 bar" }]
vents = [{ name = "rim", rim = true }]
permeability = { law = "gebart", fibre_radius = "3.5 um", packing = "quadratic" }
"""


def main(folder: Path) -> None:
    """Form the dome and fill it."""
    run(read_scene(SCENE), folder)
    case = folder / "case.toml"
    case.write_text(CASE, encoding="utf-8")
    _, report = map_and_fill(
        folder / "forming.nc", None, read_infiltration(case), name="resin", out_dir=folder
    )
    print(report.summary())
    assert report.outcome == "filled"
    assert report.balance_error < 1e-9
    assert not report.dry_spots


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/fill"))
