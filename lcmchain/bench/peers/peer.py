"""What every other program answers, and its throughput from that."""

from __future__ import annotations

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
