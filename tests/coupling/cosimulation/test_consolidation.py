"""Terzaghi's consolidation as two units that exchange whole fields, by pythonfmu."""

import sys
from pathlib import Path

import numpy as np
import pytest
from pythonfmu import FmuBuilder

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.coupling.iteration import aitken, iqn_ils
from lcmchain.coupling.iteration.consolidation import (
    Column,
    coupled_column,
    degree_of_consolidation,
    settlement_share,
)
from lcmchain.errors import SimulationError

HERE = Path(__file__).parent / "units"
COLUMN = Column(cell_count=40)
END, WINDOWS = 0.5 * COLUMN.time_scale, 50


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    """The archives SolidUnit.fmu and FluidUnit.fmu."""
    folder, path = tmp_path_factory.mktemp("columns"), list(sys.path)
    for name in ("solid_unit", "fluid_unit"):
        FmuBuilder.build_FMU(
            HERE / f"{name}.py", dest=folder, project_files=[HERE / "column_slave.py"],
            canGetAndSetFMUstate="true", canSerializeFMUstate="true", needsExecutionTool="false",
        )  # fmt: skip
    sys.path[:] = path
    for name in ("solid_unit", "fluid_unit", "column_slave"):
        sys.modules.pop(name, None)
    return folder


def tables(scheme, windows=WINDOWS, **options):
    return {
        "stop_time": f"{END!r} s", "window": f"{END / windows!r} s",
        "units": [{"name": "solid", "fmu": "SolidUnit.fmu"},
                  {"name": "fluid", "fmu": "FluidUnit.fmu"}],
        "connections": [
            {"link": "solid.volume_rate -> fluid.volume_rate", "of_window": "mean",
             "within": "held"},
            "fluid.pore_pressure -> solid.pore_pressure",
        ],
        "scheme": {"type": scheme, **options},
    }  # fmt: skip


@pytest.mark.parametrize("name, scheme", [("iqn-ils", iqn_ils), ("aitken", aitken)])
def test_units_consolidate_as_the_in_process_pair_and_as_terzaghi(
    columns, assembled_in, name, scheme
):
    assembly = assembled_in(columns, tables(name, relative=1e-8, most_iterations=200))
    assembly.coupled.advance_to(END)
    peer = coupled_column(COLUMN, scheme(most_iterations=200), END / WINDOWS, relative=1e-8)
    peer.advance_to(END)
    for field in ("solid.thickness", "fluid.pore_pressure"):
        ours, theirs = (system.get_fields([field])[field] for system in (assembly.coupled, peer))
        assert np.ptp(theirs) > 0.0
        assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()
    share = settlement_share(assembly.coupled, COLUMN)
    assert share == pytest.approx(degree_of_consolidation(0.5), rel=0.01)


def test_the_error_falls_with_the_windows(columns, assembled_in):
    """Implicit in time: order one."""
    errors = []
    for windows in (25, 50, 100):
        assembly = assembled_in(columns, tables("iqn-ils", windows, relative=1e-9))
        assembly.coupled.advance_to(END)
        exact = degree_of_consolidation(0.5)
        errors.append(abs(settlement_share(assembly.coupled, COLUMN) - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 1.0) < 0.2), (orders, errors)


def test_staggered_coupling_diverges_and_the_advice_helps(columns, tmp_path):
    system = system_from(tables("gauss-seidel"), None, directory=columns)
    with pytest.raises(SimulationError) as caught:
        run_system(system, tmp_path / "explicit")
    message = str(caught.value)
    assert "the explicit coupling (Gauss-Seidel) diverges" in message
    assert 'scheme.type = "iqn-ils"' in message and "incompressible fluid" in message
    advised = system_from(tables("iqn-ils"), None, directory=columns)
    summary = run_system(advised, tmp_path / "implicit")
    assert summary["state"] == "complete"
    assert summary["units"]["solid"]["rollback_count"] > 0
