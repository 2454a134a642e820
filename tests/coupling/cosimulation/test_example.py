"""The press of the example against a spring, and the file of its system."""

import importlib.util
import sys
from pathlib import Path

import pytest
from pythonfmu import FmuBuilder
from unit_builder import Model, Var, build

from lcmchain.coupling.cosimulation.system_file import read_system

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "cosimulation"

pytestmark = pytest.mark.skipif(
    not EXAMPLE.is_dir(), reason="needs the checkout, not only the tests"
)

#: What is pressed: a spring of 2 N/mm.
SPRING = Model(
    "Spring",
    [
        Var("velocity", "input", start=0.0, unit="m/s"),
        Var("drive", "input", "truth", False),
        Var("force", unit="N"),
        Var("travel", unit="m"),
    ],
    advance="if (drive) travel += h * velocity; force = -2000.0 * travel; return 0;",
)


def test_the_press_keeps_its_limit(assembled_in, tmp_path):
    build(SPRING, 3, tmp_path)
    path = list(sys.path)
    FmuBuilder.build_FMU(EXAMPLE / "press.py", dest=tmp_path, needsExecutionTool="false",
                         canGetAndSetFMUstate="true", canSerializeFMUstate="true")  # fmt: skip
    sys.path[:] = path
    sys.modules.pop("press", None)
    example = read_system(EXAMPLE / "system.toml")
    press = example.units[0].model_dump(exclude={"substeps", "debug"})
    data = {
        "stop_time": "100 ms", "window": "100 us", "scheme": {"type": example.scheme.type},
        "units": [press, {"name": "spring", "fmu": "Spring_3.fmu"}],
        "connections": [
            "spring.force -> press.part_force", "press.velocity -> spring.velocity",
            "press.drive -> spring.drive",
        ],
    }  # fmt: skip
    assembly = assembled_in(tmp_path, data)
    assert assembly.remarks == []
    forces = []
    assembly.coupled.advance_to(
        0.1,
        lambda system: forces.append(-system.get_fields(["spring.force"])["spring.force"][0]),
    )
    # 4 N: the force comes to the limit and stays there
    assert max(forces) < 1.05 * 4.0
    assert forces[-1] == pytest.approx(4.0, rel=1e-3)


def test_the_cost_of_processes_is_measured_on_equal_bits(tmp_path):
    """The script itself compares what units in processes and in that of the master end with."""
    place = EXAMPLE / "process_cost.py"
    spec = importlib.util.spec_from_file_location("process_cost", place)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    path = list(sys.path)
    found = script.measure(tmp_path, steps=5, runs=1)
    ends = script.run_once(tmp_path, ("own", "shared"), 5)[1]
    sys.path[:] = path
    sys.modules.pop("press", None)
    assert set(found) == set(script.ARRANGEMENTS) and min(found.values()) > 0.0
    assert min(ends) > 0.1, "the presses have moved"
