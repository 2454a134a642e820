"""Small units in C, compiled once per session for FMI 2.0 and 3.0."""

import itertools
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import models
from unit_builder import build


@pytest.fixture(scope="session")
def units(tmp_path_factory) -> Path:
    """A folder with the archives Mass_2.fmu, Mass_3.fmu, Tail_2.fmu ..."""
    if shutil.which("gcc") is None or sys.platform != "linux":
        pytest.skip("needs gcc, on Linux")
    folder = tmp_path_factory.mktemp("units")
    for model in models.ALL:
        for version in (2, 3):
            build(model, version, folder)
    build(models.ONE_WAY, 2, folder)
    build(models.SPACE, 3, folder)
    return folder


@pytest.fixture
def assembled_in(tmp_path):
    """Assemble a system from a folder and the tables of its file; closed after the test."""
    from lcmchain.coupling.cosimulation.assembly import assemble
    from lcmchain.coupling.cosimulation.system_file import system_from

    made, numbers = [], itertools.count()

    def make(directory, data, log=None):
        folder = tmp_path / f"unpacked_{next(numbers)}"
        system = system_from(data, None, directory=directory)
        made.append(assemble(system, folder, log or (lambda text: None)))
        return made[-1]

    yield make
    for assembly in made:
        assembly.close()


@pytest.fixture
def assembled(units, assembled_in):
    """Assemble a system of the small units."""
    return lambda data, log=None: assembled_in(units, data, log)


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch):
    """Units run in the process of the tests, which is quicker, unless a system says otherwise."""
    from lcmchain.coupling.cosimulation import assembly

    monkeypatch.setattr(assembly, "OWN_TOOL", "")
