"""Where the dynamic linker of this machine finds the libraries of a file, and what it misses."""

from __future__ import annotations

import functools
import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lcmchain.fmu.doctor.shared_objects import SharedObject, read_shared_object

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
    found: dict[str, SharedObject] = {}
    absent: dict[str, str] = {}
    waiting = [(name, file) for name in file.needed]
    while waiting:
        name, by = waiting.pop(0)
        if name in found or name in absent:
            continue
        library = _find(name, by, file)
        if library is None:
            absent[name] = by.path.name
            continue
        found[name] = library
        waiting += [(other, library) for other in library.needed]
    offered = frozenset().union(file.defined, *(library.defined for library in found.values()))
    return Linkage(file, found, absent, tuple(_old(file, found)), file.undefined - offered)


def _old(
    file: SharedObject, found: dict[str, SharedObject]
) -> Iterator[tuple[str, tuple[str, ...], str]]:
    for name, versions in file.needed_versions.items():
        library = found.get(name)
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
            library = read_shared_object(candidate)
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
