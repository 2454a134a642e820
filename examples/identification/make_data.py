"""Coupon data of MD600 for this example: the published laws with 2 % seeded noise.

Writes ``shear.csv``, ``compaction.csv`` and ``bending.csv`` beside this file, the same to the bit
on every run:

    python make_data.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.coupons.analytic import BiasExtension
from lcmchain.identification.synthetic import (
    bias_extension_curve,
    cantilever_overhangs,
    compaction_curve,
    preset_fabric,
    write_coupon,
)

NOISE = 0.02
AREAL_WEIGHT = 0.6 * 9.81  # [N/m²]
STRIPS_PER_ORIENTATION = 5


def write_data(folder: Path) -> None:
    """Write the three files into a folder."""
    fabric = preset_fabric("MD600")
    origin = "Synthetic: published law of MD600 with 2 % noise, not a measurement."

    displacement = np.arange(0.5, 60.01, 0.5) * 1e-3
    specimen = BiasExtension(length=0.32, width=0.16, thickness=fabric.thickness)
    force = bias_extension_curve(fabric, specimen, displacement, noise=NOISE, seed=1)
    write_coupon(
        folder / "shear.csv",
        {"displacement [mm]": 1e3 * displacement, "force [N]": force},
        f"Bias-extension test 320 mm x 160 mm. {origin}",
    )

    thickness = np.linspace(0.98e-3, 0.56e-3, 85)
    pressure = compaction_curve(fabric, thickness, noise=NOISE, seed=2)
    write_coupon(
        folder / "compaction.csv",
        {"thickness [mm]": 1e3 * thickness, "pressure [MPa]": 1e-6 * pressure},
        f"Plate-to-plate compaction of one layer. {origin}",
    )

    degrees = np.repeat([0.0, 45.0, 90.0], STRIPS_PER_ORIENTATION)
    overhang = cantilever_overhangs(
        fabric, np.radians(degrees), areal_weight=AREAL_WEIGHT, noise=NOISE, seed=3
    )
    write_coupon(
        folder / "bending.csv",
        {"orientation [deg]": degrees, "overhang [mm]": 1e3 * overhang},
        f"Cantilever tests at 41.5 deg of narrow strips, free to twist. {origin}",
    )


if __name__ == "__main__":
    write_data(Path(__file__).parent)
