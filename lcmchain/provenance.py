"""Where a result comes from: scene and files with their hashes, versions, machine, date."""

from __future__ import annotations

import hashlib
import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lcmchain import __version__
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from lcmchain.scene import Scene

#: Libraries whose version may change the last bits of a result, or how its files are written.
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "xarray", "netCDF4", "meshio")
#: Further ones that ``lcmchain --version`` tells: what reads, writes and packs files.
FURTHER = ("h5py", "fmpy", "pythonfmu", "pythonfmu3", "pydantic", "pint", "shapely", "ezdxf")
#: What each extra of the package installs for its users, and what it is for.
EXTRAS = {
    "video": ("imageio-ffmpeg", "films as MP4"),
    "study": ("distributed", "studies with runs side by side"),
    "peers": ("KratosMultiphysics", "lcmchain bench --peers"),
    "excel": ("openpyxl", "workbooks of testing machines"),
    "union": ("manifold3d", "union = true of a tool"),
    "precice": ("pyprecice", "lcmchain precice"),
}
#: How to cite the program.
CITATION = Path(__file__).with_name("CITATION.cff")


def provenance(scene: Scene, *, run_fingerprint: str, threads: int) -> dict[str, Any]:
    """Return where a result comes from, in plain values for ``summary.json``.

    Parameters
    ----------
    scene : the scene; its text is in ``forming.nc`` and in the report.
    run_fingerprint : of :func:`lcmchain.fingerprint.run_fingerprint`.
    threads : of the compiled loops.

    Raises
    ------
    InputError : a file that the scene names cannot be read.
    """
    return {
        "scene_file": None if scene.source.path is None else str(scene.source.path),
        "scene_sha256": scene.source.sha256,
        "run_fingerprint": run_fingerprint,
        "files": scene_files(scene),
        "lcmchain": __version__,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
        "platform": platform.platform(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": threads,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def scene_files(scene: Scene) -> list[dict[str, str]]:
    """Return scene key, name and SHA-256 of every surface and mesh that a scene names.

    Raises
    ------
    InputError : one of them cannot be read.
    """
    named = [
        (f'tools "{tool.name}".shape.file', file)
        for tool in scene.tools
        if (file := getattr(tool.shape, "file", None)) is not None
    ]
    named += [(f'mapping "{target.name}".mesh', target.mesh) for target in scene.mapping]
    return [
        {"key": key, "file": str(file), "sha256": _sha256(scene.source.directory / file)}
        for key, file in named
    ]


def versions() -> list[str]:
    """Return the lines of ``lcmchain --version``: what the program runs on, and what it lacks.

    Examples
    --------
    >>> versions()[0].startswith("lcmchain ")
    True
    """
    known = [f"{name} {found}" for name in (*LIBRARIES, *FURTHER) if (found := _version(name))]
    lines = [
        f"lcmchain {__version__}",
        f"python {platform.python_version()} on {platform.platform()}",
        ", ".join(known),
    ]
    for extra, (name, use) in EXTRAS.items():
        found = _version(name)
        state = f"{name} {found}" if found else f'not installed: pip install "lcmchain[{extra}]"'
        lines.append(f"extra {extra} ({use}): {state}")
    return [*lines, f"how to cite: {CITATION}"]


def _version(name: str) -> str | None:
    """Version of an installed library, None where it is not there."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def processor() -> str:
    """Return the name of the processor, as far as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass  # another system than Linux
    return platform.processor() or platform.machine()


def _sha256(path: Path) -> str:
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
