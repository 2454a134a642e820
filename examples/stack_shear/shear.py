"""Transverse shear of a stack of 18 plies against a measured curve.

    python examples/stack_shear/shear.py [FOLDER] [--edge MM] [--time MS]

The stack, 200 mm x 50 mm and 18 mm thick, is held at its bottom; its top is moved along the length
by 3 mm. Plies slide on each other by a law between them, ``shear_by_points``, that follows from the
measured stress over the angle of the stack. Prints the force on the top beside what the measured
curve says, and writes ``shear.csv`` and ``shear.png`` to the folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from lcmchain.effects.supports import Support
from lcmchain.interfaces.laws.shear_by_points import ShearByPointsTable
from lcmchain.interfaces.table import Interface
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.table import build_tool_table

# Measured on the stack: angle [deg] and shear stress [MPa].
ANGLE = (0.0, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
STRESS = (
    0.0, 0.0032, 0.0066, 0.0103, 0.0169, 0.0234, 0.0319, 0.0379, 0.0426, 0.0501, 0.0554, 0.0590,
    0.0611, 0.0619,
)  # fmt: skip
measured = PchipInterpolator(ANGLE, STRESS)

PLIES = 18
LENGTH, WIDTH, THICKNESS = 200.0, 50.0, 1.0  # of a ply [mm]
TRAVEL = 3.0  # of the top [mm]
TRAVELS = (0.1, 0.25, 0.5, 1.0, 1.5, 2.0)  # at which forces are compared [mm]

# Nothing is known of the plies but their thickness. They are stiff beside what lies between them.
MODULUS = 100.0  # Young's modulus, without lateral contraction [MPa]
SHEAR_MODULUS = 0.5 * MODULUS
# The shear forces of top and bottom make a moment. It opens one end of the stack and presses the
# other one, so that the grips have to press the stack before they shear it.
PRESSURE = 0.35  # [MPa]
PRESS_TIME = 5.0  # [ms]
# Of the contact, as stiff as a ply: a softer one would let plies into each other.
STIFFNESS = MODULUS / THICKNESS  # [N/mm³]

SCENE = """
title = "Shear of a stack"
process = {{ time = "{time} ms" }}
[blank]
size = ["{length} mm", "{width} mm"]
edge_length = "{edge} mm"
height = "{height} mm"
[material]
law = "isotropic"
young_modulus = "{modulus} MPa"
poisson_ratio = 0.0
density = "1000 kg/m^3"
thickness = "{thickness} mm"
"""


class Result(NamedTuple):
    """Course of the top: travel [mm], force on it [N], kinetic energy over external work."""

    travel: np.ndarray
    force: np.ndarray
    kinetic: np.ndarray
    balance: float

    def at(self, travel: float) -> float:
        """Return the force [N] at a travel [mm]."""
        return float(np.interp(travel, self.travel, self.force))


def force_of_curve(travel: float) -> float:
    """Return the force [N] that the measured curve gives at a travel of the top [mm]."""
    angle = np.degrees(np.arctan(travel / (PLIES * THICKNESS)))
    return float(measured(angle)) * LENGTH * WIDTH


def interface_curve(plies_shear: bool = True) -> ShearByPointsTable:
    """Return the law between two plies that makes the stack follow the measured curve.

    At an angle of the stack its top has moved by tan(angle) times the height of all plies. The
    plies themselves have sheared by stress over shear modulus, on the same height. What is left is
    the slip of all interfaces, one less than plies, in even shares, since all carry one stress.
    """
    angle = np.concatenate([ANGLE[1:4], np.linspace(0.25, 7.0, 28)])
    stress = measured(angle)
    way = PLIES * THICKNESS * np.tan(np.radians(angle))
    of_plies = PLIES * THICKNESS * stress / SHEAR_MODULUS if plies_shear else 0.0
    slip = (way - of_plies) / (PLIES - 1)
    return ShearByPointsTable(slip=tuple(1e-3 * slip), stress=tuple(1e6 * stress))


def smooth(s: float) -> float:
    """Return a ramp from 0 to 1 that is at rest at both ends."""
    s = min(max(s, 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def travel_at(time: float, process_time: float) -> float:
    """Return the travel of the top [mm] at a time [ms]."""
    return TRAVEL * smooth((time - PRESS_TIME) / (process_time - PRESS_TIME))


def build(edge: float, time: float, law: ShearByPointsTable) -> Simulation:
    """Return the simulation of the stack; edge length in mm, time in ms."""
    entries = {"time": time, "length": LENGTH, "width": WIDTH, "edge": edge}
    entries |= {"modulus": MODULUS, "thickness": THICKNESS}
    plies = []
    for i in range(PLIES):
        scene = scene_from_text(SCENE.format(height=(i + 0.5) * THICKNESS, **entries))
        mesh = build_blank(scene.blank, scene.material.thickness)
        plies.append(Sheet(f"ply_{i + 1}", mesh, scene.material.build(), scene.element))
    elements = plies[0].mesh.elements
    above = (PLIES - 1) * plies[0].mesh.node_count

    def motion(seconds: float) -> np.ndarray:
        pressed = PRESSURE / MODULUS * PLIES * THICKNESS * smooth(1e3 * seconds / PRESS_TIME)
        way = 1e-3 * np.array([travel_at(1e3 * seconds, time), 0.0, -pressed])
        return np.column_stack([np.eye(3), way])

    supports = [
        Support("bottom", np.unique(elements[:, :4])),
        Support("top", above + np.unique(elements[:, 4:]), motion=motion),
    ]
    between = [
        Interface(between=(below.name, own.name), laws=(law,), penalty=1e9 * STIFFNESS)
        for below, own in zip(plies, plies[1:], strict=False)
    ]
    model = assemble_bodies(
        plies,
        tools=build_tool_table(scene.tools, None, scene.process.time),
        tool_names=[],
        contact=scene.contact,
        process=scene.process,
        supports=supports,
        interfaces=between,
    )
    return Simulation(model)


def shear(edge: float, time: float, law: ShearByPointsTable, points: int = 200) -> Result:
    """Shear the stack and return what its top takes: means between ``points`` times."""
    simulation = build(edge, time, law)
    simulation.advance_to(1e-3 * PRESS_TIME)
    pressed = simulation.energy()["external"]
    impulse = simulation.state.support_impulse[1, 0]
    times = np.linspace(PRESS_TIME, time, points + 1)
    travel, force, kinetic = [], [], []
    for start, stop in zip(times, times[1:], strict=False):
        simulation.advance_to(1e-3 * stop)
        now = simulation.state.support_impulse[1, 0]
        travel.append(travel_at(0.5 * (start + stop), time))
        force.append((now - impulse) / (1e-3 * (stop - start)))
        impulse = now
        energy = simulation.energy()
        kinetic.append(energy["kinetic"] / max(energy["external"] - pressed, 1e-300))
    balance = simulation.energy()["balance_error"] / simulation.energy()["external"]
    return Result(np.array(travel), np.array(force), np.array(kinetic), balance)


def draw(result: Result, path: Path) -> None:
    """Plot the force of a result beside the measured curve."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
    angle = np.array(ANGLE)
    height = PLIES * THICKNESS
    axes.plot(height * np.tan(np.radians(angle)), np.array(STRESS) * LENGTH * WIDTH, "ko",
              label="measured stress times area")  # fmt: skip
    axes.plot(result.travel, result.force, label="18 plies")
    axes.set_xlabel("travel of the top [mm]")
    axes.set_ylabel("force [N]")
    axes.set_xlim(0.0, TRAVEL)
    axes.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/stack_shear"))
    parser.add_argument("--edge", type=float, default=10.0, help="edge length [mm]")
    parser.add_argument("--time", type=float, default=60.0, help="of the process [ms]")
    arguments = parser.parse_args()
    result = shear(arguments.edge, arguments.time, interface_curve())
    print("travel [mm]  force [N]  measured curve [N]  difference")
    for travel in TRAVELS:
        force, wanted = result.at(travel), force_of_curve(travel)
        print(f"{travel:11.2f} {force:10.1f} {wanted:19.1f} {100 * (force / wanted - 1):10.1f} %")
    late = result.travel > TRAVELS[0]
    print(f"kinetic energy over external work, from {TRAVELS[0]} mm on: "
          f"{100 * result.kinetic[late].max():.2f} % at most")  # fmt: skip
    print(f"energy balance: {100 * result.balance:.3f} % of the external work")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    columns = np.column_stack([result.travel, result.force])
    np.savetxt(
        arguments.folder / "shear.csv", columns, "%.6g", ",", header="travel [mm],force [N]",
        comments="",
    )  # fmt: skip
    draw(result, arguments.folder / "shear.png")


if __name__ == "__main__":
    main()
