"""Bias extension of one fabric in two sizes: the law of one predicts the force of the other.

    python examples/identification/two_sizes.py [FOLDER]

A plain weave of commingled glass and polypropylene (743 g/m², 1.2 mm) of the benchmark of 2008,
forces digitised from its published curves at angles of the pin-jointed net. Prints a table and
writes ``two_sizes.md`` and ``two_sizes.png`` to the folder (``results/two_sizes``).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from lcmchain.coupons.analytic import BiasExtension
from lcmchain.coupons.result import finish, two_panels
from lcmchain.identification.data import CouponData
from lcmchain.identification.shear import identify_shear
from lcmchain.report.style import SERIES

THICKNESS = 1.2e-3
# Rows of the fit: the points are read from smooth curves, between which the force is as smooth.
ROWS = 30
COMPARED_UP_TO = 35.0  # laboratories agree up to this angle [deg]


class Specimen(NamedTuple):
    """A size [m] and what was measured: displacement [mm] and force [N]."""

    name: str
    net: BiasExtension
    displacement: tuple[float, ...]
    force: tuple[float, ...]


SMALL = Specimen(
    "115 mm x 230 mm",
    BiasExtension(0.230, 0.115, THICKNESS),
    (9.59, 18.22, 25.85, 32.40, 35.25, 37.83, 39.23),
    (1.25, 2.05, 2.96, 4.60, 5.64, 7.11, 8.07),
)
LARGE = Specimen(
    "150 mm x 450 mm",
    BiasExtension(0.450, 0.150, THICKNESS),
    (25.01, 47.54, 67.42, 84.51, 91.97, 98.68, 102.34),
    (1.87, 2.61, 4.83, 8.32, 11.27, 15.51, 18.65),
)


def shear_law(specimen: Specimen) -> Callable[[np.ndarray], np.ndarray]:
    """Return S12(γ) [Pa] identified from a specimen."""
    u, force = np.array(specimen.displacement), np.array(specimen.force)
    curve = PchipInterpolator(np.append(0.0, u), np.append(0.0, force))
    rows = np.linspace(0.5 * u[0], u[-1], ROWS)
    columns = {"displacement": 1e-3 * rows, "force": curve(rows)}
    data = CouponData(specimen.name, columns, np.arange(ROWS) + 2, np.zeros(ROWS, dtype=int))
    found = identify_shear(data, specimen.net)
    s = [found[f"s{k}"].value for k in range(5)]

    def stress(angle: np.ndarray) -> np.ndarray:
        e = 0.5 * np.sin(angle)
        return np.polynomial.polynomial.polyval(e, s) * 2.0 * e

    return stress


def deviations(specimen: Specimen, stress: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles of the points [deg], and by how much a law's force is above theirs."""
    angle = specimen.net.shear_angle(1e-3 * np.array(specimen.displacement))
    force = specimen.net.force(angle, stress)
    return np.degrees(angle), force / np.array(specimen.force) - 1.0


def table(laws: dict[str, Callable]) -> str:
    """Return the deviations of both predictions as a table."""
    angle, small = deviations(SMALL, laws[LARGE.name])
    _, large = deviations(LARGE, laws[SMALL.name])
    head = "| shear angle of the net | " + " | ".join(f"{a:.0f}°" for a in angle) + " |"
    rows = [
        f"| {one.name}, by the law of {other.name} | "
        + " | ".join(f"{100 * d:+.0f} %" for d in by)
        + " |"
        for one, other, by in ((SMALL, LARGE, small), (LARGE, SMALL, large))
    ]
    return "\n".join([head, "|---" * (angle.size + 1) + "|", *rows])


def draw(path: Path, laws: dict[str, Callable]) -> None:
    """Draw the forces measured, and those by either law."""
    with two_panels(path, "Bias extension in two sizes", "plain weave, 743 g/m²") as panels:
        for axis, specimen in zip(panels, (SMALL, LARGE), strict=True):
            u = np.linspace(0.0, specimen.displacement[-1], 200)
            axis.plot(
                specimen.displacement, specimen.force, "o", ms=4, color="#1b1f24", label="measured"
            )
            for (name, stress), colour in zip(laws.items(), SERIES):
                force = specimen.net.force(specimen.net.shear_angle(1e-3 * u), stress)
                axis.plot(u, force, lw=1.4, color=colour, label=f"law of {name}")
            axis.set_xlabel(f"displacement [mm], {specimen.name}")
            axis.set_ylabel("force [N]")
            finish(axis)
            axis.legend(loc="upper left")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/two_sizes"))
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    laws = {specimen.name: shear_law(specimen) for specimen in (SMALL, LARGE)}
    print(table(laws))
    (folder / "two_sizes.md").write_text(table(laws) + "\n", encoding="utf-8")
    draw(folder / "two_sizes.png", laws)


if __name__ == "__main__":
    main()
