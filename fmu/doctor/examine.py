"""The examination of a unit, from its description to the Python that runs it."""

from __future__ import annotations

import json
import platform
import re
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path

from lcmchain import __version__
from lcmchain.coupling.cosimulation.archive import unpack
from lcmchain.errors import LcmchainError
from lcmchain.fmu.description import TOOL
from lcmchain.fmu.doctor.binary import examine_binary, needs_python
from lcmchain.fmu.doctor.description import Description, findings_of, read_description
from lcmchain.fmu.doctor.findings import Diagnosis, Level
from lcmchain.fmu.doctor.host import examine_host, find_host, python_of
from lcmchain.fmu.doctor.profiles import profiles_for
from lcmchain.fmu.doctor.python import examine_library, examine_python, python_content
from lcmchain.fmu.instances import UNIT_FILE, define, require_own_description

# What a unit says it needs from outside: FMI 2.0.2 (2.2.1), FMI 3.0 (2.5.1).
_EXTERNAL = ("externalDependencies.txt", "externalDependencies.html")
_LONGEST_TEXT = 300


def examine(
    unit: Path | str, *, python: Path | str | None = None, host: str | None = None
) -> Diagnosis:
    """Tell what a unit needs on this machine and what of it is missing; nothing of it is run.

    Parameters
    ----------
    unit : the unit, ``*.fmu``, by lcmchain or another tool.
    python : interpreter that is to run a unit written in Python; by default that of the host if it
        is one, else the one that runs this function.
    host : program that is to import the unit, by name or path.

    Raises
    ------
    InputError : the file is no unit, or there is no such Python or host.
    """
    unit = Path(unit)
    diagnosis = Diagnosis(unit=str(unit))
    the_host = None if host is None else find_host(host)
    of_host = None if the_host is None else python_of(the_host)
    with tempfile.TemporaryDirectory(prefix="lcmchain-doctor-") as name:
        folder = unpack(unit, Path(name, "unit"))
        description = read_description(folder, unit)
        diagnosis.facts |= {
            "fmi_version": description.fmi_version,
            "kinds": list(description.kinds),
            "model_name": description.model_name,
            "generation_tool": description.generation_tool,
            "features": list(description.features),
            "profiles": list(profiles_for(description.features)),
        }
        content = python_content(folder / "resources")
        diagnosis.extend(findings_of(description, is_python=content is not None))
        binary = examine_binary(diagnosis, folder, description.identifier, description.fmi_version)
        symbols = frozenset() if binary is None else needs_python(binary)
        _examine_own(diagnosis, description, folder / "resources")
        _examine_command(diagnosis, folder / "resources")
        _tell_dependencies(diagnosis, folder / "documentation")
    if content is None and not symbols:
        if the_host is not None:
            diagnosis.add(Level.OK, "host", f"the unit asks nothing of {the_host.name}")
        return diagnosis
    interpreter = examine_python(diagnosis, content, python or of_host or sys.executable)
    if platform.system() == "Linux" and symbols:
        is_python = the_host is None or of_host is not None
        examine_library(diagnosis, interpreter, symbols, is_wanted=not is_python)
        if the_host is not None and of_host is None:
            examine_host(diagnosis, the_host, interpreter, symbols)
    return diagnosis


def _examine_own(diagnosis: Diagnosis, description: Description, resources: Path) -> None:
    """Read what the unit would read at its start, if this lcmchain has built it."""
    if description.generation_tool != TOOL:
        return
    try:
        unit = json.loads((resources / UNIT_FILE).read_text(encoding="utf-8"))
        if unit["lcmchain_version"] != __version__:
            return
        definition, _ = define(unit, resources)
        if definition.guid != unit["guid"]:
            raise ValueError("its variables are not those of its identifier")
        require_own_description(resources.parent / "modelDescription.xml", definition)
    except (LcmchainError, OSError, ValueError, KeyError, TypeError) as error:
        diagnosis.add(
            Level.MISSING, "resources", f"they are missing or damaged ({error})",
            "build the unit again",
        )  # fmt: skip


def _examine_command(diagnosis: Diagnosis, resources: Path) -> None:
    """Look for the program that a unit of UniFMU starts (``launch.toml``)."""
    path = resources / "launch.toml"
    if not path.is_file():
        return
    system = {"Windows": "windows", "Darwin": "macos"}.get(platform.system(), "linux")
    try:
        with path.open("rb") as stream:
            launch = tomllib.load(stream)
        table = "command" if "command" in launch else launch["backend"]
        command = launch[table][system]
        program = str(command[0])
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, KeyError, IndexError, TypeError):
        diagnosis.add(
            Level.WARNING, "command",
            f"its launch.toml names no command for {system}, which its binary would start",
        )  # fmt: skip
        return
    path_of_program = shutil.which(program)
    words = " ".join(str(word) for word in command)
    if path_of_program is None:
        diagnosis.add(
            Level.MISSING, "command", f'it starts "{words}", and there is no {program} here',
            f"install {program}, or put its folder into PATH",
        )  # fmt: skip
    else:
        diagnosis.add(Level.OK, "command", f'it starts "{words}" with {path_of_program}')


def _tell_dependencies(diagnosis: Diagnosis, documentation: Path) -> None:
    for name in _EXTERNAL:
        path = documentation / name
        if path.is_file():
            text = path.read_text(encoding="utf-8", errors="replace")
            if name.endswith(".html"):
                text = re.sub(r"<(style|script|head)\b.*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
            text = " ".join(text.split())
            diagnosis.facts["external_dependencies"] = text
            told = text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]} ..."
            diagnosis.add(Level.NOTE, "dependencies", f"the unit says: {told}")
            return
