"""The plate by CalculiX: C3D8R, explicit dynamics.

``*DYNAMIC, EXPLICIT`` chooses its step once, from the volumes and the wave speed; with DIRECT,
version 2.20 does not end. No file of it tells the number of increments: a run of a few of them that
prints each gives the length of one.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lcmchain.bench.peers.plate import DENSITY, POISSON_RATIO, YOUNG_MODULUS, Plate, Run
from lcmchain.errors import LcmchainError

# Increments, about, of the run that tells how long one is.
COUNTED = 10
NEVER = 1_000_000
ONE_THREAD = ("OMP_NUM_THREADS", "CCX_NPROC_RESULTS", "CCX_NPROC_STIFFNESS", "NUMBER_OF_CPUS")


class CalculiX:
    """CalculiX as ``ccx``, or as another command."""

    name = "CalculiX C3D8R, explicit"
    install = "not installed: apt-get install calculix-ccx"

    def __init__(self, command: str = "ccx") -> None:
        self.command = command
        self._increment: dict[int, float] = {}

    def version(self) -> str | None:
        if shutil.which(self.command) is None:
            return None
        said = subprocess.run(
            [self.command, "-v"], capture_output=True, encoding="utf-8", errors="replace"
        ).stdout
        found = re.search(r"Version (\S+)", said)
        return found.group(1) if found else "unknown"

    def run(self, plate: Plate, duration: float) -> Run:
        processor, wall, states = self._solve(plate, duration, every_increment=False)
        steps = math.ceil(duration / self.increment(plate) * (1.0 - 1e-6))
        return Run(steps, processor, wall, states[-1][1])

    def increment(self, plate: Plate) -> float:
        """Return the length of an increment [s], from the first states of a short run."""
        size = len(plate.elements)
        if size not in self._increment:
            _, _, states = self._solve(plate, COUNTED * plate.step, every_increment=True)
            self._increment[size] = states[1][0] - states[0][0]
        return self._increment[size]

    def _solve(
        self, plate: Plate, duration: float, *, every_increment: bool
    ) -> tuple[float, float, list[tuple[float, np.ndarray]]]:
        """Return time of the processor, wall time [s], and the states that the run printed."""
        environment = os.environ | dict.fromkeys(ONE_THREAD, "1")
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            deck = folder / "plate.inp"
            deck.write_text(
                _deck(plate, duration, 1 if every_increment else NEVER), encoding="utf-8"
            )
            before, begin = os.times(), time.perf_counter()
            ended = subprocess.run(
                [self.command, "plate"],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
            )
            wall, after = time.perf_counter() - begin, os.times()
            printed = folder / "plate.dat"
            states = _states(printed.read_text(encoding="utf-8")) if printed.exists() else []
        if ended.returncode != 0 or not states:
            last = " ".join(ended.stdout.split()[-30:])
            raise LcmchainError(f"{self.command} did not compute the plate of the bench: {last}")
        processor = after.children_user - before.children_user
        processor += after.children_system - before.children_system
        return processor, wall, states


def _deck(plate: Plate, duration: float, frequency: int) -> str:
    """Return the deck of CalculiX; its default names in the order of VTK."""
    first_try = 1e-3 * plate.step
    return "\n".join([
        "*NODE, NSET=ALL",
        *_numbered(plate.nodes),
        "*ELEMENT, TYPE=C3D8R, ELSET=PLATE",
        *(f"{i}, " + ", ".join(map(str, row + 1)) for i, row in enumerate(plate.elements, 1)),
        "*MATERIAL, NAME=ELASTIC",
        "*ELASTIC",
        f"{YOUNG_MODULUS:.12g}, {POISSON_RATIO:.12g}",
        "*DENSITY",
        f"{DENSITY:.12g}",
        "*SOLID SECTION, ELSET=PLATE, MATERIAL=ELASTIC",
        "*INITIAL CONDITIONS, TYPE=VELOCITY",
        *(f"{i}, 1, {v:.12g}" for i, v in enumerate(plate.velocity[:, 0], 1)),
        f"*STEP, NLGEOM, INC={NEVER}",
        "*DYNAMIC, EXPLICIT",
        f"{first_try:.9g}, {duration:.12g}",
        f"*NODE PRINT, NSET=ALL, FREQUENCY={frequency}",
        "U",
        "*END STEP",
        "",
    ])  # fmt: skip


def _numbered(rows: np.ndarray) -> Sequence[str]:
    return [f"{i}, " + ", ".join(f"{v:.12g}" for v in row) for i, row in enumerate(rows, 1)]


def _states(text: str) -> list[tuple[float, np.ndarray]]:
    """Return time [s] and displacements (node_count, 3) [m] of each state in a ``.dat`` file."""
    _, *parts = re.split(r"displacements.*time\s+(\S+)", text)
    times, tables = parts[::2], parts[1::2]
    return [
        (float(t), np.array([line.split()[1:] for line in table.strip().splitlines()], dtype=float))
        for t, table in zip(times, tables, strict=True)
    ]
