"""The unit in a program that is no Python, which must be given the library of Python."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from lcmchain.fmu.doctor import Level, examine

STEP = 5e-4


def python_library() -> Path:
    """The shared library of this Python, as the manual names it (fmu)."""
    return Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME"))


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    if not sys.platform.startswith("linux") or shutil.which("gcc") is None:
        pytest.skip("needs Linux and gcc")
    program = tmp_path_factory.mktemp("host") / "host"
    source = Path(__file__).with_name("host.c")
    subprocess.run(["gcc", "-o", str(program), str(source), "-ldl"], check=True)
    return program


def run_host(host, unpacked, **environment):
    folder, description = Path(unpacked[0]), unpacked[1]
    travel = next(v for v in description.modelVariables if v.name == "punch.travel")
    binary = folder / "binaries/linux64" / f"{description.coSimulation.modelIdentifier}.so"
    arguments = [host, binary, (folder / "resources").as_uri(), travel.valueReference, STEP]
    return subprocess.run(
        [str(argument) for argument in arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )


def test_host_with_the_library_of_python_forms_the_part(host, unpacked):
    library = python_library()
    if sys.prefix == sys.base_prefix or library.suffix == ".a" or not library.is_file():
        pytest.skip("needs a virtual environment and the shared library of its Python")
    done = run_host(host, unpacked, LD_PRELOAD=str(library), VIRTUAL_ENV=sys.prefix)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(3 * STEP * 1.0, rel=1e-12)


def test_host_without_it_is_told_that_a_symbol_of_python_is_missing(host, unpacked):
    done = run_host(host, unpacked, LD_PRELOAD="")
    assert done.returncode == 65
    assert "undefined symbol" in done.stderr


def test_doctor_tells_the_host_what_it_lacks_and_how_to_start_it(host, unit, unpacked, monkeypatch):
    if sys.prefix == sys.base_prefix or not python_library().is_file():
        pytest.skip("needs a virtual environment and the shared library of its Python")
    monkeypatch.setenv("LD_PRELOAD", "")
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    (missing,) = (f for f in examine(unit, host=str(host)).findings if f.level is Level.MISSING)
    assert "brings no Python" in missing.text
    start = missing.remedy.removeprefix("start it as: ").removesuffix(" host ...")
    preload, path = re.fullmatch(r"LD_PRELOAD=(\S+) PATH=(\S+):\$PATH", start).groups()
    # started as told, without an activated environment, it runs
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    path = f"{path}:/usr/bin:/bin"
    done = run_host(host, unpacked, LD_PRELOAD=preload, PATH=path)
    assert done.returncode == 0, done.stderr
    # and the doctor agrees; with another python3 in front it does not
    monkeypatch.setenv("LD_PRELOAD", preload)
    assert not examine(unit, host=str(host)).runs
    monkeypatch.setenv("PATH", path)
    diagnosis = examine(unit, host=str(host))
    assert diagnosis.runs, diagnosis.findings
    assert any("gets Python from" in finding.text for finding in diagnosis.findings)
