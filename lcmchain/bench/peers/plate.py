"""The plate that all programs compute, and what each of them answers.

The plate is isotropic and free, and is stretched by its own inertia.
One layer of hexahedra, St. Venant-Kirchhoff, or what a program has that is the same for the small
strains here. It starts with the velocity V cos(pi x / L) along x, which excites the lowest
stretching of the plate. Stretching it is, and not bending, because one layer of elements with a
single integration point (C3D8R) bends against its hourglass control alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

YOUNG_MODULUS = 1e9  # [Pa]
POISSON_RATIO = 0.3
DENSITY = 1e3  # [kg/m³]
THICKNESS = 1e-3  # [m]
SIDE = 0.16  # [m]
SPEED = 1.0  # largest at the start [m/s]: strains up to 0.1 %
EDGE_ELEMENTS = 32
# The step in parts of the time that a wave takes through the thickness, stable in every program.
COURANT = 0.3

SCENE = f"""
title = "plate of the peers"
process = {{ time = "1 s", frames = 2, gravity = false }}
blank = {{ size = ["160 mm", "160 mm"], edge_length = "5 mm", height = "1 mm" }}

[material]
law = "isotropic"
thickness = "1 mm"
density = "{DENSITY:g} kg/m^3"
young_modulus = "{1e-9 * YOUNG_MODULUS:g} GPa"
poisson_ratio = {POISSON_RATIO}
"""


class Plate(NamedTuple):
    """Mesh and start of the plate.

    nodes : (node_count, 3) [m]. elements : (element_count, 8) numbers of nodes, in the order of
    VTK. velocity : (node_count, 3) at the start [m/s].
    """

    nodes: np.ndarray
    elements: np.ndarray
    velocity: np.ndarray

    @property
    def step(self) -> float:
        """Time step for programs that are told one [s]."""
        lame = YOUNG_MODULUS * (1.0 - POISSON_RATIO)
        lame /= (1.0 + POISSON_RATIO) * (1.0 - 2.0 * POISSON_RATIO)
        return COURANT * THICKNESS / math.sqrt(lame / DENSITY)

    @property
    def quarter_period(self) -> float:
        """Of a bar's lowest stretching, where the displacement is about its largest [s]."""
        return 0.5 * SIDE / math.sqrt(YOUNG_MODULUS / DENSITY)


def elastic_plate(edge_elements: int = EDGE_ELEMENTS) -> tuple[Plate, Simulation]:
    """Return the plate, and a simulation of it by this program."""
    length = 1e3 * SIDE / edge_elements
    scene = scene_from_text(SCENE, overrides=(f"blank.edge_length={length:.9g} mm",))
    simulation = Simulation.from_scene(scene)
    nodes = simulation.model.node_positions
    velocity = np.zeros_like(nodes)
    velocity[:, 0] = SPEED * np.cos(np.pi * (nodes[:, 0] - nodes[:, 0].min()) / SIDE)
    simulation.set_velocity(velocity.T)
    return Plate(nodes, simulation.model.only_body().mesh.elements, velocity), simulation


def own_displacement(plate: Plate, simulation: Simulation) -> np.ndarray:
    """Return this program's displacement after a quarter of a period (node_count, 3) [m]."""
    count = math.ceil(plate.quarter_period / plate.step)
    start = simulation.state.copy()
    simulation.make_steps(count, plate.quarter_period / count)
    displacement = simulation.state.position.T - plate.nodes
    simulation.restore(start)
    return displacement


REPETITIONS = 5
# The short run, in parts of the long one.
SHORT = 0.25


class Run(NamedTuple):
    """One run of a peer.

    steps : that it made. processor : time of the processor, user and system [s]. wall : [s].
    displacement : at the end (node_count, 3) [m].
    """

    steps: int
    processor: float
    wall: float
    displacement: np.ndarray


class Peer(Protocol):
    """A program that computes the plate, on one thread.

    name : with its element. install : what to do where it is missing.
    """

    name: str
    install: str

    def version(self) -> str | None:
        """Return the version that is installed, None where none is."""
        ...

    def run(self, plate: Plate, duration: float) -> Run:
        """Compute the plate over so long [s]."""
        ...


class PeerSpeed(NamedTuple):
    """What a peer takes [µs per element and step], and how far it agrees.

    difference : to this program's displacement after a quarter of a period, L2 over the nodes, in
        parts of it.
    """

    name: str
    version: str
    processor: float
    wall: float
    difference: float


def measure_peer(peer: Peer, version: str, plate: Plate, own: np.ndarray) -> PeerSpeed:
    """Measure a peer: difference of a long and a short run, so that reading and output drop out.

    Parameters
    ----------
    own : displacement of this program after a quarter of a period (node_count, 3) [m].
    """
    short = peer.run(plate, SHORT * plate.quarter_period)
    long = peer.run(plate, plate.quarter_period)
    microseconds = 1e6 / (len(plate.elements) * (long.steps - short.steps))
    return PeerSpeed(
        peer.name,
        version,
        processor=microseconds * (long.processor - short.processor),
        wall=microseconds * (long.wall - short.wall),
        difference=float(np.linalg.norm(long.displacement - own) / np.linalg.norm(own)),
    )
