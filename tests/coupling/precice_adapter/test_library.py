"""The example through preCICE itself, where it is installed: two processes over a socket."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

from lcmchain.coupling.iteration import fixed_point, iqn_ils
from lcmchain.coupling.iteration.consolidation import Column, coupled_column
from lcmchain.coupling.precice_adapter.example import END, WINDOW, write_example

COMMAND = [sys.executable, "-P", "-c", "from lcmchain.cli import main; main()"]
#: The adapter is one process and needs no MPI, which the bindings would start.
ENVIRONMENT = {**os.environ, "MPI4PY_RC_INITIALIZE": "0"}


@pytest.fixture(scope="module", autouse=True)
def installed():
    # In a process of its own: where MPI is broken, the import ends it.
    tried = subprocess.run(
        [sys.executable, "-P", "-c", "import precice; precice.Participant"], env=ENVIRONMENT,
        capture_output=True,
    )  # fmt: skip
    if tried.returncode:
        pytest.skip("preCICE and its Python bindings are not installed")


def couple(folder):
    """Run both participants of an example; return the last values of both by side."""
    running = [
        subprocess.Popen(
            [*COMMAND, "precice", f"{name}.toml", "-q", "--out", f"results/{name}"], cwd=folder,
            env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        for name in ("solid", "fluid")
    ]  # fmt: skip
    told = [process.communicate(timeout=120)[0] for process in running]
    assert [process.returncode for process in running] == [0, 0], told
    found = {}
    for side in ("solid", "fluid"):
        last = (folder / f"results/{side}/{side}.csv").read_text().splitlines()[-1]
        time, *values = map(float, last.split(","))
        assert time == pytest.approx(END)
        found[side] = np.array(values)
    return found


def compare(found, system):
    system.advance_to(END)
    for side, field in (("solid", "thickness"), ("fluid", "pore_pressure")):
        expected = system.get_fields([f"{side}.{field}"])[f"{side}.{field}"]
        difference = np.abs(found[side] - expected).max()
        assert difference < 1e-10 * np.abs(expected).max()


def test_the_example_is_the_coupled_system_in_process(tmp_path):
    write_example(tmp_path)
    scheme = fixed_point(1.0)
    compare(
        couple(tmp_path),
        coupled_column(
            Column(), scheme, WINDOW, direction="fixed_stress", relative=1e-12, prediction=0
        ),
    )


def test_quasi_newton_of_precice_finds_what_that_of_the_package_finds(tmp_path):
    """Without the fixed-stress split, with sub-steps of the solid."""
    write_example(tmp_path)
    config = (tmp_path / "precice-config.xml").read_text()
    config = re.sub(r'.*name="(Volume-Rate-Slope|Reference-Pressure)".*\n', "", config)
    config = re.sub(r'.*data="(Volume-Rate-Slope|Reference-Pressure)".*\n', "", config)
    config = config.replace('initial-relaxation value="1.0"', 'initial-relaxation value="0.01"')
    (tmp_path / "precice-config.xml").write_text(config)
    for name in ("solid", "fluid"):
        text = (tmp_path / f"{name}.toml").read_text()
        blocks = re.split(r"(?=^\[\[|^\[|^#)", text, flags=re.MULTILINE)
        kept = [b for b in blocks if "Slope" not in b and "Reference" not in b]
        head = "substeps = 3\n" if name == "solid" else ""
        (tmp_path / f"{name}.toml").write_text(head + "".join(kept))
    scheme = iqn_ils(relaxation=0.01, most_iterations=100)
    compare(
        couple(tmp_path),
        coupled_column(
            Column(), scheme, WINDOW, relative=1e-12, prediction=0, substeps={"solid": 3}
        ),
    )
