"""Coupon data of MD600 for this example: the published laws with 2 % seeded noise.

Writes ``shear.csv``, ``compaction.csv``, ``bending.csv``, ``viscous.csv``, ``off-axis.csv``,
``bending-loop.csv`` and ``shear-loop.csv`` beside this file, the same to the bit on every run. The
last four are of other fabrics, by round numbers: MD600 wet with resin, with a dashpot and a Maxwell
element; the unidirectional fabric of ``examples/hemisphere_unidirectional``; and MD600 that rubs.

    python make_data.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.coupons.analytic import BiasExtension, PictureFrame
from lcmchain.coupons.analytic.off_axis import affine_tension
from lcmchain.identification.synthetic import (
    bending_loop_curve,
    bias_extension_curve,
    cantilever_overhangs,
    compaction_curve,
    noisy,
    picture_frame_curve,
    preset_fabric,
    shear_loop_curve,
    write_coupon,
)
from lcmchain.materials.features.rheology import Friction
from lcmchain.materials.features.shear_friction import ShearFriction
from lcmchain.materials.features.viscous_shear import Relaxation, ViscousShear
from lcmchain.scene import read_scene

NOISE = 0.02
AREAL_WEIGHT = 0.6 * 9.81  # [N/m²]
STRIPS_PER_ORIENTATION = 5
WET = ViscousShear(viscosity=2000.0, terms=(Relaxation(modulus=3e4, time=2.0),))
PULLS = (0.01, 0.05, 0.25)  # speeds of the frame, which then stands still [m/s]
STAND = 30.0  # [s]
UNIDIRECTIONAL = Path(__file__).parents[1] / "hemisphere_unidirectional" / "scene.toml"
BENT = Friction(limit=0.02, length=4.0)  # [N], [1/m]
SHEARED = ShearFriction(stress=5e3, angle=np.radians(1.0), growth=0.3)
OFF_AXIS = (30.0, 45.0, 60.0)  # angles of the fibres from the pull [deg]


def write_data(folder: Path) -> None:
    """Write all files into a folder."""
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
    write_frames(folder / "viscous.csv")
    write_strips(folder / "off-axis.csv")
    write_loops(folder)


def write_frames(file: Path) -> None:
    """Write picture frames at several speeds, which stand still after their pull."""
    fabric = preset_fabric("MD600")
    frame = PictureFrame(side=0.2, thickness=fabric.thickness)
    columns: dict[str, list[np.ndarray]] = {}
    for number, speed in enumerate(PULLS):
        travel = np.linspace(0.0, 70e-3, 36)
        still = np.geomspace(1e-3 * STAND, STAND, 20)
        time = np.append(travel / speed, travel[-1] / speed + still)
        travel = np.append(travel, np.full(len(still), travel[-1]))
        force = picture_frame_curve(fabric, WET, frame, time, travel, noise=NOISE, seed=4 + number)
        for name, values in {
            "time [s]": time,
            "displacement [mm]": 1e3 * travel,
            "force [N]": force,
            "specimen": np.full(len(time), number),
        }.items():
            columns.setdefault(name, []).append(values)
    write_coupon(
        file,
        {name: np.concatenate(parts) for name, parts in columns.items()},
        "Picture frame 200 mm x 200 mm at 10, 50 and 250 mm/s along the diagonal, then held. "
        "Synthetic: shear law of MD600, viscosity 2000 Pa s, Maxwell element 0.03 MPa in 2 s, with "
        "2 % noise, not a measurement.",
    )


def write_strips(file: Path) -> None:
    """Write off-axis tension of a unidirectional fabric at three angles."""
    material = read_scene(UNIDIRECTIONAL, ['material.fibres.0.tension="100 GPa"']).material
    length, width = 0.16, 0.04
    travel = np.linspace(0.0, 30e-3, 31)[1:]
    forces = [
        noisy(
            affine_tension(material.build(), np.radians(angle), 1.0 + travel / length).force(
                width, material.thickness
            ),
            NOISE,
            seed=7 + number,
        )
        for number, angle in enumerate(OFF_AXIS)
    ]
    write_coupon(
        file,
        {
            "angle [deg]": np.repeat(OFF_AXIS, len(travel)),
            "displacement [mm]": 1e3 * np.tile(travel, len(OFF_AXIS)),
            "force [N]": np.concatenate(forces),
            "specimen": np.repeat(np.arange(len(OFF_AXIS)), len(travel)),
        },
        "Off-axis tension of strips 160 mm x 40 mm x 0.6 mm. Synthetic: even state of the fabric "
        "of examples/hemisphere_unidirectional with 2 % noise, not a measurement.",
    )


def write_loops(folder: Path) -> None:
    """Write a loop of pure bending, and cycles of a picture frame, of MD600 that rubs."""
    fabric = preset_fabric("MD600")
    curvature = _there_and_back(0.0, 20.0, -20.0, 20.0)
    stiffness = fabric.law.B11 * fabric.thickness**3 / 12.0
    moment = bending_loop_curve(stiffness, BENT, curvature, noise=NOISE, seed=12)
    write_coupon(
        folder / "bending-loop.csv",
        {"curvature [1/m]": curvature, "moment [mN]": 1e3 * moment},
        "Pure bending along fibres 1, moment per width. Synthetic: bending of MD600 with friction "
        "of 20 mN within 4 1/m and noise of 2 % of the largest moment, not a measurement.",
    )
    frame = PictureFrame(side=0.2, thickness=fabric.thickness)
    largest = float(frame.displacement(np.radians(50.0)))
    travel = _there_and_back(0.0, *[largest, 0.0] * 2)
    force = shear_loop_curve(fabric, SHEARED, frame, travel, noise=0.5 * NOISE, seed=11)
    write_coupon(
        folder / "shear-loop.csv",
        {"displacement [mm]": 1e3 * travel, "force [N]": force},
        "Picture frame 200 mm x 200 mm to 50 deg and back twice. Synthetic: shear law of MD600 "
        "with friction of 5 kPa within 1 deg that grows with 0.3 of the shear stress, and noise of "
        "1 % of the largest force, not a measurement.",
    )


def _there_and_back(*points: float) -> np.ndarray:
    """Return 40 rows from each turning point to the next one, from the first on."""
    ways = [np.linspace(a, b, 41)[1:] for a, b in zip(points, points[1:], strict=False)]
    return np.concatenate([points[:1], *ways])


if __name__ == "__main__":
    write_data(Path(__file__).parent)
