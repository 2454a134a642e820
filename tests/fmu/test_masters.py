"""Masters of others run the unit, with the bits of the direct run.

Each runs in a process of its own; a test is skipped where its package is not installed.
"""

import csv
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import pytest
from fmusim import build_fmusim

from lcmchain.fields import derive_fields
from lcmchain.fmu.build import build_fmu
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Simulation

STEP = 1e-4
COUNT = 5

FMPY = """
import fmpy, sys
found = fmpy.simulate_fmu(sys.argv[1], stop_time=5e-4, output_interval=1e-4, validate=False)
print(*[float(found[name][-1]).hex() for name in {names}])
"""
ECOS = """
import sys
from ecospy import EcosSimulation, EcosSimulationStructure
with EcosSimulationStructure() as structure:
    structure.add_model("patch", sys.argv[1])
    with EcosSimulation(structure=structure, step_size=1e-4) as simulation:
        simulation.init()
        simulation.step(5)
        print(*[simulation.get_real("patch::" + name).hex() for name in {names}])
        simulation.terminate()
"""
LIBCOSIM = """
import sys
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
variables = read_model_description(sys.argv[1]).modelVariables
references = {{v.name: v.valueReference for v in variables}}
execution = CosimExecution.from_step_size(100_000)  # [ns]
index = execution.add_local_slave(CosimLocalSlave(fmu_path=sys.argv[1], instance_name="patch"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.step(5)
found = observer.last_real_values(index, [references[name] for name in {names}])
print(*[value.hex() for value in found])
"""
# The block of pathsim-fmi reads all outputs and sets all inputs as real numbers: it is given those
# that are. It steps at the begin of each interval, and the last one that it begins is whole.
PATHSIM = """
import sys
from pathsim import Simulation
from pathsim_fmi import blocks
class Reals(blocks.FMUWrapper):
    def _build_variable_maps(self):
        super()._build_variable_maps()
        for references in (self.input_refs, self.output_refs):
            for name in list(references):
                variable = self.variable_map[name]
                if variable.type not in ("Real", "Float64") or variable.dimensions:
                    del references[name]
blocks.FMUWrapper = Reals
block = blocks.CoSimulationFMU(sys.argv[1], dt=1e-4)
Simulation([block], [], dt=1e-4, log=False).run(3.5e-4)
print(*[float(block.outputs[name]).hex() for name in {names}])
"""
NAMES = ("punch.travel", "thickness_min", "internal_energy")


IDS = ["FMI 2.0", "FMI 3.0"]


@pytest.fixture(scope="module", params=[2, 3], ids=IDS)
def version(request):
    return request.param


def mostly(fmi):
    """Try a master with units of this version; the slow run tries it with those of the other too.

    What a unit does is the same in both (test_interface.py): a master takes a process of its own.
    """
    slow = [[pytest.mark.slow] * (version != fmi) for version in (2, 3)]
    versions = [pytest.param(v, marks=marks) for v, marks in zip((2, 3), slow, strict=True)]
    return pytest.mark.parametrize("version", versions, indirect=True, ids=IDS, scope="module")


@pytest.fixture(scope="module")
def built(version, patch_file, tmp_path_factory):
    return build_fmu(patch_file, tmp_path_factory.mktemp("built") / "patch.fmu", fmi=version)


@pytest.fixture(scope="module")
def expected(patch_file):
    """Outputs of the direct run at the same communication points, as texts of all bits."""
    simulation = Simulation.from_scene(read_scene(patch_file))
    for point in range(COUNT):
        simulation.advance_to(point * STEP + STEP)
    model, snapshot = simulation.model, simulation.snapshot()
    thickness = derive_fields(
        model.only_body().mesh, model.only_body().material, snapshot.position
    )["thickness"]
    values = snapshot.tool_travel[0], thickness.min(), snapshot.energy["internal"]
    return " ".join(float(value).hex() for value in values)


def run_master(arguments, folder, libraries=""):
    paths = [str(libraries), os.environ.get("LD_LIBRARY_PATH", "")]
    done = subprocess.run(
        [str(argument) for argument in arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "LD_LIBRARY_PATH": ":".join(filter(None, paths))},
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done


def bits_of(program, unit, folder, names=NAMES, libraries=""):
    arguments = [sys.executable, "-P", "-c", program.format(names=names), unit]
    found = run_master(arguments, folder, libraries).stdout.splitlines()
    return [line for line in found if line.startswith(("0x", "-0x"))][-1]


def test_fmpy(built, expected, tmp_path):
    assert bits_of(FMPY, built, tmp_path) == expected


@mostly(3)
def test_fmpy_on_the_command_line(built, tmp_path):
    table = tmp_path / "out.csv"
    arguments = ["-m", "fmpy", "simulate", built, "--stop-time", "5e-4"]
    run_master([sys.executable, *arguments, "--output-file", table], tmp_path)
    assert len(table.read_text().splitlines()) > 2
    checked = run_master([sys.executable, "-P", "-m", "fmpy", "validate", built], tmp_path)
    assert "problem" not in checked.stdout.lower() or "no problems" in checked.stdout.lower()


@mostly(3)
def test_ecos(built, expected, tmp_path):
    if find_spec("ecospy") is None:
        pytest.skip("needs the package ecospy")
    places = [Path(sysconfig.get_config_var("LIBDIR") or ""), Path(sys.prefix, "lib")]
    places += [Path(folder) for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":")]
    libraries = next((p for p in places if (p / "libtbb.so.12").is_file()), None)
    if libraries is None:
        pytest.skip("needs libtbb.so.12 (package tbb) for ecospy")
    found = bits_of(ECOS, built, tmp_path, libraries=libraries)
    assert found == expected


def test_libcosim(version, built, expected, tmp_path):
    if find_spec("libcosimpy") is None:
        pytest.skip("needs the package libcosimpy")
    if version == 3:
        pytest.skip("libcosim knows FMI 1.0 and 2.0")
    assert bits_of(LIBCOSIM, built, tmp_path) == expected


@mostly(2)
def test_pathsim(built, expected, tmp_path):
    if find_spec("pathsim_fmi") is None:
        pytest.skip("needs the package pathsim-fmi")
    assert bits_of(PATHSIM, built, tmp_path) == expected


@mostly(2)
def test_fmutool_finds_no_fault(built, tmp_path):
    if find_spec("fmu_manipulation_toolbox") is None:
        pytest.skip("needs the package fmu-manipulation-toolbox")
    program = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    done = run_master([sys.executable, "-P", "-c", program, "-input", built, "-check"], tmp_path)
    told = done.stdout + done.stderr
    assert "seems to be compliant" in told and "No semantic error" in told
    assert "ERROR" not in told


@mostly(3)
def test_fmucontainer(built, expected, tmp_path):
    if find_spec("fmu_manipulation_toolbox") is None:
        pytest.skip("needs the package fmu-manipulation-toolbox")
    shutil.copy(built, tmp_path / "patch.fmu")
    outputs = [["patch.fmu", name, name.replace(".", "_")] for name in NAMES]
    container = {"name": "box.fmu", "fmu": ["patch.fmu"], "step_size": STEP, "output": outputs}
    (tmp_path / "box.json").write_text(json.dumps(container), encoding="utf-8")
    program = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    arguments = ["-fmu-directory", tmp_path, "-container", "box.json"]
    run_master([sys.executable, "-P", "-c", program, *arguments], tmp_path)
    names = tuple(name.replace(".", "_") for name in NAMES)
    assert bits_of(FMPY, tmp_path / "box.fmu", tmp_path, names=names) == expected


# --- fmusim, which is no Python -------------------------------------------------------------------


@pytest.fixture(scope="module")
def fmusim(tmp_path_factory):
    library = Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME"))
    if sys.prefix == sys.base_prefix or library.suffix == ".a" or not library.is_file():
        pytest.skip("needs a virtual environment and the shared library of its Python")
    program = build_fmusim(tmp_path_factory.mktemp("fmusim"))
    return ["env", f"LD_PRELOAD={library}", f"VIRTUAL_ENV={sys.prefix}", program]


def test_fmusim(fmusim, built, expected, tmp_path):
    """It validates the model description by the schema of the standard, and writes 16 digits."""
    names = [part for name in NAMES for part in ("--output-variable", name)]
    times = ["--stop-time", "5e-4", "--output-interval", STEP]
    run_master([*fmusim, *times, *names, "--output-file", tmp_path / "out.csv", built], tmp_path)
    with open(tmp_path / "out.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == COUNT + 1 and float(rows[-1]["time"]) == 5e-4
    found = [rows[-1][name] for name in NAMES]
    assert found == [f"{float.fromhex(text):.16g}" for text in expected.split()]
