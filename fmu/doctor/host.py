"""The program that is to import a unit: whether it brings Python, and how to start it."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Collection
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.fmu.doctor.binary import link, read_installed
from lcmchain.fmu.doctor.findings import Diagnosis, Level
from lcmchain.fmu.doctor.python import Interpreter


def find_host(name: str) -> Path:
    """Return the file of a program.

    Raises
    ------
    InputError : there is none of that name.
    """
    path = shutil.which(name)
    if path is None:
        raise InputError(f'there is no program "{name}"; name its file', key="--host")
    return Path(path)


def python_of(host: Path) -> Path | None:
    """Return the Python that a host is or is written for; None for a program that is none."""
    if re.fullmatch(r"python[\d.]*(\.exe)?", host.name):
        return host
    with host.open("rb") as stream:
        head = stream.readline(500)
        then = stream.readline(500)
    if not head.startswith(b"#!"):
        return None
    words = head[2:].decode(errors="replace").split()
    if words and Path(words[0]).name == "env":
        words = [word for word in words[1:] if not word.startswith("-") and "=" not in word]
    if words and words[0] == "/bin/sh" and then.startswith(b"'''exec' "):  # a long path, by pip
        words = then.decode(errors="replace").split()[1:]
    program = shutil.which(words[0].strip('"')) if words else None
    if program is None or not Path(program).name.startswith("python"):
        return None
    return Path(program)


def examine_host(
    diagnosis: Diagnosis, host: Path, python: Interpreter, symbols: Collection[str]
) -> None:
    """Find whether a host that is no Python offers the symbols that a unit takes from it."""
    file = read_installed(host)
    if file is None:
        diagnosis.add(
            Level.WARNING, "host",
            f"{host} is neither a Python nor a program that can be looked at; if it is no "
            f"Python, start it as: {python.start} {host.name} ...",
        )  # fmt: skip
        return
    linkage = link(file)
    offered = frozenset().union(file.defined, *(lib.defined for lib in linkage.found.values()))
    brought = [name for name in linkage.found if name.startswith("libpython")]
    diagnosis.facts["host"] = str(host)
    if set(symbols) <= offered:
        versions = {".".join(re.findall(r"\d+", name)[:2]) for name in brought}
        if versions and python.minor not in versions:
            diagnosis.add(
                Level.MISSING, "host",
                f"{host.name} brings Python {', '.join(sorted(versions))}, the environment is one "
                f"of Python {python.minor}",
                f"install what the unit needs for Python {', '.join(sorted(versions))}",
            )  # fmt: skip
        else:
            diagnosis.add(Level.OK, "host", f"{host.name} brings Python ({', '.join(brought)})")
        return
    if python.library is None:
        return  # told already
    preloaded = _preloaded()
    told = f"{python.start} {host.name} ..."
    if not preloaded:
        diagnosis.add(
            Level.MISSING, "host",
            f"{host.name} brings no Python, and LD_PRELOAD names none: loading the unit fails, in "
            "some hosts with a segmentation fault",
            f"start it as: {told}",
        )  # fmt: skip
    elif not any(name.resolve() == python.library.resolve() for name in preloaded):
        diagnosis.add(
            Level.MISSING, "host",
            f"LD_PRELOAD names {preloaded[0]}, the library of the environment is {python.library}",
            f"start it as: {told}",
        )  # fmt: skip
    elif not _first_in_path(python):
        diagnosis.add(
            Level.MISSING, "host",
            "the first python3 in PATH is not that of the environment: a host that is no Python "
            "would start in the wrong one",
            f"start it as: {told}",
        )  # fmt: skip
    else:
        diagnosis.add(Level.OK, "host", f"{host.name} gets Python from {preloaded[0]} (LD_PRELOAD)")


def _preloaded() -> list[Path]:
    """Return the libraries of Python in LD_PRELOAD."""
    named = re.split(r"[:\s]+", os.environ.get("LD_PRELOAD", ""))
    return [Path(name) for name in named if re.search(r"libpython3\.\d", name)]


def _first_in_path(python: Interpreter) -> bool:
    first = shutil.which("python3")
    return first is not None and Path(first).parent == python.executable.parent
