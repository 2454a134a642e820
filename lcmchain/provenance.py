"""Where a result comes from: what decides its numbers, as hashes; versions, machine, date.

The hashes of what decides the numbers are recorded as ``run_fingerprint`` in ``summary.json``, in
checkpoints and in the saved states of forming units, none of which may outlive a change of it. It
is not ``scene_sha256``: that is the hash of the text of a scene file, which a scene built in Python
does not have, and which says nothing about the files that a scene names.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lcmchain import __version__
from lcmchain.compilation.cache import source_hash
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from lcmchain.scene import Scene


# --- what decides the numbers of a forming run ----------------------------------------------------


# Tables of a scene that are applied to the saved frames, after forming; its title; and how it would
# be draped, which no run with checkpoints is.
AFTER_FORMING = {"title", "output", "mapping", "permeability", "infiltration", "fmu", "draping"}


#: Keys of :func:`forming_values` that follow from others where a scene does not give them, by how
#: a scene writes them.
MAY_BE_FOUND = {
    "process.time": "process.time",
    "process.mass_damping": "process.mass_damping",
    "process.damping_average": "process.damping_average",
    "history_interval": "output.history_interval",
}


class Fingerprint(NamedTuple):
    """Hashes of the parts that decide the numbers of a forming run.

    scene : of the validated values, in SI; of a scene built in Python as of one from a file.
    files : of the contents of the mesh files that its tools name, and of what the drawings of its
        blanks hold.
    sources : of the source files of lcmchain. A version would not tell two states of a
        development install apart. Processor and numba may change the last bits and are left out.
    """

    scene: str
    files: str
    sources: str

    @property
    def sha256(self) -> str:
        """Hash of all parts."""
        return hashlib.sha256(json.dumps(self).encode()).hexdigest()

    def difference(self, other: Fingerprint, keys: Sequence[str] = ()) -> str:
        """Say in words what differs from another run, empty if nothing does.

        keys : of the entries of the scene that differ, as far as they are known. The first is
            named, but an entry that the program may find from others only where it is alone.
        """
        first = min(keys, key=lambda key: key in MAY_BE_FOUND, default="")
        words = {
            "scene": "another scene (or other --set values)"
            + (f", which differs in {MAY_BE_FOUND.get(first, first)}" if first else ""),
            "files": "other contents of the mesh files of its tools, or of its drawings",
            "sources": "other source files of lcmchain",
        }
        mine, others = self._asdict(), other._asdict()
        return " and ".join(text for part, text in words.items() if mine[part] != others[part])


def run_fingerprint(scene: Scene) -> Fingerprint:
    """Return the fingerprint of the forming run of a scene.

    Entries that are applied to the saved frames (title, ``[output]``, ``[[mapping]]``,
    ``[permeability]``, ``[infiltration]``, ``[fmu]``) are left out: a finished forming run serves a
    changed mapping. So is ``[draping]``, except where the blank is draped. An infiltration that
    goes on while the blank is formed counts.

    Raises
    ------
    InputError : a file that a tool names cannot be read.
    """
    values = json.dumps(forming_values(scene), sort_keys=True)
    return Fingerprint(
        scene=hashlib.sha256(values.encode()).hexdigest(),
        files=_file_hash(scene),
        sources=_sources(),
    )


def forming_values(scene: Scene) -> dict[str, Any]:
    """Return the entries of a scene that decide the numbers of its forming run, in plain values."""
    values: dict[str, Any] = scene.model_dump(mode="json", exclude=AFTER_FORMING)
    values["history_interval"] = scene.history_interval  # the one entry of [output] that forms
    if scene.element.type == "kinematic":
        values |= scene.model_dump(mode="json", include={"draping"})
    if scene.wet_forming is not None:
        forms = ("infiltration", "permeability")
        values |= scene.model_dump(mode="json", include=set(forms))
    return values


def written_values(scene: Scene) -> dict[str, Any]:
    """Return the tables of a scene that form the sheet, as they were written, in plain values."""
    values = forming_values(scene)
    for name, table in scene.as_written.items():
        if isinstance(table, tuple):
            values[name] = [entry.model_dump(mode="json") for entry in table]
        else:
            values[name] = table.model_dump(mode="json")
    return json.loads(json.dumps(values))


def differing_keys(one: object, other: object, key: str = "") -> Iterator[str]:
    """Yield the keys of what differs between two trees of plain values."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in dict.fromkeys((*one, *other)):
            yield from differing_keys(
                one.get(name), other.get(name), f"{key}.{name}" if key else name
            )
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            named = pair[0].get("name") if isinstance(pair[0], dict) else None
            yield from differing_keys(*pair, f"{key}.{named}" if named else f"{key}[{number}]")
    elif one != other:
        yield key


@cache
def _sources() -> str:
    """Hash of the sources when this process first asked: a unit asks at every instantiation."""
    return source_hash()


def _file_hash(scene: Scene) -> str:
    """Hash the mesh files that tools name, and what the drawings of blanks hold."""
    digest = hashlib.sha256()
    for tool in scene.tools:
        name = getattr(tool.shape, "file", None)
        if name is None:
            continue
        digest.update(_sha256(Path(scene.source.directory) / name))
    for blank in (scene.blank, *scene.plies):
        if blank is not None and blank.drawing is not None:
            digest.update(json.dumps(blank.shape).encode())
    return digest.hexdigest()


def _sha256(path: Path) -> bytes:
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None


# --- what a summary says of it, and lcmchain --version --------------------------------------------


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
    run_fingerprint : of :func:`run_fingerprint`.
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
        {
            "key": key,
            "file": str(file),
            "sha256": _sha256(scene.source.directory / file).hex(),
        }
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
