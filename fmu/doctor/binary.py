"""The binary of a unit for this platform, and whether the dynamic linker can load it here.

Shared libraries are read, not loaded: what a file needs, where the linker finds it, what it misses.
"""

from __future__ import annotations

import functools
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from lcmchain.fmu.doctor.findings import Diagnosis, Level

# --- shared libraries: what a file needs, and where the linker finds it ---------------------------


_STANDARD = ("/lib64", "/usr/lib64", "/lib", "/usr/lib")


@dataclass(frozen=True)
class Linkage:
    """A file and the libraries that it needs, directly or through others.

    Parameters
    ----------
    found : libraries by name, in the order in which they are needed.
    absent : name of every library that is nowhere, and the file that needs it.
    old : library, versions of its interface that are asked for, and the newest one that it has.
    unresolved : symbols that no library defines.
    """

    file: SharedObject
    found: dict[str, SharedObject]
    absent: dict[str, str]
    old: tuple[tuple[str, tuple[str, ...], str], ...]
    unresolved: frozenset[str]


def link(file: SharedObject) -> Linkage:
    """Find what a file needs, as the dynamic linker does; nothing is loaded."""
    libraries: dict[str, SharedObject] = {}
    absent: dict[str, str] = {}
    waiting = [(name, file) for name in file.needed]
    while waiting:
        name, by = waiting.pop(0)
        if name in libraries or name in absent:
            continue
        library = _find(name, by, file)
        if library is None:
            absent[name] = by.path.name
            continue
        libraries[name] = library
        waiting += [(other, library) for other in library.needed]
    offered = frozenset().union(file.defined, *(library.defined for library in libraries.values()))
    return Linkage(file, libraries, absent, tuple(_old(file, libraries)), file.undefined - offered)


def _old(
    file: SharedObject, libraries: dict[str, SharedObject]
) -> Iterator[tuple[str, tuple[str, ...], str]]:
    for name, versions in file.needed_versions.items():
        library = libraries.get(name)
        if library is None or not library.versions:
            continue  # it is absent, or does not number its interface
        lacking = tuple(sorted(set(versions) - library.versions, key=version_key))
        if lacking:
            family = lacking[-1].partition("_")[0]
            offered = [
                v for v in library.versions if v.startswith(f"{family}_") and v[-1].isdigit()
            ]
            yield name, lacking, max(offered, key=version_key, default="none")


def version_key(version: str) -> tuple[int, ...]:
    """Return the numbers of a version such as ``GLIBC_2.34``, to compare by."""
    return tuple(int(number) for number in re.findall(r"\d+", version))


def newest_versions(file: SharedObject) -> dict[str, str]:
    """Return the newest version that a file asks for, by the name of the interface (GLIBC, ...)."""
    newest: dict[str, str] = {}
    for versions in file.needed_versions.values():
        for version in versions:
            family = version.rpartition("_")[0]
            if version[-1].isdigit() and (
                family not in newest or version_key(version) > version_key(newest[family])
            ):
                newest[family] = version
    return {family: version.rpartition("_")[2] for family, version in newest.items()}


def _find(name: str, by: SharedObject, first: SharedObject) -> SharedObject | None:
    if "/" in name:
        candidates = [Path(name)]
    else:
        named = (*by.search_path, *os.environ.get("LD_LIBRARY_PATH", "").split(":"))
        folders = [folder for folder in named if folder]
        candidates = [Path(folder, name) for folder in folders]
        candidates += _cached().get(name, [])
        candidates += [Path(folder, name) for folder in _STANDARD]
    for candidate in candidates:
        if candidate.is_file():
            library = read_installed(candidate)
            if library is not None and library.machine == first.machine:
                return library
    return None


@functools.cache
def _cached() -> dict[str, list[Path]]:
    """Return the libraries of the linker's cache by name."""
    for program in ("ldconfig", "/sbin/ldconfig", "/usr/sbin/ldconfig"):
        try:
            done = subprocess.run(
                [program, "-p"], capture_output=True, encoding="utf-8", errors="replace", check=True
            )
        except (OSError, subprocess.CalledProcessError):
            continue
        places: dict[str, list[Path]] = {}
        for name, path in re.findall(r"^\s*(\S+) \(.*\) => (\S+)$", done.stdout, re.MULTILINE):
            places.setdefault(name, []).append(Path(path))
        return places
    return {}


# --- ELF files: what they need and offer, read without running any of their code ------------------
# ``ldd`` may run the file that it is asked about, which is no way to look at a unit from elsewhere.


@dataclass(frozen=True)
class SharedObject:
    """What the dynamic linker reads of a program or library.

    Parameters
    ----------
    machine : processor, such as ``x64`` or ``AArch64``, and word length in bits.
    needed : names of the libraries that it names.
    search_path : folders that it names (RPATH, RUNPATH), ``$ORIGIN`` replaced.
    needed_versions : versions of interfaces that it asks of libraries, by library.
    versions : versions of its own interface.
    undefined, defined : names of symbols; weak ones may stay undefined and are not counted.
    interpreter : the dynamic linker of a program, empty for a library.
    """

    path: Path
    machine: tuple[str, int]
    needed: tuple[str, ...]
    search_path: tuple[str, ...]
    needed_versions: dict[str, tuple[str, ...]]
    versions: frozenset[str]
    undefined: frozenset[str]
    defined: frozenset[str]
    interpreter: str


def read_shared_object(path: Path) -> SharedObject | None:
    """Read an ELF file; None for a file of another kind, or one that is damaged."""
    try:
        with path.open("rb") as stream:
            return _read(path, ELFFile(stream))
    except (OSError, ELFError, ValueError, UnicodeDecodeError, AttributeError):
        # what a damaged table raises inside the reader is not foreseeable beyond these
        return None


def read_installed(path: Path) -> SharedObject | None:
    """Read a library or program that is installed, once as long as it stays as it is.

    Most units need the same few, of which the C library has thousands of symbols.
    """
    try:
        state = path.stat()
    except OSError:
        return None
    return _read_once(path, state.st_mtime_ns, state.st_size)


@functools.lru_cache(maxsize=64)
def _read_once(path: Path, changed: int, size: int) -> SharedObject | None:
    return read_shared_object(path)


def _read(path: Path, elf: ELFFile) -> SharedObject:
    needed, search_path = [], []
    dynamic = elf.get_section_by_name(".dynamic")
    for tag in dynamic.iter_tags() if dynamic is not None else ():
        if tag.entry.d_tag == "DT_NEEDED":
            needed.append(tag.needed)
        elif tag.entry.d_tag in ("DT_RPATH", "DT_RUNPATH"):
            text = tag.rpath if tag.entry.d_tag == "DT_RPATH" else tag.runpath
            origin = str(path.resolve().parent)
            search_path += text.replace("${ORIGIN}", origin).replace("$ORIGIN", origin).split(":")
    undefined, defined = set(), set()
    symbols = elf.get_section_by_name(".dynsym")
    for symbol in symbols.iter_symbols() if symbols is not None else ():
        if symbol["st_shndx"] != "SHN_UNDEF":
            defined.add(symbol.name)
        elif symbol["st_info"]["bind"] == "STB_GLOBAL":
            undefined.add(symbol.name)
    program = next((s for s in elf.iter_segments() if s["p_type"] == "PT_INTERP"), None)
    return SharedObject(
        path=path,
        machine=(elf.get_machine_arch(), elf.elfclass),
        needed=tuple(needed),
        search_path=tuple(search_path),
        needed_versions=_needed_versions(elf),
        versions=_versions(elf),
        undefined=frozenset(undefined),
        defined=frozenset(defined),
        interpreter="" if program is None else program.get_interp_name(),
    )


def _needed_versions(elf: ELFFile) -> dict[str, tuple[str, ...]]:
    section = elf.get_section_by_name(".gnu.version_r")
    if section is None:
        return {}
    return {
        need.name: tuple(version.name for version in versions)
        for need, versions in section.iter_versions()
    }


def _versions(elf: ELFFile) -> frozenset[str]:
    section = elf.get_section_by_name(".gnu.version_d")
    if section is None:
        return frozenset()
    return frozenset(next(names).name for _, names in section.iter_versions())


# --- the binary for this platform -----------------------------------------------------------------


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
    own = read_installed(Path(sys.executable).resolve())
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
