"""Displacements in result files of CalculiX (``.frd``, ASCII).

Format: manual of CalculiX GraphiX, "Result format". Numbers have five digits after the point.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError

#: Last line of a whole file.
END = "9999"


@dataclass(frozen=True)
class NodalResult:
    """Displacements of one step, or of one mode of it.

    Parameters
    ----------
    mode : number of the mode from 1, 0 for a static step.
    value : frequency of the mode [Hz], or time of the step.
    node_ids : (N,). displacement : in the units of the deck, (N, 3).
    """

    mode: int
    value: float
    node_ids: np.ndarray
    displacement: np.ndarray


def read_displacements(path: Path | str) -> list[NodalResult]:
    """Read every block of displacements of a result file.

    Raises
    ------
    InputError : the file is absent, binary or broken.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if not lines or lines[-1].strip() != END:
        raise InputError("this result of CalculiX has no end; was the run cut off?", file=path)
    results = []
    mode, value = 0, 0.0
    number = 0
    try:
        while number < len(lines):
            line = lines[number]
            number += 1
            if line.startswith("    1PSTEP"):
                mode = 0
            elif line.startswith("    1PMODE"):
                mode = int(line[10:])
            elif line.startswith("  100C"):
                value = float(line[12:24])
            elif line.startswith(" -4  DISP"):
                end = next(k for k in range(number, len(lines)) if lines[k].startswith(" -3"))
                rows = [row for row in lines[number:end] if row.startswith(" -1")]
                results.append(_block(mode, value, rows))
                number = end
    except (ValueError, StopIteration):
        raise InputError(
            f"the block at line {number} is none of a CalculiX result in ASCII", file=path
        ) from None
    return results


def _block(mode: int, value: float, rows: list[str]) -> NodalResult:
    ids = np.array([int(row[3:13]) for row in rows], dtype=np.int64)
    parts = [[float(row[k : k + 12]) for k in (13, 25, 37)] for row in rows]
    return NodalResult(mode, value, ids, np.array(parts).reshape(-1, 3))
