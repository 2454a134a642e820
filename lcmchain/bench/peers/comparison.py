"""Kernel and whole step of the plate beside those of other programs, as ratios of one run."""

from __future__ import annotations

import dataclasses
import platform
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table

from lcmchain import __version__
from lcmchain.bench import sizes
from lcmchain.bench.measure import median_of
from lcmchain.bench.peers.calculix import CalculiX
from lcmchain.bench.peers.kratos import PRISM, Kratos
from lcmchain.bench.peers.plate import (
    EDGE_ELEMENTS,
    REPETITIONS,
    Peer,
    PeerSpeed,
    elastic_plate,
    measure_peer,
    own_displacement,
)
from lcmchain.bench.sizes import measured_plate
from lcmchain.bench.tables import write_figures
from lcmchain.compilation.threads import use_threads
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation

PEERS: tuple[Peer, ...] = (CalculiX(), Kratos(), Kratos(PRISM))


class Comparison(NamedTuple):
    """What all programs take on one thread.

    elastic, fabric : this program on the plate, and on one of MD600 with as many elements.
    peers : those that are installed. missing : name and what to do of the others.
    """

    elastic: sizes.Plate
    fabric: sizes.Plate
    peers: list[PeerSpeed]
    missing: list[tuple[str, str]]


def compare(edge_elements: int = EDGE_ELEMENTS, repetitions: int = REPETITIONS) -> Comparison:
    """Measure all programs that are installed, in turn: all find the machine as fast or slow."""
    use_threads(1)
    plate, simulation = elastic_plate(edge_elements)
    own = own_displacement(plate, simulation)
    fabric = sizes.free_plate(len(plate.elements))
    versions = {peer: peer.version() for peer in PEERS}
    installed = [(peer, version) for peer, version in versions.items() if version is not None]
    turns: list[tuple[sizes.Plate, sizes.Plate, list[PeerSpeed]]] = []
    for _ in range(repetitions):
        speeds = [measure_peer(peer, version, plate, own) for peer, version in installed]
        turns.append((_measured(simulation), _measured(fabric), speeds))
    elastics, fabrics, peers = zip(*turns, strict=True)
    return Comparison(
        _median_plate(elastics),
        _median_plate(fabrics),
        [_median_speed(speeds) for speeds in zip(*peers, strict=True)],
        [(peer.name, peer.install) for peer, version in versions.items() if version is None],
    )


def _measured(simulation: Simulation) -> sizes.Plate:
    chunks = round(sizes.ELEMENT_STEPS / simulation.model.element_count / STEPS_PER_CHUNK)
    return measured_plate(simulation, max(1, chunks), 1)


def _median_plate(turns: Sequence[sizes.Plate]) -> sizes.Plate:
    return dataclasses.replace(
        turns[0],
        kernel=median_of([turn.kernel for turn in turns]),
        step=median_of([turn.step for turn in turns]),
    )


def _median_speed(turns: Sequence[PeerSpeed]) -> PeerSpeed:
    return turns[0]._replace(
        processor=statistics.median(turn.processor for turn in turns),
        wall=statistics.median(turn.wall for turn in turns),
    )


def run_peer_bench(json_file: Path | None = None) -> Table:
    """Measure, and return the table of ``lcmchain bench --peers``."""
    found = compare()
    if json_file is not None:
        write_figures(json_file, figures(found))
    return peer_table(found)


def figures(found: Comparison) -> dict[str, Any]:
    """Return what goes to a JSON file [µs per element and step]."""
    return {
        "own": {
            "elastic": {"kernel": found.elastic.kernel.median, "step": found.elastic.step.median},
            "MD600": {"kernel": found.fabric.kernel.median, "step": found.fabric.step.median},
        },
        "peers": [peer._asdict() for peer in found.peers],
        "not_installed": [name for name, _ in found.missing],
    }


def peer_table(found: Comparison) -> Table:
    """Return the table; the ratios are to this program on the same plate."""
    kernel, step = found.elastic.kernel.median, found.elastic.step.median
    table = Table(
        title=(
            f"Elastic plate of {found.elastic.element_count} hexahedra, one thread, µs per element "
            f"and step, medians ({platform.machine()})"
        ),
        title_justify="left",
    )
    table.add_column("program")
    table.add_column("version")
    for column in ("µs", "wall", "over kernel", "over whole step", "difference"):
        table.add_column(column, justify="right", no_wrap=True)
    for law, plate in (("elastic", found.elastic), ("MD600", found.fabric)):
        for what, measured in (("kernel", plate.kernel), ("whole step", plate.step)):
            us = measured.median
            row = f"{us:.4f}", "", f"{us / kernel:.2f}", f"{us / step:.2f}", ""
            table.add_row(f"lcmchain, {law}, {what}", __version__, *row)
    for peer in found.peers:
        us = peer.processor
        table.add_row(
            peer.name, peer.version, f"{us:.3f}", f"{peer.wall:.3f}", f"{us / kernel:.1f}",
            f"{us / step:.1f}", f"{peer.difference:.1%}",
        )  # fmt: skip
    if found.missing:
        table.caption = "\n".join(f"{name}: {install}" for name, install in found.missing)
        table.caption_justify = "left"
    return table
