"""Ports of LCMsim and RTMsim that were picked with the mouse."""

from decimal import Decimal

import numpy as np
import pytest
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.infiltration.foreign_case import case_text, read_lcmsim, read_rtmsim
from lcmchain.coupling.infiltration.foreign_ports import read_ports
from lcmchain.coupling.infiltration.formed_part import unformed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.errors import InputError
from lcmchain.scene.reading.single_tables import infiltration_from_text

from .test_foreign_case import (
    COLUMNS,
    EDGE,
    INPUT,
    PARAMETERS,
    PARTS,
    folder,  # noqa: F401
    strip_text,
)

PORTS = "0.03\n0.15,0.05,0.0\n\n0.25,0.0,0.0\n"
OWN = "mouse,inlet,6,2.00e-3,0.7,0.0,5e-11,0.0,1.0,1,0,0,0.7,0.5e5,0.0\n"
#: No inlet but the ports.
TABLE = PARTS.replace("hose,inlet", "hose,patch") + OWN


def written(place, parts=TABLE, ports=PORTS):
    """Write a case of LCMsim; return what reads it."""
    (place / "parts.csv").write_text(parts, encoding="utf-8")
    (place / "parameters.csv").write_text(PARAMETERS, encoding="utf-8")
    text = strip_text(parts=[2, *[1] * 4, 3, 3, *[1] * 4, 4])
    (place / "strip.bdf").write_text(text, encoding="ascii")
    if ports is not None:
        (place / "_pset.csv").write_text(ports, encoding="utf-8")

    def read(given=None):
        files = (place / name for name in ("parts.csv", "parameters.csv", "strip.bdf"))
        return read_lcmsim(*files, Decimal("60"), given)

    return read


def setup_of(case):
    entries = infiltration_from_text(case_text(case))
    return set_up(unformed_part(case.mesh, entries.preform), entries)


def within(points, place, radius):
    return np.flatnonzero(np.linalg.norm(points - np.array(place), axis=1) <= radius)


def test_ports_beside_a_mesh_of_lcmsim_are_part_6_of_its_table(tmp_path):
    """Gates at the nodes within the radius; their cells have the textile of part 6 alone."""
    case = written(tmp_path)()
    assert not [text for text in case.told if "_pset" in text]
    setup = setup_of(case)
    assert [gate.name for gate in setup.gates] == ["mouse_1", "mouse_2"]
    for gate, place in zip(setup.gates, ((0.15, 0.05, 0.0), (0.25, 0.0, 0.0)), strict=True):
        nodes = within(setup.mesh.points, place, 0.03)
        assert np.array_equal(gate.nodes, nodes) and 2 < len(nodes) < 10
        cells = within(setup.mesh.centroids, place, 0.03)
        assert np.all(setup.part.cell("permeability_1")[cells] == 5e-11) and len(cells) > 3
    # the first one lies on the patch of columns 5 and 6, whose other cells keep their own
    patch = np.isin(np.repeat(np.arange(COLUMNS), 8), (5, 6))
    others = np.setdiff1d(
        np.flatnonzero(patch), within(setup.mesh.centroids, (0.15, 0.05, 0), 0.03)
    )
    assert len(others) and np.all(setup.part.cell("permeability_1")[others] == 12.75 * 1.2e-12)


def test_the_cells_of_a_port_on_a_patch_are_no_more_those_of_the_patch(tmp_path):
    """Also where the port has the textile of the base."""
    like_base = "mouse,inlet,6,3.00e-3,0.583,0.0,96.6e-12,0.0,0.400,1,0,0,0.583,0.5e5,0.0\n"
    setup = setup_of(written(tmp_path, TABLE.replace(OWN, like_base))())
    cells = within(setup.mesh.centroids, (0.15, 0.05, 0.0), 0.03)
    assert np.all(setup.part.cell("permeability_1")[cells] == 96.6e-12)


def test_ports_that_the_table_does_not_know_are_told_or_asked_for(tmp_path):
    read = written(tmp_path, PARTS)
    case = read()
    (told,) = [text for text in case.told if text.startswith("_pset.csv beside the mesh")]
    assert "no part 6" in told and len(setup_of(case).gates) == 1
    setup = setup_of(read(tmp_path / "_pset.csv"))
    assert [gate.name for gate in setup.gates] == ["hose", "port_1", "port_2"]
    assert setup.case.gates[1].pressure == (1.91e5,)


def test_a_port_with_a_cell_and_no_node_within_its_radius_is_the_nearest_node(tmp_path):
    middle = f"{2 * EDGE / 3!r},{EDGE / 3!r},0.0"  # the centroid of the first cell
    case = written(tmp_path, ports=f"0.006\n{middle}\n")()
    gate = setup_of(case).gates[0]
    assert len(gate.nodes) == 1
    assert 'radius = "0.006 m"' in case_text(case)  # of its cells


@pytest.mark.parametrize(
    ("ports", "said"),
    [
        ("0.03\n", "has no ports"),
        ("0.03\n0.1,0.2\n", "line 2: a port is three numbers"),
        ("0.03\n0.1,0.2,x\n", 'line 2: "x" is not a number'),
        ("-1\n0,0,0\n", "line 1: the radius of ports is above 0"),
        ("r\n0,0,0\n", 'line 1, the radius: "r" is not a number'),
        ("0.03\n9.0,0.0,0.0\n", r"no cell has its centroid within 30 mm of the port at \(9000"),
    ],
)
def test_wrong_ports_are_refused_by_their_line(tmp_path, ports, said):
    with pytest.raises(InputError, match=said) as error:
        written(tmp_path, ports=ports)()
    assert error.value.file == str(tmp_path / "_pset.csv")


def rtmsim(place, interactive, ports=PORTS):
    path = place / "inputs" / "input.txt"
    path.write_text(INPUT.replace("0 0.01    #i_int", f"{interactive} 0.03    #i_int"))
    (place / "ports.csv").write_text(ports)
    return path, place / "ports.csv"


def test_rtmsim_takes_its_ports_alone_or_beside_its_sets(folder):  # noqa: F811
    path, ports = rtmsim(folder, 1)
    alone = read_rtmsim(path, ports=ports)
    assert [zone.name for zone in alone.zones] == ["port_1", "port_2"]
    assert "1 2 0 0 (patchtype)" in " ".join(alone.told)
    path, ports = rtmsim(folder, 2)
    both = read_rtmsim(path, ports=ports)
    assert [zone.name for zone in both.zones] == ["set1", "set2", "port_1", "port_2"]
    assert len(setup_of(both).gates) == 3
    assert "give them with --ports" in " ".join(read_rtmsim(path).told)
    path, ports = rtmsim(folder, 2, PORTS.replace("0.03", "0.02"))
    assert "r_p = 0.03: the radius of ports.csv counts, 0.02" in read_rtmsim(path, None, ports).told
    path, ports = rtmsim(folder, 0)
    with pytest.raises(InputError, match="has i_interactive = 0"):
        read_rtmsim(path, ports=ports)


def test_rtmsim_widens_a_port_until_it_holds_a_cell(folder):  # noqa: F811
    path, ports = rtmsim(folder, 1, "0.001\n0.0,0.0,0.0\n")
    (zone,) = read_rtmsim(path, ports=ports).zones
    nearest = np.hypot(EDGE, 2 * EDGE) / 3.0
    assert nearest <= float(zone.port.radius) < 1.1 * nearest


def test_the_command_says_where_ports_are(tmp_path):
    written(tmp_path)
    words = ["import", "lcmsim", str(tmp_path / "parts.csv"), "--parameters",
             str(tmp_path / "parameters.csv"), "--mesh", str(tmp_path / "strip.bdf"), "--time",
             "60 s", "--out", str(tmp_path / "case.toml")]  # fmt: skip
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    said = " ".join(answer.output.split())
    assert 'inlet "mouse_1": 30 mm around (150.0, 50.0, 0.0) mm of strip.bdf' in said
    assert len(read_ports(tmp_path / "_pset.csv").points) == 2
