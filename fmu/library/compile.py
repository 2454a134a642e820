"""Compile the guard anew: ``python -m lcmchain.fmu.library.compile``, with gcc on x86-64.

The objects are part of the package, since a unit must be built where there is no compiler. Each
holds the hash of its sources, so that a test sees one that was left behind.
"""

from __future__ import annotations

import hashlib
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
SOURCES = {2: ("fmi2.c", "guard.h", "states.h"), 3: ("fmi3.c", "guard.h", "states.h")}
#: No call of a library, nothing to unwind, no data that changes, no address that is not relative.
OPTIONS = (
    "-std=c17 -Os -fPIC -ffreestanding -fno-builtin -fno-stack-protector -fcf-protection=none "
    "-fno-asynchronous-unwind-tables -fno-unwind-tables -fno-ident -fno-jump-tables "
    "-fno-tree-loop-distribute-patterns -march=x86-64 -mno-red-zone -Wall -Wextra -Werror"
).split()


def hash_of_sources(version: int) -> str:
    """Return the hash of the sources of a version of FMI."""
    digest = hashlib.sha256()
    for name in SOURCES[version]:
        digest.update((HERE / name).read_text(encoding="utf-8").encode())
    return digest.hexdigest()


def compiled(version: int, compiler: str = "gcc") -> bytes:
    """Return the object of the guard of a version of FMI.

    Raises
    ------
    subprocess.CalledProcessError : the compiler has refused it.
    """
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "guard.o"
        stamp = f'-DSOURCES="{hash_of_sources(version)}"'
        command = [compiler, *OPTIONS, stamp, "-c", SOURCES[version][0], "-o", str(made)]
        subprocess.run(command, cwd=HERE, check=True)
        subprocess.run(["strip", "--strip-unneeded", str(made)], check=True)
        return made.read_bytes()


if __name__ == "__main__":
    for version in SOURCES:
        (HERE / f"fmi{version}.o").write_bytes(compiled(version))
