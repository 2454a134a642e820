"""The plate of ``lcmchain bench --peers``: all programs compute the same thing."""

import io

import numpy as np
import pytest
from rich.console import Console

from lcmchain.bench.peers import comparison
from lcmchain.bench.peers.calculix import CalculiX
from lcmchain.bench.peers.kratos import HEXAHEDRON, Kratos
from lcmchain.bench.peers.plate import SPEED, Run, elastic_plate, measure_peer, own_displacement

EDGE_ELEMENTS = 16
PEERS = [CalculiX(), Kratos(HEXAHEDRON)]


@pytest.fixture(scope="module")
def plate():
    return elastic_plate(EDGE_ELEMENTS)


def test_the_plate_stretches_as_a_bar_does(plate):
    """The largest displacement is that of a bar, V/omega: lateral inertia changes it little."""
    displacement = own_displacement(*plate)
    omega = 0.5 * np.pi / plate[0].quarter_period
    assert np.abs(displacement[:, 0]).max() == pytest.approx(SPEED / omega, rel=0.03)


@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_a_peer_computes_the_same(plate, peer):
    """Same displacement after a quarter of a period, within 0.2 % of it over all nodes."""
    if peer.version() is None:
        pytest.skip(peer.install)
    own = own_displacement(*plate)
    found = peer.run(plate[0], plate[0].quarter_period)
    assert np.linalg.norm(found.displacement - own) < 0.002 * np.linalg.norm(own)
    assert found.steps > 100 and found.processor > 0.0


class Twin:
    """A peer that needs 2 s and 3 µs for each step of an element."""

    name, install = "twin", "not installed: write it"

    def version(self):
        return "1"

    def run(self, plate, duration):
        steps = round(duration / plate.step)
        time = 2.0 + 3e-6 * steps * len(plate.elements)
        return Run(steps, time, 2.0 * time, np.ones_like(plate.nodes))


def test_what_a_run_takes_before_and_after_its_steps_drops_out(plate):
    own = np.full_like(plate[0].nodes, 1.25)
    speed = measure_peer(Twin(), "1", plate[0], own)
    assert speed.processor == pytest.approx(3.0) and speed.wall == pytest.approx(6.0)
    assert speed.difference == pytest.approx(0.2)


class Missing(Twin):
    name = "absent"

    def version(self):
        return None


def test_a_missing_peer_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr(comparison, "PEERS", (Twin(), Missing()))
    monkeypatch.setattr(comparison.sizes, "ELEMENT_STEPS", 100)
    monkeypatch.setattr(comparison.sizes, "REPETITIONS", 1)
    found = comparison.compare(edge_elements=4, repetitions=1)
    assert comparison.figures(found)["not_installed"] == ["absent"]
    console = Console(file=io.StringIO(), width=200)
    console.print(comparison.peer_table(found))
    (line,) = [one for one in console.file.getvalue().splitlines() if "absent" in one]
    assert "not installed: write it" in line
