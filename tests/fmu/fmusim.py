"""Builds fmusim, the simulator of the Modelica Association's Reference-FMUs, from its source.

The source is not part of this repository. ``FMUSIM_SOURCE`` names a checkout of
github.com/modelica/Reference-FMUs at v0.0.39, the last version with fmusim (2-clause BSD licence)::

    git clone --branch v0.0.39 https://github.com/modelica/Reference-FMUs
    FMUSIM_SOURCE=Reference-FMUs pytest tests/fmu/test_masters.py -k fmusim

Of the libraries that it is built with, libxml2 reads and validates the model description. Python
unpacks the archive in place of minizip, and CVODE is left out (``fmusim_parts.c``).
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

#: Files of fmusim that call minizip and CVODE, and one that is no part of the program.
LEFT_OUT = ("miniunzip.c", "FMICVode.c", "FMIBuildDescription.c")
#: What stands in for them.
OWN = Path(__file__).with_name("fmusim_parts.c")
#: Folders in which systems have the headers of libxml2.
HEADERS = ("/usr/include/libxml2", "/usr/local/include/libxml2")


def build_fmusim(folder):
    """Return the program, built in a folder; skips the test where it cannot be built."""
    if not sys.platform.startswith("linux") or shutil.which("gcc") is None:
        pytest.skip("needs Linux and gcc")
    source = Path(os.environ.get("FMUSIM_SOURCE", "none")).resolve()
    if not (source / "fmusim" / "fmusim.c").is_file():
        pytest.skip("needs FMUSIM_SOURCE, a checkout of Reference-FMUs v0.0.39")
    headers = next((p for p in map(Path, HEADERS) if (p / "libxml/parser.h").is_file()), None)
    if headers is None:
        pytest.skip("needs the headers of libxml2 (package libxml2-dev)")
    shared = ("FMI", "FMI1", "FMI2", "FMI3", "structured_variable_name.yy")
    files = [source / "src" / f"{name}.c" for name in (*shared, "structured_variable_name.tab")]
    own = sorted((source / "fmusim").glob("*.c"))
    files += [file for file in own if file.name not in LEFT_OUT]
    program = folder / "fmusim"
    command = ["gcc", "-w", "-O1", "-o", program, OWN, *files, f'-DPYTHON="{sys.executable}"']
    command += [f"-I{place}" for place in (source / "fmusim", source / "include", headers)]
    command += ["-lxml2", "-ldl", "-lm"]
    subprocess.run([str(part) for part in command], check=True)
    return program
