"""Picture frame of a fabric under tension whose yarns rub at their crossings.

    python examples/tension_shear/pull.py [FOLDER]

A square is stretched along both families, sheared by a frame to 40 degrees, and back. Compares the
stress along the frame with the closed form of the law, for three tensions, and what is lost with
the area of the loop. Writes ``curves.png`` to the folder (``results/tension_shear``).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from law import CrossingMaterial, rubbing_md600

from lcmchain.coupons.result import finish, two_panels
from lcmchain.coupons.specimen import record
from lcmchain.effects.supports import Support
from lcmchain.report.style import SERIES
from lcmchain.scene import Scene

SIDE = 0.04
SHEAR = math.radians(40.0)
STRETCHES = (1.0, 1.0005, 1.001)
TIME = 0.4
# Parts of the time in which the fabric is stretched, sheared, and sheared back.
STRETCHED, SHEARED = 0.2, 0.6


def smooth(x: float) -> float:
    """Return a rise from 0 to 1 that starts and ends at rest."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)


def course(stretch: float, time: float) -> tuple[float, float]:
    """Return the stretch of the fibres and the shear angle at a time."""
    part = time / TIME
    on = smooth((part - STRETCHED) / (SHEARED - STRETCHED))
    back = smooth((part - SHEARED) / (1.0 - SHEARED))
    return 1.0 + (stretch - 1.0) * smooth(part / STRETCHED), SHEAR * (on - back)


def pull(stretch: float, frames: int = 81) -> dict[str, np.ndarray]:
    """Return shear angle [deg], S12 of the frame and of the closed form [MPa], and energies."""
    material = rubbing_md600()
    scene = Scene(
        title="Picture frame under tension",
        material=material,
        process={"time": TIME, "frames": frames, "mass_damping": 20.0},
        blank={"size": (SIDE, SIDE), "edge_length": 0.5 * SIDE},
    )

    def motion(time: float) -> np.ndarray:
        size, angle = course(stretch, time)
        c, s = size * math.cos(0.5 * angle), size * math.sin(0.5 * angle)
        return np.array([[c, s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    simulation, recording = record(
        scene,
        lambda blank: [Support("frame", np.arange(len(blank.node_positions)), "xy", motion=motion)],
    )
    times = np.linspace(0.0, TIME, frames)
    size, angle = np.array([course(stretch, float(t)) for t in times]).T
    g = size**2 * np.sin(angle)
    # work of the frame over what it shears: S12 of the mean of an interval
    volume = SIDE**2 * material.thickness
    turned = np.diff(g)
    sheared = np.abs(turned) > 1e-4
    stress = np.diff(recording.work) / volume / np.where(sheared, turned, np.nan)
    return {
        "shear angle [deg]": np.degrees(0.5 * (angle[1:] + angle[:-1])),
        "S12 [MPa]": 1e-6 * stress,
        "closed form [MPa]": 1e-6 * closed_form(material, size, g),
        "lost [J]": recording.energy["inelastic"][1:],
        "balance": np.abs(recording.energy["balance_error"][1:]),
    }


def closed_form(material: CrossingMaterial, size: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Return S12 [Pa] at the middle of the intervals, stepped finely along the course."""
    built, steps = material.build(), 50
    before, stress, found = 0.0, 0.0, []
    for k in range(len(g) - 1):
        mean = []
        for share in (np.arange(steps) + 1.0) / steps:
            E = np.zeros(6)
            E[:2] = 0.5 * ((size[k] + share * (size[k + 1] - size[k])) ** 2 - 1.0)
            E[3] = g[k] + share * (g[k + 1] - g[k])
            limit = float(built.limit(E))
            trial = stress + built.law.stiffness * (E[3] - before)
            before, stress = E[3], min(max(trial, -limit), limit)
            mean.append(float(built.stress_and_tangent(E)[0][3]) + stress)
        found.append(np.mean(mean))
    return np.array(found)


def main(folder: Path) -> None:
    """Pull the frame at three tensions; print, write and draw."""
    folder.mkdir(parents=True, exist_ok=True)
    runs = {stretch: pull(stretch) for stretch in STRETCHES}
    with two_panels(
        folder / "curves.png", "Picture frame under tension", "friction at crossings"
    ) as (left, right):
        for number, (stretch, run) in enumerate(runs.items()):
            name = f"fibres stretched by {100.0 * (stretch - 1.0):.3g} %"
            colour = SERIES[number]
            angle = run["shear angle [deg]"]
            left.plot(angle, 1e3 * run["S12 [MPa]"], "o", ms=3, color=colour, label=name)
            left.plot(angle, 1e3 * run["closed form [MPa]"], "-", lw=1.0, color=colour)
            right.plot(angle, 1e3 * run["lost [J]"], "-", lw=1.2, color=colour, label=name)
            known = np.isfinite(run["S12 [MPa]"])
            off = np.abs(run["S12 [MPa]"] - run["closed form [MPa]"])[known]
            print(
                f"{name}: off the closed form by at most "
                f"{100 * off.max() / np.abs(run['closed form [MPa]']).max():.2g} %, "
                f"lost {1e3 * run['lost [J]'][-1]:.4g} mJ"
            )
        for axis, label in ((left, "shear stress S12 [kPa]"), (right, "lost to friction [mJ]")):
            axis.set_xlabel("shear angle [deg]")
            axis.set_ylabel(label)
            finish(axis)
        left.autoscale()  # the way back has stresses below zero
        left.legend(loc="upper left")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/tension_shear"))
    main(parser.parse_args().folder)
