"""The binary of a unit for this platform, and whether the dynamic linker can load it here."""

from __future__ import annotations

import platform
import re
import sys
from pathlib import Path

from lcmchain.fmu.doctor.findings import Diagnosis, Level
from lcmchain.fmu.doctor.libraries import SharedObject, link, newest_versions, read_shared_object

# Names of this machine in FMI 2.0 (2.1.3) and in FMI 3.0 (2.5.1).
_SYSTEMS = {"Linux": ("linux", "linux"), "Windows": ("win", "windows"), "Darwin": ("darwin",) * 2}
_PROCESSORS = {"x86_64": "x86_64", "AMD64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
_SUFFIX = {"linux": ".so", "win": ".dll", "darwin": ".dylib"}
_PYTHON_SYMBOL = re.compile(r"_?Py[A-Z_]")


def platform_folders() -> tuple[str, ...]:
    """Return the folders in which FMI 2 and FMI 3 look for the binary of this machine."""
    system2, system3 = _SYSTEMS.get(platform.system(), (sys.platform, sys.platform))
    processor = _PROCESSORS.get(platform.machine(), platform.machine())
    bits = 64 if sys.maxsize > 2**32 else 32
    return f"{system2}{bits}", f"{processor}-{system3}"


def examine_binary(diagnosis: Diagnosis, folder: Path, identifier: str, fmi: str) -> Path | None:
    """Find the binary of this platform in an unpacked unit and look at its libraries.

    Returns
    -------
    The binary, None where there is none for this platform.
    """
    binaries = folder / "binaries"
    there = sorted(p.name for p in binaries.iterdir() if p.is_dir()) if binaries.is_dir() else []
    diagnosis.facts["platforms"] = there
    old, new = platform_folders()
    wanted = new if fmi.startswith("3") else old
    suffix = next((s for name, s in _SUFFIX.items() if old.startswith(name)), ".so")
    path = binaries / wanted / f"{identifier}{suffix}"
    if path.is_file():
        offers = f"for {', '.join(there)}; {path.relative_to(folder)} is that of this machine"
        diagnosis.add(Level.OK, "binary", offers)
        _examine_libraries(diagnosis, path)
        return path
    have = f"only {', '.join(there)}" if there else "none at all"
    if (folder / "sources").is_dir():
        remedy = "the unit holds sources: compile it with `fmpy compile`"
    else:
        remedy = f"ask who made the unit for one that holds {wanted}"
    diagnosis.add(
        Level.MISSING, "binary", f"there is no {path.relative_to(folder)}, but {have}", remedy
    )
    return None


def needs_python(path: Path) -> frozenset[str]:
    """Return the symbols of Python that a binary expects its host to have."""
    file = read_shared_object(path)
    if file is None or any(name.startswith("libpython") for name in file.needed):
        return frozenset()
    return frozenset(name for name in file.undefined if _PYTHON_SYMBOL.match(name))


def _examine_libraries(diagnosis: Diagnosis, path: Path) -> None:
    if path.suffix != ".so":
        diagnosis.add(Level.NOTE, "libraries", "they can be looked at on Linux only")
        return
    file = read_shared_object(path)
    if file is None:
        diagnosis.add(
            Level.MISSING, "binary", f"{path.name} is no shared library (ELF), or it is damaged",
            "unpack or fetch the unit again",
        )  # fmt: skip
        return
    own = read_shared_object(Path(sys.executable).resolve())
    if own is not None and own.machine != file.machine:
        diagnosis.add(
            Level.MISSING, "binary",
            f"{path.name} is for {_machine(file)}, this Python for {_machine(own)}",
            "ask who made the unit for one of this processor",
        )  # fmt: skip
        return
    linkage = link(file)
    versions = newest_versions(file)
    diagnosis.facts["libraries"] = {
        name: None if name in linkage.absent else str(linkage.found[name].path)
        for name in (*linkage.found, *linkage.absent)
    }
    diagnosis.facts["interface_versions"] = versions
    for name, by in linkage.absent.items():
        diagnosis.add(
            Level.MISSING, "libraries", f"{name}, which {by} needs, is not on this machine",
            "install the package that brings it, or name its folder in LD_LIBRARY_PATH",
        )  # fmt: skip
    for name, lacking, newest in linkage.old:
        diagnosis.add(
            Level.MISSING, "libraries",
            f"the unit asks for {', '.join(lacking)} of {name}; here it goes up to {newest}",
            "use a newer system, or a unit that was built on an older one",
        )  # fmt: skip
    unknown = sorted(name for name in linkage.unresolved if not _PYTHON_SYMBOL.match(name))
    if unknown and not linkage.absent:
        few = ", ".join(unknown[:3]) + (", ..." if len(unknown) > 3 else "")
        diagnosis.add(
            Level.WARNING, "libraries",
            f"{len(unknown)} symbols are in none of its libraries ({few}); the host must have them",
        )  # fmt: skip
    if not linkage.absent and not linkage.old:
        asked = ", ".join(f"{name} {version}" for name, version in sorted(versions.items()))
        libc = " ".join(platform.libc_ver()).strip()
        diagnosis.add(
            Level.OK, "libraries",
            f"{', '.join(linkage.found) or 'it needs none'}"
            + (f"; asks for {asked}; this machine has {libc}" if asked else ""),
        )  # fmt: skip


def _machine(file: SharedObject) -> str:
    return f"{file.machine[0]} ({file.machine[1]} bits)"
