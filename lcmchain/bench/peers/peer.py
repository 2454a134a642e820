"""What every other program answers, and its throughput from that."""

from __future__ import annotations

import statistics
from typing import NamedTuple, Protocol

import numpy as np

from lcmchain.bench.peers.plate import Plate

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

    processor, wall : medians. difference : to this program's displacement after a quarter of a
    period, L2 over the nodes, in parts of it.
    """

    name: str
    version: str
    processor: float
    wall: float
    difference: float


def measure_peer(
    peer: Peer, version: str, plate: Plate, own: np.ndarray, repetitions: int = REPETITIONS
) -> PeerSpeed:
    """Measure a peer: differences of a long and a short run, so that reading and output drop out.

    Parameters
    ----------
    own : displacement of this program after a quarter of a period (node_count, 3) [m].
    """
    processor, wall = [], []
    for _ in range(repetitions):
        short = peer.run(plate, SHORT * plate.quarter_period)
        long = peer.run(plate, plate.quarter_period)
        microseconds = 1e6 / (len(plate.elements) * (long.steps - short.steps))
        processor.append(microseconds * (long.processor - short.processor))
        wall.append(microseconds * (long.wall - short.wall))
    difference = float(np.linalg.norm(long.displacement - own) / np.linalg.norm(own))
    return PeerSpeed(
        peer.name, version, statistics.median(processor), statistics.median(wall), difference
    )
