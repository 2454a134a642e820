"""The Python that will run a unit: its version, library and packages, asked of itself."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lcmchain.errors import InputError

# Runs in any Python 3; finds modules without running them.
_PROBE = r"""
import json, os, re, sys, sysconfig
from importlib.util import find_spec
asked = json.loads(sys.argv[1])
def has(name):
    try:
        return find_spec(name) is not None
    except Exception:
        return False
def version(name):
    try:
        from importlib.metadata import version
        return version(name)
    except Exception:
        return None
mapped = []
if os.path.exists("/proc/self/maps"):
    with open("/proc/self/maps") as lines:
        mapped = sorted({line.split()[-1] for line in lines if re.search(r"/libpython3\.\d", line)})
names = ("LIBDIR", "INSTSONAME", "LDLIBRARY", "Py_ENABLE_SHARED")
settings = {name: sysconfig.get_config_var(name) for name in names}
print(json.dumps({
    "version": sys.version.split()[0], "executable": sys.executable, "prefix": sys.prefix,
    "base_prefix": sys.base_prefix, "bits": 64 if sys.maxsize > 2**32 else 32,
    "settings": settings, "mapped": mapped,
    "modules": {name: has(name) for name in asked["modules"]},
    "distributions": {name: version(name) for name in asked["distributions"]},
}))
"""


@dataclass(frozen=True)
class Interpreter:
    """What a Python says of itself.

    Parameters
    ----------
    library : its shared library, None where it has none.
    modules : whether a module is there, for those that were asked for.
    distributions : version of a package, None where it is not installed.
    """

    version: str
    executable: Path
    prefix: Path
    bits: int
    library: Path | None
    modules: dict[str, bool] = field(default_factory=dict)
    distributions: dict[str, str | None] = field(default_factory=dict)

    @property
    def minor(self) -> str:
        """Version without the last number, such as 3.12."""
        return ".".join(self.version.split(".")[:2])

    @property
    def start(self) -> str:
        """What to write before the command of a host on Linux that is no Python."""
        folder = self.executable.parent
        return f"LD_PRELOAD={self.library} PATH={folder}:$PATH"


def ask_interpreter(
    python: Path | str, modules: Sequence[str] = (), distributions: Sequence[str] = ()
) -> Interpreter:
    """Start a Python and ask it.

    Raises
    ------
    InputError : it cannot be started, or is none.
    """
    found = shutil.which(str(python))
    if found is None:
        raise InputError(f'there is no Python "{python}"; name its file', key="--python")
    asked = json.dumps({"modules": list(modules), "distributions": list(distributions)})
    try:
        with tempfile.TemporaryDirectory() as empty:
            done = subprocess.run(
                [str(Path(found).absolute()), "-c", _PROBE, asked],
                capture_output=True, encoding="utf-8", errors="replace", timeout=60,
                cwd=empty,
            )  # fmt: skip
        answer = json.loads(done.stdout)
    except (OSError, subprocess.TimeoutExpired, ValueError) as error:
        raise InputError(
            f"this is no Python 3 that can be started ({error})", file=str(python)
        ) from None
    return Interpreter(
        version=answer["version"],
        executable=Path(answer["executable"]),
        prefix=Path(answer["prefix"]),
        bits=answer["bits"],
        library=_library(answer),
        modules=answer["modules"],
        distributions=answer["distributions"],
    )


def _library(answer: dict) -> Path | None:
    """Return the shared library of a Python: the one it runs from, else the one beside it."""
    for mapped in answer["mapped"]:
        return Path(mapped)
    settings, version = answer["settings"], ".".join(answer["version"].split(".")[:2])
    names = [f"libpython{version}.so.1.0", f"libpython{version}.so"]
    if settings["INSTSONAME"] and ".so" in settings["INSTSONAME"]:
        names.insert(0, settings["INSTSONAME"])
    # a Python that was built elsewhere and moved still says where it was built
    folders = [settings["LIBDIR"], Path(answer["base_prefix"], "lib")]
    for folder in folders:
        for name in names if folder else ():
            if Path(folder, name).is_file():
                return Path(folder, name)
    return None
